// Who may use the station's page: its token, one-time codes, sessions.
//
//   SignIn sign_in(env.clock, random_hex(16));
//   const std::string code = sign_in.first_code();                // printed once, for one browser
//   const auto session = sign_in.session_for(code);               // the browser's cookie
//   const bool permitted = sign_in.session_holds(*session);
//
// A program of the user who started the station sends the token, which a file has that this user
// alone may read. A browser gets a session, and never the token.
//
// What gives a session:
//
// | what is shown                                    | answer                              |
// |--------------------------------------------------|-------------------------------------|
// | the first code, not used yet                     | a session; the code is used up      |
// | a later code, not used yet, up to kCodeLife old  | a session; the code is used up      |
// | the token                                        | a session                           |
// | a code that was used, is too old, or was no code | none                                |
//
// Whether a session holds:
//
// | the session                                       | answer                            |
// |---------------------------------------------------|-----------------------------------|
// | made with this token, up to kSessionLife ago      | it holds, after a restart too     |
// | made longer ago, or over 10 minutes in the future | it does not                       |
// | made with another token                           | it does not: a new token ends all |
// | changed in any character                          | it does not                       |
//
// A session is its time, 128 random bits, and the keyed hash of both: the server keeps no list.
// Small letters and missing dashes of a code are forgiven. May be called from any thread.
#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "base/env.h"

namespace sixpoint::station {

inline constexpr std::chrono::minutes kCodeLife{10};
inline constexpr std::chrono::hours kSessionLife{24 * 30};
inline constexpr std::size_t kFewestTokenBytes = 16;

// The token in a file: the first line. Makes the file, for its owner alone, where there is none.
// bad_data for one that is too short, or has characters that a header cannot hold.
Result<std::string> read_or_make_token(FileSystem& files, const std::string& path);

// Whether the station may listen at this address, with or without TLS (usage where it may not).
//
// | address                         | --tls-cert and --tls-key | answer                           |
// |---------------------------------|--------------------------|----------------------------------|
// | 127.0.0.1, localhost, ::1       | both, or neither         | it may                           |
// | any other                       | both                     | it may                           |
// | any other                       | neither                  | no: others could read and change |
// | any                             | one of the two           | no: it needs both                |
Status may_listen(const std::string& address, bool has_certificate, bool has_key);
// An address of this machine that no other machine reaches.
bool is_loopback(std::string_view address);

class SignIn {
 public:
  SignIn(Clock& clock, std::string token);

  std::string first_code() const { return first_code_; }
  std::string new_code();
  std::optional<std::string> session_for(std::string_view shown);
  bool session_holds(std::string_view session) const;
  bool is_token(std::string_view shown) const;

 private:
  Clock& clock_;
  const std::string token_;
  const std::string first_code_;
  std::mutex mutex_;  // guards what follows
  bool first_code_is_used_ = false;
  std::map<std::string, std::chrono::nanoseconds> codes_;  // and when they were made
};

}  // namespace sixpoint::station
