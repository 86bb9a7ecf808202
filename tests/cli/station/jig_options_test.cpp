#include "cli/station/jig_options.h"

#include <sstream>

#include <CLI/App.hpp>
#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "device/session/session.h"
#include "expect_result.h"

namespace sixpoint::cli {
namespace {

// The options of docs/verdicts.md, docs/virtual.md and docs/sessions.md, by their names.
TEST(JigOptions, AreReadFromTheCommandLine) {
  CLI::App app;
  JigOptions options;
  add_jig_options(app, options);
  app.parse(
      "--device hid:MOS2A1 --jig manual --store s.db --record r.zip --gravity 9.81 "
      "--latitude 52.5 --altitude 34");
  EXPECT_EQ(options.device, "hid:MOS2A1");
  EXPECT_EQ(options.jig, "manual");
  EXPECT_EQ(options.store, "s.db");
  EXPECT_EQ(options.record, "r.zip");
  EXPECT_EQ(options.gravity.m_per_s2, 9.81);
  EXPECT_EQ(options.gravity.latitude_deg, 52.5);
  EXPECT_EQ(options.gravity.altitude_m, 34);
}

TEST(JigOptions, OnlyTheDeviceIsRequired) {
  CLI::App incomplete;
  JigOptions none;
  add_jig_options(incomplete, none);
  EXPECT_THROW(incomplete.parse("--jig manual"), CLI::RequiredError);

  CLI::App app;
  JigOptions options;
  add_jig_options(app, options);
  EXPECT_NO_THROW(app.parse("--device virtual:seed=7"));
  EXPECT_EQ(options.jig, "");
  EXPECT_EQ(options.record, "");
  EXPECT_FALSE(options.gravity.m_per_s2.has_value());
  EXPECT_THROW(app.parse("--device virtual:seed=7 --gravity heavy"), CLI::ConversionError);
}

TEST(JigOptions, WordsAtThePromptFollowTheTable) {
  for (const char* line : {"", "\r"}) {
    EXPECT_EQ(prompt_word(line), PromptWord::empty);
  }
  for (const char* line : {"s", "q", "stop", "stop\r"}) {
    EXPECT_EQ(prompt_word(line), PromptWord::stop) << line;
  }
  for (const char* line : {"n", "u", "nein", "S", " ", "+z", "stopp"}) {
    EXPECT_EQ(prompt_word(line), PromptWord::other) << line;
  }
}

struct Opening {
  Result<JiggedUnit> open(const std::string& device, const std::string& jig,
                          const std::string& record = {}) {
    JigOptions options;
    options.device = device;
    options.jig = jig;
    options.record = record;
    return open_unit(context, options, outputs, recorder);
  }
  MemoryEnv memory;
  std::ostringstream out;
  std::istringstream in;
  Context context{memory.env, out, out, in};
  Outputs outputs{context, {}, /*json=*/false};
  device::SessionRecorder recorder;
};

// docs/virtual.md: a virtual unit has a jig of its own with jig=auto, which `--jig virtual` asks
// for and any other name takes away.
TEST(JigOptions, UnitAndJigAreOpenedAsTheyAreNamed) {
  Opening opening;
  const auto own = opening.open("virtual:seed=7", "virtual");
  ASSERT_OK(own);
  EXPECT_EQ(own->jig->name(), "virtual");
  EXPECT_EQ(own->own_jig, nullptr) << "part of the unit";
  EXPECT_EQ(own->on_jig().unit, own->unit.get());
  EXPECT_EQ(own->on_jig().jig, own->jig);

  const auto manual = opening.open("virtual:seed=7,jig=auto", "manual");
  ASSERT_OK(manual);
  EXPECT_EQ(manual->jig->name(), "manual");
  EXPECT_EQ(manual->own_jig.get(), manual->jig);
  EXPECT_EQ(manual->unit->jig(), nullptr);

  EXPECT_FAILS(opening.open("virtual:seed=7", "robot"), ErrorCode::usage);
  EXPECT_FAILS(opening.open("virtual:colour=red", "virtual"), ErrorCode::usage);
  EXPECT_FAILS(opening.open("drive:none", ""), ErrorCode::no_input);
}

// docs/sessions.md: every transfer with the device is in the session, the first one too.
TEST(JigOptions, TheSessionBeginsBeforeTheUnitIsOpened) {
  Opening opening;
  ASSERT_OK(opening.open("virtual:seed=7", "manual", "r.zip"));
  ASSERT_OK(opening.recorder.finish());
  const auto session = device::read_session(opening.memory.files, "r.zip");
  ASSERT_OK(session);
  EXPECT_EQ(session->device, "virtual:seed=7,jig=none");
  ASSERT_FALSE(session->transfers.empty());
  EXPECT_EQ(session->transfers.front().bytes.at(4), 1) << "IDENTIFY";
}

}  // namespace
}  // namespace sixpoint::cli
