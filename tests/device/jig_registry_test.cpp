#include "device/jig_registry.h"

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/made_units.h"
#include "expect_result.h"

namespace sixpoint::device {
namespace {

using tests::virtual_units;

TEST(JigRegistry, OpensBySchemeAndNamesAllKinds) {
  MemoryEnv memory;
  const auto unit = *virtual_units().open("virtual:seed=7", memory.env);
  JigRegistry jigs;
  jigs.add("test", "test:SERIAL", [&](std::string_view rest, Env&, Unit& in_jig) {
    EXPECT_EQ(&in_jig, unit.get());
    EXPECT_EQ(rest, "J1");
    return Result<std::unique_ptr<Jig>>(std::make_unique<ManualJig>());
  });
  EXPECT_OK(jigs.open("test:J1", memory.env, *unit));
  const auto none = jigs.open("crane", memory.env, *unit);
  EXPECT_FAILS(none, ErrorCode::usage);
  EXPECT_EQ(none.error().hint, "use one of: manual, test:SERIAL");
}

// Oracle: the address by hand: the scheme ends at the first colon, the rest is the opener's.
TEST(JigRegistry, TheRestOfTheAddressGoesToTheOpenerAsItIs) {
  MemoryEnv memory;
  const auto unit = *virtual_units().open("virtual:seed=7", memory.env);
  JigRegistry jigs;
  std::vector<std::string> seen;
  jigs.add("com", "com:PORT", [&](std::string_view rest, Env& env, Unit&) {
    EXPECT_EQ(&env, &memory.env);
    seen.emplace_back(rest);
    return Result<std::unique_ptr<Jig>>(std::make_unique<ManualJig>());
  });
  EXPECT_OK(jigs.open("com:/dev/ttyUSB0:9600", memory.env, *unit));
  EXPECT_OK(jigs.open("com:", memory.env, *unit));
  EXPECT_EQ(seen, (std::vector<std::string>{"/dev/ttyUSB0:9600", ""}));
  for (const char* address : {"", "com", "COM:1", ":com", "manual"}) {
    EXPECT_FAILS(jigs.open(address, memory.env, *unit), ErrorCode::usage);
  }
  EXPECT_EQ(seen.size(), 2U) << "nothing was opened for them";
}

TEST(JigRegistry, AnOpenersErrorIsTheAnswerAndTheLastOfANameCounts) {
  MemoryEnv memory;
  const auto unit = *virtual_units().open("virtual:seed=7", memory.env);
  JigRegistry jigs;
  const auto failing = [](const char* what) {
    return [what](std::string_view, Env&, Unit&) -> Result<std::unique_ptr<Jig>> {
      return fail(ErrorCode::device_unavailable, what, "J1", "plug the jig in");
    };
  };
  jigs.add("hid", "hid:SERIAL", failing("the first"));
  jigs.add("hid", "hid:JIG", failing("the second"));
  const auto jig = jigs.open("hid:J1", memory.env, *unit);
  EXPECT_FAILS(jig, ErrorCode::device_unavailable);
  EXPECT_EQ(jig.error().what, "the second");
  EXPECT_EQ(jigs.open("none:", memory.env, *unit).error().hint, "use one of: manual, hid:JIG");
}

}  // namespace
}  // namespace sixpoint::device
