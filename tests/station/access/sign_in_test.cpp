// One test for each row of the tables in the header.
#include "station/access/sign_in.h"

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "open_files_limit.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

constexpr const char* kTestToken = "0123456789abcdef";

class SignInTest : public testing::Test {
 protected:
  MemoryEnv env_;
  SignIn sign_in_{env_.clock, kTestToken};
};

TEST_F(SignInTest, TheFirstCodeIsGoodOnceAndWaits) {
  env_.clock.sleep(std::chrono::hours(9));
  const std::string code = sign_in_.first_code();
  const auto session = sign_in_.session_for(code);
  ASSERT_TRUE(session);
  EXPECT_TRUE(sign_in_.session_holds(*session));
  EXPECT_FALSE(sign_in_.session_for(code)) << "a second browser";
  EXPECT_NE(SignIn(env_.clock, kTestToken).first_code(), code) << "each program has its own";
}

TEST_F(SignInTest, ALaterCodeIsGoodOnceForTenMinutes) {
  const std::string used = sign_in_.new_code();
  EXPECT_TRUE(sign_in_.session_for(used));
  EXPECT_FALSE(sign_in_.session_for(used));
  const std::string in_time = sign_in_.new_code();
  env_.clock.sleep(kCodeLife);
  const std::string late = sign_in_.new_code();
  EXPECT_TRUE(sign_in_.session_for(in_time));
  env_.clock.sleep(kCodeLife + std::chrono::seconds(1));
  EXPECT_FALSE(sign_in_.session_for(late));
}

TEST_F(SignInTest, ACodeIsReadAsPeopleTypeIt) {
  std::string typed;
  for (const char c : sign_in_.new_code()) {
    typed += c == '-' ? ' ' : static_cast<char>(std::tolower(c));
  }
  EXPECT_TRUE(sign_in_.session_for(typed)) << typed;
}

TEST_F(SignInTest, WhatIsNoCodeGivesNothing) {
  for (const std::string& shown :
       {std::string(), std::string("-"), std::string("AAAA-AAAA-AAAA"), std::string(1'000'000, 'A'),
        std::string(kTestToken).substr(1)}) {
    EXPECT_FALSE(sign_in_.session_for(shown)) << shown.substr(0, 40);
  }
}

TEST_F(SignInTest, TheTokenGivesSessionsAndIsInNone) {
  const auto session = sign_in_.session_for(kTestToken);
  ASSERT_TRUE(session);
  EXPECT_TRUE(sign_in_.session_holds(*session));
  EXPECT_THAT(*session, testing::Not(testing::HasSubstr(kTestToken)));
  EXPECT_NE(sign_in_.session_for(kTestToken), session) << "each is random";
  EXPECT_FALSE(sign_in_.session_holds(kTestToken)) << "the token is no session";
}

TEST_F(SignInTest, ManyCodesPushOutTheOldest) {
  const std::string oldest = sign_in_.new_code();
  env_.clock.sleep(std::chrono::seconds(1));
  std::string newest;
  for (int i = 0; i < 16; ++i) {
    newest = sign_in_.new_code();
  }
  EXPECT_FALSE(sign_in_.session_for(oldest));
  EXPECT_TRUE(sign_in_.session_for(newest));
}

TEST_F(SignInTest, ASessionHoldsAMonthAndOverRestarts) {
  const auto session = sign_in_.session_for(kTestToken);
  const SignIn restarted(env_.clock, kTestToken);
  EXPECT_TRUE(restarted.session_holds(*session));
  env_.clock.sleep(kSessionLife);
  EXPECT_TRUE(restarted.session_holds(*session));
  env_.clock.sleep(std::chrono::seconds(2));
  EXPECT_FALSE(restarted.session_holds(*session));
}

TEST_F(SignInTest, ANewTokenEndsAllSessions) {
  const auto session = sign_in_.session_for(kTestToken);
  EXPECT_FALSE(SignIn(env_.clock, "fedcba9876543210").session_holds(*session));
}

TEST_F(SignInTest, ASessionThatWasChangedAnywhereDoesNotHold) {
  const auto session = sign_in_.session_for(kTestToken);
  for (std::size_t i = 0; i < session->size(); ++i) {
    std::string changed = *session;
    changed[i] = changed[i] == '1' ? '2' : '1';
    EXPECT_FALSE(sign_in_.session_holds(changed)) << i;
  }
  for (const std::string& other : {std::string(), std::string("."), std::string(".."),
                                   *session + "0", session->substr(1), "9" + *session}) {
    EXPECT_FALSE(sign_in_.session_holds(other)) << other;
  }
}

TEST_F(SignInTest, ASessionOfTheFutureDoesNotHold) {
  MemoryEnv later;
  later.clock.sleep(std::chrono::hours(1));
  const auto session = SignIn(later.clock, kTestToken).session_for(kTestToken);
  EXPECT_FALSE(sign_in_.session_holds(*session));
  EXPECT_TRUE(SignIn(later.clock, kTestToken).session_holds(*session));
}

TEST(MayListen, FollowsTheTable) {
  for (const char* here : {"127.0.0.1", "localhost", "::1"}) {
    EXPECT_OK(may_listen(here, false, false));
    EXPECT_OK(may_listen(here, true, true));
    EXPECT_FAILS(may_listen(here, true, false), ErrorCode::usage);
  }
  for (const char* elsewhere :
       {"0.0.0.0", "::", "192.168.1.7", "bench.example", "127.0.0.1.evil"}) {
    EXPECT_OK(may_listen(elsewhere, true, true));
    EXPECT_FAILS(may_listen(elsewhere, false, false), ErrorCode::usage);
    EXPECT_FAILS(may_listen(elsewhere, false, true), ErrorCode::usage);
  }
}

TEST(TokenFile, IsMadeOnceAndReadAgain) {
  MemoryEnv env;
  const auto made = read_or_make_token(env.files, "state/token");
  ASSERT_OK(made);
  EXPECT_EQ(made->size(), 32U);
  EXPECT_EQ(*read_or_make_token(env.files, "state/token"), *made);
}

TEST(TokenFile, IsNotReplacedWhereItCannotBeOpened) {
  const sixpoint::tests::TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  const auto made = read_or_make_token(files, folder / "token");
  ASSERT_OK(made);
  {
    const sixpoint::tests::OpenFilesLimit limit(0);
    EXPECT_FAILS(read_or_make_token(files, folder / "token"), ErrorCode::io);
  }
  EXPECT_EQ(*read_or_make_token(files, folder / "token"), *made);
}

TEST(TokenFile, WhatIsNoTokenIsRefused) {
  MemoryEnv env;
  for (const std::string& text :
       {std::string(), std::string("short\n"), std::string(300, 'a'),
        std::string("0123456789 abcdef"), std::string("0123456789abcde\"")}) {
    EXPECT_OK(write_file(env.files, "token", text));
    EXPECT_FAILS(read_or_make_token(env.files, "token"), ErrorCode::bad_data);
    EXPECT_OK(env.files.remove("token"));
  }
  EXPECT_OK(write_file(env.files, "token", "0123456789abcdef\r\nmore"));
  EXPECT_EQ(*read_or_make_token(env.files, "token"), "0123456789abcdef");
}

}  // namespace
}  // namespace sixpoint::station
