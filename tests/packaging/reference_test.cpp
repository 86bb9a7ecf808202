// sixpoint_reference, as the build runs it. That every command is in the manual page and in the
// completion is tested with the package (tests/package/deb.sh); here: the form of what it writes.
#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/wait.h>

#include "temporary_folder.h"

namespace sixpoint {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string content_of(const std::string& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

class Reference : public testing::Test {
 protected:
  struct Answer {
    int exit_code = -1;
    std::string out;
    std::string people;
  };
  Answer run(const std::string& arguments) const {
    const std::string line = fmt::format("{} {} >'{}' 2>'{}'", SIXPOINT_REFERENCE, arguments,
                                         folder_ / "out", folder_ / "people");
    const int status = std::system(line.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, content_of(folder_ / "out"),
            content_of(folder_ / "people")};
  }
  // With this text as the template.
  Answer fill(const std::string& kind, const std::string& text) const {
    std::ofstream(folder_ / "template") << text;
    return run(fmt::format("{} '{}'", kind, folder_ / "template"));
  }
  // What stands between two lines of its own in the template.
  std::string filled(const std::string& kind) const {
    const Answer answer = fill(kind, "BEGIN\n%COMMANDS%\nEND\n");
    EXPECT_EQ(answer.exit_code, 0) << answer.people;
    EXPECT_TRUE(answer.out.starts_with("BEGIN\n")) << "what stands before stays";
    EXPECT_TRUE(answer.out.ends_with("END\n")) << "and what stands behind";
    return answer.out.substr(6, answer.out.size() - 10);
  }

  tests::TemporaryFolder folder_;
};

// Oracle: groff_man(7): a section of a command is .SS, an option is a paragraph .TP with its name
// in bold and its value in italics; a hyphen of an option's name is written \-. The text is that of
// `sixpoint audit verify --help`, by hand.
TEST_F(Reference, AnOptionIsATaggedParagraphOfItsCommand) {
  const std::string page = filled("man");
  EXPECT_THAT(page, HasSubstr(".SS sixpoint audit\n"));
  EXPECT_THAT(page, HasSubstr(".SS sixpoint audit verify\nfind rows that were changed, removed or "
                              "moved\n"));
  EXPECT_THAT(
      page,
      HasSubstr(".TP\n\\fB\\-\\-head\\fR \\fIVALUE\\fR\na head that 'audit head', a backup, an "
                "export or a certificate gave: is it still a part of the history?\n"));
  // A flag has no value; an argument without dashes that may be repeated ends in "...".
  EXPECT_THAT(page, HasSubstr(".TP\n\\fB\\-\\-verify\\fR\nalso read every repaired file again\n"));
  EXPECT_THAT(page, HasSubstr("\\fBpath\\fR ...\nrecordings (.gt3x) or folders of them\n"));
}

// Oracle: groff_man(7): a line that begins with a dot or an apostrophe is a request. Those that
// this program writes are .SS, .TP, .PP and .br; every hyphen of its own is \-.
TEST_F(Reference, NoWordOfACommandBecomesARequest) {
  std::istringstream lines(filled("man"));
  int sections = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('.')) {
      EXPECT_TRUE(line.starts_with(".SS sixpoint ") || line == ".TP" || line == ".PP" ||
                  line == ".br")
          << line;
      sections += line.starts_with(".SS ") ? 1 : 0;
    }
    EXPECT_FALSE(line.starts_with('\'')) << line;
    for (std::size_t at = line.find('-'); at != std::string::npos; at = line.find('-', at + 1)) {
      EXPECT_TRUE(at > 0 && line[at - 1] == '\\') << line;
    }
  }
  EXPECT_GT(sections, 40);
}

// Oracle: bash: one pattern of `case` for each command, which sets two lists of words. The help
// option has no place in the manual's sections, but is offered.
TEST_F(Reference, TheCompletionHasOneCaseForEachCommand) {
  const std::string text = filled("completion");
  EXPECT_THAT(text, HasSubstr("    'audit') commands='head verify' options='--help"));
  EXPECT_THAT(
      text,
      HasSubstr("    'archive') commands='plan run submit merge report status' options='--help"));
  EXPECT_THAT(text, HasSubstr("    'audit verify') commands='' options='"));
  EXPECT_THAT(text, Not(HasSubstr("--constants-out --constants "))) << "an old name is not offered";
  EXPECT_TRUE(text.starts_with("    '') commands='inspect scan repair ")) << text.substr(0, 80);
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    EXPECT_TRUE(line.starts_with("    '") && line.ends_with("' ;;")) << line;
    EXPECT_EQ(std::count(line.begin(), line.end(), '\''), 6) << line;
  }
}

TEST_F(Reference, TheManualDoesNotRepeatTheHelpOption) {
  EXPECT_THAT(filled("man"), Not(HasSubstr("\\fB\\-\\-help\\fR")));
}

// The same commands give the same text: the package must not change from build to build.
TEST_F(Reference, TheTextIsTheSameEveryTime) {
  EXPECT_EQ(filled("man"), filled("man"));
  EXPECT_EQ(filled("completion"), filled("completion"));
}

// Exit code 64 of a wrong command line (sysexits.h), and nothing on the output, which the build
// redirects into a file.
TEST_F(Reference, AWrongCommandLineWritesNothing) {
  const auto expect_usage = [](const Answer& answer) {
    EXPECT_EQ(answer.exit_code, 64);
    EXPECT_EQ(answer.out, "");
    EXPECT_THAT(answer.people, HasSubstr("usage: sixpoint_reference man|completion TEMPLATE"));
  };
  expect_usage(run(""));
  expect_usage(run("man"));
  expect_usage(run(fmt::format("man '{}'", folder_ / "nowhere")));
  expect_usage(fill("man", "no place for the commands\n"));
  expect_usage(fill("man", "%COMMANDS% in the middle of a line\n"));
  std::ofstream(folder_ / "template") << "%COMMANDS%\n";
  expect_usage(run(fmt::format("man '{0}' '{0}'", folder_ / "template")));
}

}  // namespace
}  // namespace sixpoint
