// How a command is declared: what the command line gives is what the work gets.
#include "cli/command.h"

#include <sstream>

#include <gtest/gtest.h>

namespace sixpoint::cli {
namespace {

struct Options {
  int count = 0;
  bool json = false;
};

struct WithoutJson {
  int count = 0;
};

class Command : public testing::Test {
 protected:
  std::ostringstream out_;
  std::ostringstream people_;
  std::istringstream in_;
  Context context_{posix_env(), out_, people_, in_};
  CLI::App app_;
};

TEST_F(Command, TheWorkGetsItsOptionsOnce) {
  int calls = 0;
  const auto work = [&](const Options& options, Context&) -> Status {
    ++calls;
    EXPECT_EQ(options.count, 7);
    EXPECT_TRUE(options.json);
    return {};
  };
  auto [command, options] = add_command<Options>(app_, context_, "count", "counts", work);
  command.add_option("--count", options.count, "how many");
  app_.parse("count --count 7 --json");
  EXPECT_EQ(calls, 1);
  EXPECT_EQ(context_.exit_code, 0);
  app_.parse("");
  EXPECT_EQ(calls, 1) << "a command that was not chosen does not run";
}

TEST_F(Command, AnErrorOfTheWorkIsReportedAndBecomesTheExitCode) {
  const auto work = [](const Options&, Context&) -> Status {
    return fail(ErrorCode::no_input, "it is not there", "a.gt3x", "name another file");
  };
  add_command<Options>(app_, context_, "files count", "count", "counts", work);
  app_.parse("count");
  EXPECT_EQ(context_.exit_code, 66);
  EXPECT_EQ(out_.str(), "");
  EXPECT_EQ(people_.str(), "sixpoint: a.gt3x: it is not there; name another file\n");
  app_.parse("count --json");
  EXPECT_EQ(Json::parse(out_.str())["schema"], "sixpoint/files count/1");
  EXPECT_EQ(Json::parse(out_.str())["error"]["code"], "no_input");
}

TEST_F(Command, OnlyOptionsWithJsonHaveTheFlag) {
  add_command<WithoutJson>(app_, context_, "count", "counts",
                           [](const WithoutJson&, Context&) -> Status { return {}; });
  EXPECT_THROW(app_.parse("count --json"), CLI::ExtrasError);
}

TEST_F(Command, AGroupNeedsOneOfItsCommands) {
  CLI::App& group = add_group(app_, "files", "what is done to files");
  add_command<Options>(group, context_, "count", "counts",
                       [](const Options&, Context&) -> Status { return {}; });
  EXPECT_THROW(app_.parse("files"), CLI::RequiredError);
  EXPECT_NO_THROW(app_.parse("files count"));
}

}  // namespace
}  // namespace sixpoint::cli
