// The operators of this machine, their PINs, and who is signed in where.
//
//   Operators operators(env, "data/operators.json");
//   SIXPOINT_CHECK(operators.add("Ada", OperatorRole::technician, "4711"));
//   SIXPOINT_ASSIGN(const Operator ada, operators.sign_in("a browser", "Ada", "4711"));
//   SIXPOINT_ASSIGN(const SignedName by, operators.who("a browser", "", OperatorRole::technician));
//
// The file is its owner's alone and holds no PIN: salt and scrypt (RFC 7914) of each. Who works on
// a page (`where`: its session) is kept in memory: after a restart of the station they sign in
// again.
//
// Whose name stands in a record (who):
//
// | operators in the file | signed in there, used within kIdle | asked for  | answer               |
// |-----------------------|------------------------------------|------------|----------------------|
// | none                  | -                                  | either     | the name as typed,   |
// |                       |                                    |            | not authenticated    |
// | some                  | no one, or idle for longer         | either     | permission error     |
// | some                  | one who is not in the file now, or | either     | permission error     |
// |                       | has another role there             |            |                      |
// | some                  | a technician                       | technician | that operator's name |
// | some                  | a technician                       | engineer   | permission error     |
// | some                  | an engineer                        | either     | that operator's name |
// | cannot be read        | any                                | either     | the file's error     |
//
// Whether a PIN is taken (sign_in):
//
// | operator  | PIN   | wrong ones for this name within kPinWait | answer                        |
// |-----------|-------|------------------------------------------|-------------------------------|
// | known     | right | fewer than kMostWrongPins                | the operator                  |
// | known     | wrong | fewer                                    | permission error              |
// | not known | any   | fewer                                    | the same, after the same work |
// | any       | any   | kMostWrongPins or more                   | permission error: wait        |
// | not known | any   | fewer, and kMostNamesTried names have    | permission error: wait        |
// |           |       | wrong ones                               |                               |
//
// May be called from any thread.
#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"

namespace sixpoint::station {

inline constexpr std::chrono::minutes kIdle{10};
inline constexpr std::chrono::seconds kPinWait{60};
inline constexpr std::size_t kMostWrongPins = 5;
inline constexpr std::size_t kMostNamesTried = 64;  // so that made-up ones take no memory

enum class OperatorRole { technician, engineer };  // an engineer also signs for the station
std::string_view to_string(OperatorRole role);
Result<OperatorRole> parse_operator_role(std::string_view text);

struct Operator {
  std::string name;
  OperatorRole role = OperatorRole::technician;
};

// A name for a record.
struct SignedName {
  std::string name;
  bool is_authenticated = false;  // by a PIN
};

class Operators {
 public:
  Operators(Env& env, std::string path) : env_(env), path_(std::move(path)) {}

  Result<std::vector<Operator>> list() const;  // empty where there is no file
  // A new operator, or a new PIN, and role where one is given, for this name; who is new without a
  // role is a technician. usage where the name is empty, over 60 bytes or looks like another one
  // (blanks at its ends, characters that are not seen), or the PIN is not 4 to 12 digits;
  // configuration where no engineer would be left. The role that the operator has then.
  Result<OperatorRole> add(const std::string& name, std::optional<OperatorRole> role,
                           const std::string& pin);
  // no_input where there is none; configuration for the last one, since a machine without operators
  // takes names as they are typed, and for the last engineer.
  Status disable(const std::string& name);

  // `where`: a browser's session, or any other name of a place.
  Result<Operator> sign_in(const std::string& where, const std::string& name,
                           const std::string& pin);
  void sign_out(const std::string& where);
  Result<SignedName> who(const std::string& where, const std::string& typed, OperatorRole needed);
  // Signed in there, not idle, and still in the file; does not count as use.
  std::optional<Operator> at(const std::string& where);

 private:
  struct Entry {
    Operator is;
    std::string salt;
    std::string pin_hash;
  };
  struct Place {
    Operator who;
    std::chrono::nanoseconds used{0};
  };
  static bool is_listed(const std::vector<Entry>& entries, const Operator& who);
  Result<std::vector<Entry>> read() const;
  // configuration where there was an engineer in `before`, and none is left.
  Status replace(const std::vector<Entry>& before, const std::vector<Entry>& entries) const;
  void forget_idle();  // with mutex_ held

  Env& env_;
  const std::string path_;
  std::mutex mutex_;  // guards what follows
  std::map<std::string, Place> places_;
  std::map<std::string, std::vector<std::chrono::nanoseconds>> wrong_pins_;  // by name
};

}  // namespace sixpoint::station
