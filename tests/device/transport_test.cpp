// Oracles: the contract of transport.h, and openers made here whose answers are known.
#include "device/transport.h"

#include <memory>

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint::device {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Opens everything of one scheme and notes what it was asked for.
class TransportRegistryTest : public ::testing::Test {
 protected:
  TransportRegistry::Opener noting_opener() {
    return [this](std::string_view rest, Env& env) -> Result<Link> {
      EXPECT_EQ(&env, &memory_.env);
      opened_.emplace_back(rest);
      return Link{};
    };
  }
  static TransportRegistry::Opener failing_opener(ErrorCode code) {
    return [code](std::string_view rest, Env&) -> Result<Link> {
      return fail(code, "the opener's words", std::string(rest), "the opener's hint");
    };
  }
  MemoryEnv memory_;
  TransportRegistry links_;
  std::vector<std::string> opened_;
};

TEST_F(TransportRegistryTest, TheOpenerGetsAllBehindTheFirstColon) {
  links_.add("test", "test:PLACE", noting_opener());
  for (const char* address : {"test:here", "test:", "test:a:b", "test::"}) {
    const auto link = links_.open(address, memory_.env);
    ASSERT_OK(link);
    EXPECT_EQ(link->address, address);
  }
  EXPECT_THAT(opened_, ElementsAre("here", "", "a:b", ":"));
}

TEST_F(TransportRegistryTest, AnAddressWithoutAKnownSchemeIsWrongUse) {
  links_.add("test", "test:PLACE", noting_opener());
  links_.add("other", "other:PORT", noting_opener());
  for (const char* address : {"", ":", ":here", "test", "Test:here", " test:here", "tes:t"}) {
    SCOPED_TRACE(address);
    const auto link = links_.open(address, memory_.env);
    EXPECT_FAILS(link, ErrorCode::usage);
    EXPECT_THAT(link.error().what, HasSubstr("'" + std::string(address) + "'"));
    EXPECT_EQ(link.error().hint, "use one of: other:PORT, test:PLACE");
  }
  EXPECT_THAT(opened_, IsEmpty());
}

TEST_F(TransportRegistryTest, AnAddressFromOutsideIsSafeToPrint) {
  links_.add("test", "test:PLACE", noting_opener());
  const auto rings = links_.open("bell\a\n:1", memory_.env);
  EXPECT_FAILS(rings, ErrorCode::usage);
  EXPECT_THAT(rings.error().what, HasSubstr("bell\\x07\\x0a:1"));
  const auto is_long = links_.open(std::string(1000, 'a'), memory_.env);
  EXPECT_FAILS(is_long, ErrorCode::usage);
  EXPECT_LT(is_long.error().what.size(), 150U);
}

TEST_F(TransportRegistryTest, TheErrorOfAnOpenerComesThroughWhole) {
  for (const ErrorCode code : {ErrorCode::usage, ErrorCode::device_unavailable,
                               ErrorCode::permission, ErrorCode::no_input}) {
    links_.add("test", "test:PLACE", failing_opener(code));
    const auto link = links_.open("test:here", memory_.env);
    EXPECT_FAILS(link, code);
    EXPECT_EQ(link.error().brief(), "here: the opener's words; the opener's hint");
  }
}

TEST_F(TransportRegistryTest, ExamplesAreInTheOrderOfTheSchemes) {
  EXPECT_THAT(links_.examples(), IsEmpty());
  links_.add("usb", "usb:SERIAL", noting_opener());
  links_.add("hid", "hid:SERIAL", noting_opener());
  EXPECT_THAT(links_.examples(), ElementsAre("hid:SERIAL", "usb:SERIAL"));
}

TEST_F(TransportRegistryTest, AddingASchemeAgainReplacesIt) {
  links_.add("test", "test:PLACE", noting_opener());
  links_.add("test", "test:OTHER", failing_opener(ErrorCode::io));
  EXPECT_FAILS(links_.open("test:here", memory_.env), ErrorCode::io);
  EXPECT_THAT(links_.examples(), ElementsAre("test:OTHER"));
  EXPECT_THAT(opened_, IsEmpty());
}

TEST_F(TransportRegistryTest, ALinkCanBeOpenedAgainAlsoWithoutTheRegistryAndTheString) {
  auto short_lived = std::make_unique<TransportRegistry>();
  short_lived->add("test", "test:PLACE", noting_opener());
  auto address = std::make_unique<std::string>("test:a place whose name is on the heap");
  const auto link = short_lived->open(*address, memory_.env);
  ASSERT_OK(link);
  address.reset();
  short_lived.reset();
  EXPECT_EQ(link->address, "test:a place whose name is on the heap");
  ASSERT_OK(link->reopen());
  ASSERT_OK(link->reopen());
  EXPECT_THAT(opened_,
              ElementsAre("a place whose name is on the heap", "a place whose name is on the heap",
                          "a place whose name is on the heap"));
}

TEST_F(TransportRegistryTest, TheOpenersOwnWayToOpenAgainIsKept) {
  links_.add("test", "test:PLACE", [](std::string_view, Env&) -> Result<Link> {
    Link link;
    link.reopen = []() -> Result<Link> {
      return fail(ErrorCode::device_unavailable, "gone", {}, "plug it in");
    };
    return link;
  });
  const auto link = links_.open("test:here", memory_.env);
  ASSERT_OK(link);
  EXPECT_FAILS(link->reopen(), ErrorCode::device_unavailable);
}

TEST(BorrowClock, LeavesTheClockToItsOwner) {
  ManualClock clock;
  std::shared_ptr<Clock> borrowed = borrow_clock(clock);
  ASSERT_EQ(borrowed.get(), &clock);
  borrowed->sleep(std::chrono::hours(1));
  borrowed.reset();
  EXPECT_EQ(clock.elapsed(), std::chrono::hours(1)) << "and it is alive still";
}

}  // namespace
}  // namespace sixpoint::device
