#include "device/unit_registry.h"

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "device/made_units.h"
#include "expect_result.h"

namespace sixpoint::device {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using tests::virtual_units;

Status stream(const UnitRegistry& registry, Env& env) {
  SIXPOINT_ASSIGN(const auto unit, registry.open("virtual:seed=7", env));
  SIXPOINT_CHECK(unit->start_stream(100));
  SIXPOINT_ASSIGN(const auto block, unit->next_samples(std::chrono::seconds(1)));
  EXPECT_EQ(block->counts.size(), 6U) << "a full report of docs/protocol.md";
  return unit->stop_stream();
}

TEST(UnitRegistry, AUnitThatWasOpenedByItsAddressStreams) {
  MemoryEnv memory;
  EXPECT_OK(stream(virtual_units(), memory.env));
}

TEST(UnitRegistry, AnUnknownSchemeIsRefusedWithTheExamples) {
  MemoryEnv memory;
  UnitRegistry units = virtual_units();
  units.add("other", "other:PORT",
            [](std::string_view rest, Env&) -> Result<std::unique_ptr<Unit>> {
              return fail(ErrorCode::device_unavailable, "opened " + std::string(rest), {}, "none");
            });
  EXPECT_THAT(units.examples(), ElementsAre("virtual:seed=7,jig=auto", "other:PORT"));
  for (const char* address : {"", "virtual", "none:1", ":", "Virtual:seed=7"}) {
    const auto unit = units.open(address, memory.env);
    EXPECT_FAILS(unit, ErrorCode::usage);
    EXPECT_THAT(unit.error().hint, HasSubstr("virtual:seed=7"));
    EXPECT_THAT(unit.error().hint, HasSubstr("other:PORT"));
  }
  EXPECT_EQ(units.open("other:a:b", memory.env).error().what, "opened a:b");
}

TEST(UnitRegistry, ALinkIsWrappedBeforeTheFirstTransfer) {
  MemoryEnv memory;
  std::vector<std::string> addresses;
  const auto unit = virtual_units().open("virtual:seed=7", memory.env,
                                         [&](Link& link) { addresses.push_back(link.address); });
  ASSERT_OK(unit);
  EXPECT_THAT(addresses, ElementsAre("virtual:seed=7"));
}

}  // namespace
}  // namespace sixpoint::device
