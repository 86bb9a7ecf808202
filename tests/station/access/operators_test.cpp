// One test for each row of the tables in the header.
#include "station/access/operators.h"

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "open_files_limit.h"
#include "station/access/secrets.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;
using testing::Not;

class OperatorsTest : public testing::Test {
 protected:
  std::string file() {
    const auto bytes = read_file(memory_.files, kFile);
    return bytes ? std::string(bytes->begin(), bytes->end()) : std::string();
  }
  void add_both() {
    EXPECT_OK(operators_.add("Ada", OperatorRole::technician, "471100"));
    EXPECT_OK(operators_.add("Eve", OperatorRole::engineer, "0815"));
  }

  static constexpr const char* kFile = "data/operators.json";
  MemoryEnv memory_;
  Operators operators_{memory_.env, kFile};
};

TEST_F(OperatorsTest, WithoutAnyTheNameIsAsTypedAndNotAuthenticated) {
  for (const OperatorRole role : {OperatorRole::technician, OperatorRole::engineer}) {
    const auto who = operators_.who("a", "Ada", role);
    ASSERT_OK(who);
    EXPECT_EQ(who->name, "Ada");
    EXPECT_FALSE(who->is_authenticated);
  }
}

TEST_F(OperatorsTest, WithSomeNobodyWorksUnderATypedName) {
  add_both();
  EXPECT_FAILS(operators_.who("a", "Ada", OperatorRole::technician), ErrorCode::permission);
  EXPECT_FAILS(operators_.who("a", "Eve", OperatorRole::engineer), ErrorCode::permission);
}

// A list that cannot be read now is not a list of nobody.
TEST(OperatorsOnADisk, AreNotForgottenWhereTheirFileCannotBeOpened) {
  const sixpoint::tests::TemporaryFolder folder;
  Operators operators(posix_env(), folder / "operators.json");
  ASSERT_OK(operators.add("Ada", OperatorRole::technician, "471100"));
  {
    const sixpoint::tests::OpenFilesLimit limit(0);
    EXPECT_FAILS(operators.who("a", "Mallory", OperatorRole::technician), ErrorCode::io);
    EXPECT_FAILS(operators.list(), ErrorCode::io);
  }
  EXPECT_EQ(operators.list()->size(), 1U);
  ASSERT_OK(posix_env().files.remove(folder / "operators.json"));
  ASSERT_OK(posix_env().files.make_folders(folder / "operators.json"));
  EXPECT_FAILS(operators.who("a", "Mallory", OperatorRole::technician), ErrorCode::no_input);
}

TEST_F(OperatorsTest, ATechnicianMeasuresAndDoesNotSign) {
  add_both();
  EXPECT_OK(operators_.sign_in("a", "Ada", "471100"));
  const auto who = operators_.who("a", "Eve", OperatorRole::technician);
  ASSERT_OK(who);
  EXPECT_EQ(who->name, "Ada") << "not what was typed";
  EXPECT_TRUE(who->is_authenticated);
  EXPECT_FAILS(operators_.who("a", "Eve", OperatorRole::engineer), ErrorCode::permission);
  EXPECT_FAILS(operators_.who("b", "Ada", OperatorRole::technician), ErrorCode::permission);
}

TEST_F(OperatorsTest, AnEngineerMeasuresAndSigns) {
  add_both();
  EXPECT_OK(operators_.sign_in("a", "Eve", "0815"));
  EXPECT_EQ(operators_.who("a", "", OperatorRole::technician)->name, "Eve");
  EXPECT_EQ(operators_.who("a", "", OperatorRole::engineer)->name, "Eve");
}

TEST_F(OperatorsTest, WhoIsIdleSignsInAgain) {
  add_both();
  EXPECT_OK(operators_.sign_in("a", "Ada", "471100"));
  for (int i = 0; i < 3; ++i) {
    memory_.clock.sleep(kIdle - std::chrono::seconds(1));
    EXPECT_OK(operators_.who("a", "", OperatorRole::technician)) << "each use counts anew";
  }
  memory_.clock.sleep(kIdle + std::chrono::seconds(1));
  EXPECT_FALSE(operators_.at("a"));
  EXPECT_FAILS(operators_.who("a", "", OperatorRole::technician), ErrorCode::permission);
  EXPECT_OK(operators_.sign_in("a", "Ada", "471100"));
  operators_.sign_out("a");
  EXPECT_FAILS(operators_.who("a", "", OperatorRole::technician), ErrorCode::permission);
}

TEST_F(OperatorsTest, WhoWasRemovedIsSignedOut) {
  add_both();
  EXPECT_OK(operators_.sign_in("a", "Ada", "471100"));
  EXPECT_OK(operators_.disable("Ada"));
  EXPECT_FAILS(operators_.who("a", "", OperatorRole::technician), ErrorCode::permission);
  EXPECT_FAILS(operators_.disable("Ada"), ErrorCode::no_input);
}

TEST_F(OperatorsTest, ATypedNameHasOneLine) {
  EXPECT_EQ(operators_.who("a", "Zo\u00eb", OperatorRole::technician)->name, "Zo\u00eb");
  for (const char* name : {"Ada\nEve", "Ada\x1b[2J"}) {
    EXPECT_FAILS(operators_.who("a", name, OperatorRole::technician), ErrorCode::bad_data);
  }
}

// Without one the machine would ask nobody for a PIN, Ada included.
TEST_F(OperatorsTest, TheLastOneStays) {
  add_both();
  EXPECT_OK(operators_.disable("Ada"));
  const auto refused = operators_.disable("Eve");
  EXPECT_FAILS(refused, ErrorCode::configuration);
  EXPECT_THAT(refused.error().hint, testing::HasSubstr(kFile));
  EXPECT_EQ(operators_.list()->size(), 1U);
}

TEST_F(OperatorsTest, ANewPinKeepsTheRoleAndTheLastEngineerStays) {
  add_both();
  EXPECT_EQ(operators_.add("Eve", std::nullopt, "1357").value(), OperatorRole::engineer);
  EXPECT_EQ(operators_.add("Bo", std::nullopt, "1357").value(), OperatorRole::technician);
  EXPECT_FAILS(operators_.add("Eve", OperatorRole::technician, "2468"), ErrorCode::configuration);
  EXPECT_FAILS(operators_.disable("Eve"), ErrorCode::configuration);
  EXPECT_EQ(operators_.sign_in("a", "Eve", "1357")->role, OperatorRole::engineer);
  EXPECT_OK(operators_.add("Bo", OperatorRole::engineer, "1357"));
  EXPECT_OK(operators_.disable("Eve"));
}

TEST_F(OperatorsTest, AListThatCannotBeReadLetsNobodyWork) {
  EXPECT_OK(memory_.files.make_folders("data"));
  for (const char* text : {"", "{", "[]", R"({"operators": [{"name": "Ada"}]})",
                           R"({"operators": [{"name": 7, "role": "engineer"}]})"}) {
    EXPECT_OK(write_file(memory_.files, kFile, text));
    EXPECT_FALSE(operators_.who("a", "Ada", OperatorRole::technician)) << text;
    EXPECT_FALSE(operators_.sign_in("a", "Ada", "471100")) << text;
    EXPECT_OK(memory_.files.remove(kFile));
  }
}

TEST_F(OperatorsTest, AWrongPinAndAnUnknownNameAreAnsweredAlike) {
  add_both();
  const auto wrong = operators_.sign_in("a", "Ada", "471101");
  const auto unknown = operators_.sign_in("a", "Mallory", "471100");
  EXPECT_FAILS(wrong, ErrorCode::permission);
  EXPECT_FAILS(unknown, ErrorCode::permission);
  EXPECT_EQ(wrong.error().brief(), unknown.error().brief());
  EXPECT_FALSE(operators_.at("a"));
}

TEST_F(OperatorsTest, PinsAreNotTriedOut) {
  add_both();
  for (std::size_t i = 0; i < kMostWrongPins; ++i) {
    EXPECT_FAILS(operators_.sign_in("a", "Ada", "1234"), ErrorCode::permission);
  }
  EXPECT_FAILS(operators_.sign_in("b", "Ada", "471100"), ErrorCode::permission);
  EXPECT_OK(operators_.sign_in("b", "Eve", "0815")) << "others are not held up";
  memory_.clock.sleep(kPinWait + std::chrono::seconds(1));
  EXPECT_OK(operators_.sign_in("b", "Ada", "471100"));
}

TEST_F(OperatorsTest, MadeUpNamesHoldUpNoOperator) {
  add_both();
  for (std::size_t i = 0; i < kMostNamesTried; ++i) {
    EXPECT_FAILS(operators_.sign_in("a", "nobody " + std::to_string(i), "1234"),
                 ErrorCode::permission);
  }
  EXPECT_THAT(operators_.sign_in("a", "nobody", "1234").error().what, HasSubstr("too many"));
  EXPECT_OK(operators_.sign_in("b", "Ada", "471100"));
}

TEST_F(OperatorsTest, TheFileHoldsNoPin) {
  add_both();
  EXPECT_THAT(file(), Not(HasSubstr("471100")));
  EXPECT_THAT(file(), Not(HasSubstr("0815")));
  EXPECT_OK(operators_.add("Bo", OperatorRole::technician, "471100"));
  const auto before = file();
  EXPECT_OK(operators_.add("Ada", OperatorRole::engineer, "471100")) << "a new role and PIN";
  EXPECT_NE(file(), before) << "another salt";
  EXPECT_EQ(operators_.list()->size(), 3U);
  EXPECT_EQ(operators_.sign_in("a", "Ada", "471100")->role, OperatorRole::engineer);
}

TEST_F(OperatorsTest, NamesThatLookAlikeAreNotTaken) {
  add_both();
  for (const char* name : {" Ada", "Ada ", "Ada\u200b", "\u202eadA", "A\u2060da", "\ufeffAda"}) {
    EXPECT_FAILS(operators_.add(name, OperatorRole::technician, "471100"), ErrorCode::usage);
  }
  for (const char* name : {"Ada L", "Łukasz", "Zoë", "\u5f20", "a\u2019b"}) {
    EXPECT_OK(operators_.add(name, OperatorRole::technician, "471100"));
  }
}

TEST_F(OperatorsTest, WhoIsNotListedAnyMoreIsNotSignedIn) {
  add_both();
  ASSERT_OK(operators_.sign_in("a", "Ada", "471100"));
  EXPECT_EQ(operators_.at("a")->name, "Ada");
  ASSERT_OK(operators_.disable("Ada"));
  EXPECT_FALSE(operators_.at("a").has_value());
}

TEST_F(OperatorsTest, WrongNamesAndPinsAreRefused) {
  for (const std::string& name : {std::string(), std::string("  "), std::string(61, 'A'),
                                  std::string("A\nda"), std::string("A\x1b[2J")}) {
    EXPECT_FAILS(operators_.add(name, OperatorRole::engineer, "4711"), ErrorCode::usage);
  }
  for (const char* pin : {"", "123", "1234567890123", "12a4", "12 4"}) {
    EXPECT_FAILS(operators_.add("Ada", OperatorRole::engineer, pin), ErrorCode::usage);
  }
  EXPECT_FAILS(parse_operator_role("boss"), ErrorCode::usage);
  EXPECT_TRUE(operators_.list()->empty());
}

// Oracle: Python's hashlib.
TEST(PinHash, IsScrypt) {
  // hashlib.scrypt(b"4711", salt=b"salt", n=2**15, r=8, p=1, maxmem=2**26, dklen=32).hex()
  EXPECT_EQ(pin_hash("4711", "salt"),
            "0c65344f616e0bd3ff7ebfce9a69ac94197b0cf796a608be81117f5afd362706");
  EXPECT_NE(pin_hash("4711", "salt"), pin_hash("4711", "tals"));
}

}  // namespace
}  // namespace sixpoint::station
