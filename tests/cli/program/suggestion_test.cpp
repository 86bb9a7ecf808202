#include "cli/program/suggestion.h"

#include <sstream>

#include <CLI/App.hpp>
#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "cli/program/program.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;

// The table in suggestion.h, a row each.
TEST(NearestWord, TheBeginningOfExactlyOne) {
  EXPECT_EQ(nearest_word("ins", {"scan", "inspect", "import"}), "inspect");
  EXPECT_EQ(nearest_word("i", {"scan", "inspect", "import"}), std::nullopt);
}

TEST(NearestWord, AThirdOfTheLettersAtMost) {
  EXPECT_EQ(nearest_word("scn", {"scan", "solve"}), "scan");
  EXPECT_EQ(nearest_word("inpsect", {"inspect", "impact"}), "inspect")
      << "two neighbours exchanged";
  EXPECT_EQ(nearest_word("repaier", {"repair", "report"}), "repair");
  EXPECT_EQ(nearest_word("jgi", {"jig", "gap"}), "jig");
  EXPECT_EQ(nearest_word("gaq", {"gap"}), "gap");
  EXPECT_EQ(nearest_word("gqq", {"gap"}), std::nullopt) << "two of three letters";
}

TEST(NearestWord, NothingWhereTwoAreAsNear) {
  EXPECT_EQ(nearest_word("--cut", {"--cup", "--cat"}), std::nullopt);
  EXPECT_EQ(nearest_word("--cut", {"--cup", "--cat", "--cot"}), std::nullopt);
  EXPECT_EQ(nearest_word("--cot", {"--cut", "--cat", "--cot-"}), "--cot-") << "its beginning";
  EXPECT_EQ(nearest_word("", {"--cup", "--cat"}), std::nullopt);
  EXPECT_EQ(nearest_word("x", {}), std::nullopt);
}

class UnknownWord : public testing::Test {
 protected:
  UnknownWord() { declare_commands(app, context); }
  std::string of(const std::vector<std::string>& arguments) {
    return unknown_word(app, arguments).value_or("nothing");
  }
  CLI::App app;
  MemoryEnv memory;
  std::ostringstream out;
  std::istringstream in;
  Context context{memory.env, out, out, in};
};

TEST_F(UnknownWord, NamesTheCommandAndTheOptionThatWereMeant) {
  EXPECT_EQ(of({"scn", "archive"}),
            "'sixpoint' has no command 'scn'; did you mean 'scan'? 'sixpoint --help' lists them");
  EXPECT_EQ(
      of({"store", "exprot"}),
      "'sixpoint store' has no command 'exprot'; did you mean 'export'? 'sixpoint store --help' "
      "lists them");
  EXPECT_EQ(of({"scan", "archive", "--jsn"}),
            "'sixpoint scan' has no option '--jsn'; did you mean '--json'? 'sixpoint scan --help' "
            "lists them");
  EXPECT_EQ(
      of({"scan", "--strore=x", "archive"}),
      "'sixpoint scan' has no option '--strore'; did you mean '--store'? 'sixpoint scan --help' "
      "lists them");
}

TEST_F(UnknownWord, SaysOnlyThatItIsUnknownWhereNothingIsNear) {
  EXPECT_EQ(of({"frobnicate"}),
            "'sixpoint' has no command 'frobnicate'; 'sixpoint --help' lists them");
  EXPECT_EQ(of({"-x"}), "'sixpoint' has no option '-x'; 'sixpoint --help' lists them");
  EXPECT_EQ(of({"repair", "a", "-x", "b"}),
            "'sixpoint repair' has no option '-x'; 'sixpoint repair --help' lists them");
  EXPECT_THAT(of({"scan", "--a\x1b[2Jb"}), HasSubstr("has no option '--a"));
  EXPECT_EQ(of({"scan", "--a\x1b[2Jb"}).find('\x1b'), std::string::npos);
}

TEST_F(UnknownWord, NothingWhereEveryWordIsKnown) {
  EXPECT_EQ(of({"scan", "archive", "--json", "--store", "x.db"}), "nothing");
  EXPECT_EQ(of({"store", "export"}), "nothing");
  EXPECT_EQ(of({"repair", "a", "-o", "b"}), "nothing");
  EXPECT_EQ(of({"repair", "a", "-oB"}), "nothing") << "an option with its value";
  EXPECT_EQ(of({"jig", "--latitude", "-12.5"}), "nothing") << "a number";
  EXPECT_EQ(of({"scan", "--", "--jsn"}), "nothing") << "behind -- there are no options";
  EXPECT_EQ(of({}), "nothing");
}

}  // namespace
}  // namespace sixpoint::cli
