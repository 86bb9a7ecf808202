// sixpoint units by its contract.
#include "cli/command_fixture.h"
#include "cli/people_text.h"

namespace sixpoint {
namespace {

using tests::StoreTest;

TEST_F(StoreTest, UnitsListsTheUnitsOfTheStore) {
  fill("a.db");
  const auto answer = run({"units", "--store", path("a.db"), "--json"});
  EXPECT_EQ(answer.exit_code, 0);
  EXPECT_EQ(answer.json(), cli::Json::parse(R"({"schema": "sixpoint/units/1", "units": [
      {"serial": "MOS2A1", "model": "w", "first_seen": "1970-01-01T00:16:40Z", "constants": 1}]})"));
  EXPECT_EQ(run({"units", "--store", path("a.db")}).out,
            "unit    type  first seen                  sets of constants\n"
            "MOS2A1  w     " +
                cli::local_time(from_unix_seconds(1000)) + "  1\n");
  const auto none = run({"units", "--store", path("none.db"), "--json"});
  EXPECT_EQ(none.exit_code, 66);
  EXPECT_EQ(none.json()["error"]["code"], "no_input");
}

}  // namespace
}  // namespace sixpoint
