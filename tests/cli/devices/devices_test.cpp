// sixpoint devices by its contract; tests/usb has devices that are plugged in.
#include "cli/command_fixture.h"

namespace sixpoint {
namespace {

using tests::CommandTest;

TEST_F(CommandTest, DevicesAnswersWithAList) {
  const auto answer = run({"devices", "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  EXPECT_EQ(answer.json()["schema"], "sixpoint/devices/1");
  EXPECT_TRUE(answer.json()["devices"].is_array());
  EXPECT_EQ(run({"devices", "--for", "1"}).exit_code, 64) << "--for needs --watch";
  EXPECT_EQ(run({"devices", "--watch", "--for", "-1"}).exit_code, 64);
}

}  // namespace
}  // namespace sixpoint
