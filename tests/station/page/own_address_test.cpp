#include "station/page/own_address.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace sixpoint::station {
namespace {

MachineAddress address_v4(const std::string& text, bool is_up = true, bool is_loopback = false) {
  return {text, is_up, is_loopback, false, false};
}
MachineAddress address_v6(const std::string& text, bool is_of_one_link = false) {
  return {text, true, false, true, is_of_one_link};
}

// The table of own_address.h.
TEST(OwnAddress, FollowsItsTable) {
  const auto chosen = [](const std::vector<MachineAddress>& addresses, bool with_v6) {
    return choose_address(addresses, with_v6);
  };
  const MachineAddress own = address_v4("127.0.0.1", true, true);
  const MachineAddress down = address_v4("192.0.2.1", false);
  const MachineAddress first = address_v4("192.0.2.2");
  const MachineAddress second = address_v4("192.0.2.3");
  const MachineAddress link = address_v6("fe80::1", true);
  const MachineAddress wide = address_v6("2001:db8::1");
  for (const bool with_v6 : {false, true}) {
    EXPECT_EQ(chosen({own, down, link, wide, first, second}, with_v6), "192.0.2.2");
    EXPECT_EQ(chosen({own, down, link}, with_v6), "127.0.0.1");
    EXPECT_EQ(chosen({}, with_v6), "127.0.0.1");
  }
  EXPECT_EQ(chosen({own, link, wide}, true), "2001:db8::1");
  EXPECT_EQ(chosen({own, link, wide}, false), "127.0.0.1") << "the page does not listen there";
}

TEST(OwnAddress, TheSystemSaysWhichAddressIsOfLoopback) {
  const auto all = addresses_of_machine();
  const auto own = std::ranges::find_if(
      all, [](const MachineAddress& one) { return one.address == "127.0.0.1"; });
  ASSERT_NE(own, all.end()) << "the page itself listens on 127.0.0.1";
  EXPECT_TRUE(own->is_loopback);
  EXPECT_FALSE(own->is_v6);
  for (const MachineAddress& one : all) {
    EXPECT_EQ(one.is_v6, one.address.find(':') != std::string::npos) << one.address;
    EXPECT_EQ(one.is_of_one_link, one.address.starts_with("fe80:")) << one.address;
  }
}

}  // namespace
}  // namespace sixpoint::station
