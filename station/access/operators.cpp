#include "station/access/operators.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/text/json_text.h"
#include "station/access/secrets.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostNameBytes = 60;
constexpr std::uint64_t kMostFileBytes = 1U << 20U;

tl::unexpected<Error> wrong_pin() {
  return fail(ErrorCode::permission, "this name and this PIN do not belong together", {},
              "try again; an engineer sets a new PIN with 'sixpoint operator add'");
}

// Marks of direction and blanks without width: two names that differ by them look the same.
bool has_hidden_characters(std::string_view name) {
  for (std::size_t at = 0; at + 2 < name.size(); ++at) {
    const std::string_view three = name.substr(at, 3);
    if ((three >= "\u200b" && three <= "\u200f") || (three >= "\u2028" && three <= "\u202e") ||
        (three >= "\u2060" && three <= "\u206f") || three == "\ufeff") {
      return true;
    }
  }
  return false;
}

}  // namespace

std::string_view to_string(OperatorRole role) {
  return role == OperatorRole::engineer ? "engineer" : "technician";
}

Result<OperatorRole> parse_operator_role(std::string_view text) {
  for (const OperatorRole role : {OperatorRole::technician, OperatorRole::engineer}) {
    if (text == to_string(role)) {
      return role;
    }
  }
  return fail(ErrorCode::usage, fmt::format("'{}' is no role", printable(text, 40)), {},
              "say technician or engineer");
}

Result<std::vector<Operators::Entry>> Operators::read() const {
  std::vector<Entry> entries;
  if (const auto there = env_.files.info(path_);
      !there && there.error().code == ErrorCode::no_input) {
    return entries;
  }
  SIXPOINT_ASSIGN(const Bytes bytes, read_file(env_.files, path_, kMostFileBytes));
  try {
    const Json json = parse_json(as_text(bytes));
    for (const Json& item : json.at("operators")) {
      SIXPOINT_ASSIGN(const OperatorRole role,
                      parse_operator_role(item.at("role").get<std::string>()));
      entries.push_back({{item.at("name").get<std::string>(), role},
                         item.at("salt").get<std::string>(),
                         item.at("scrypt").get<std::string>()});
    }
  } catch (const Json::exception&) {
    // Not as if there were none: then everybody could work under any name.
    return fail(ErrorCode::bad_data, "the list of operators cannot be read", path_,
                "remove the file, and add the operators again");
  }
  return entries;
}

Status Operators::replace(const std::vector<Entry>& before,
                          const std::vector<Entry>& entries) const {
  const auto is_engineer = [](const Entry& entry) {
    return entry.is.role == OperatorRole::engineer;
  };
  if (std::ranges::any_of(before, is_engineer) && std::ranges::none_of(entries, is_engineer)) {
    return fail(ErrorCode::configuration, "this is the last engineer: nobody could sign any more",
                {}, "add another engineer first: 'sixpoint operator add NAME --role engineer'");
  }
  Json json;
  json["schema"] = "sixpoint/operators/1";
  json["operators"] = Json::array();
  for (const Entry& entry : entries) {
    json["operators"].push_back({{"name", entry.is.name},
                                 {"role", to_string(entry.is.role)},
                                 {"salt", entry.salt},
                                 {"scrypt", entry.pin_hash}});
  }
  SIXPOINT_CHECK(make_private_folders(env_.files, folder_of(path_)));
  return write_private_file(env_.files, path_,
                            json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

Result<std::vector<Operator>> Operators::list() const {
  SIXPOINT_ASSIGN(const auto entries, read());
  std::vector<Operator> operators;
  operators.reserve(entries.size());
  for (const Entry& entry : entries) {
    operators.push_back(entry.is);
  }
  return operators;
}

Result<OperatorRole> Operators::add(const std::string& name, std::optional<OperatorRole> role,
                                    const std::string& pin) {
  if (name.empty() || name.size() > kMostNameBytes || printable(name) != name ||
      name.front() == ' ' || name.back() == ' ' || has_hidden_characters(name)) {
    return fail(
        ErrorCode::usage,
        fmt::format("a name has 1 to {} bytes that can be printed and seen, no blank at its "
                    "beginning or end",
                    kMostNameBytes),
        printable(name, 80), "give the name as it shall stand in the records");
  }
  if (pin.size() < 4 || pin.size() > 12 ||
      pin.find_first_not_of("0123456789") != std::string::npos) {
    return fail(ErrorCode::usage, "a PIN is 4 to 12 digits", {}, "choose another one");
  }
  SIXPOINT_ASSIGN(const auto before, read());
  std::vector<Entry> entries;
  OperatorRole has = OperatorRole::technician;
  for (const Entry& entry : before) {
    if (entry.is.name == name) {
      has = entry.is.role;
    } else {
      entries.push_back(entry);
    }
  }
  has = role.value_or(has);
  const std::string salt = random_hex(16);
  entries.push_back({{name, has}, salt, pin_hash(pin, salt)});
  SIXPOINT_CHECK(replace(before, entries));
  return has;
}

Status Operators::disable(const std::string& name) {
  SIXPOINT_ASSIGN(const auto before, read());
  auto entries = before;
  if (std::erase_if(entries, [&](const Entry& entry) { return entry.is.name == name; }) == 0) {
    return fail(ErrorCode::no_input, "there is no operator of this name", printable(name, 80),
                "'sixpoint operator list' names them");
  }
  if (entries.empty()) {
    return fail(
        ErrorCode::configuration,
        "this is the last operator: without one, everybody may work and sign under any name",
        printable(name, 80),
        fmt::format("add another one first; to work without operators remove {}", path_));
  }
  return replace(before, entries);
}

Result<Operator> Operators::sign_in(const std::string& where, const std::string& name,
                                    const std::string& pin) {
  SIXPOINT_ASSIGN(const auto entries, read());
  const auto found = std::ranges::find(
      entries, name, [](const Entry& entry) -> const std::string& { return entry.is.name; });
  const bool known = found != entries.end();
  {
    const std::lock_guard lock(mutex_);
    const auto now = env_.clock.elapsed();
    for (auto& [whose, times] : wrong_pins_) {
      std::erase_if(times, [&](const auto& when) { return now - when > kPinWait; });
    }
    std::erase_if(wrong_pins_, [](const auto& each) { return each.second.empty(); });
    const auto wrong = wrong_pins_.find(name);
    if ((!known && wrong_pins_.size() >= kMostNamesTried) ||
        (wrong != wrong_pins_.end() && wrong->second.size() >= kMostWrongPins)) {
      return fail(ErrorCode::permission, "too many wrong PINs", printable(name, 80),
                  "wait a minute, then try again");
    }
    // Counted before it is compared: many at once are no more tries than one after the other.
    wrong_pins_[name].push_back(now);
  }
  const bool right = same_secret(pin_hash(pin, known ? found->salt : std::string("no operator")),
                                 known ? found->pin_hash : std::string());
  if (!known || !right) {
    return wrong_pin();
  }
  const std::lock_guard lock(mutex_);
  wrong_pins_.erase(name);
  forget_idle();
  places_[where] = {found->is, env_.clock.elapsed()};
  return found->is;
}

void Operators::sign_out(const std::string& where) {
  const std::lock_guard lock(mutex_);
  places_.erase(where);
}

void Operators::forget_idle() {
  const auto now = env_.clock.elapsed();
  std::erase_if(places_, [&](const auto& place) { return now - place.second.used > kIdle; });
}

// Who was removed from the list, or has another role now, signs in anew.
bool Operators::is_listed(const std::vector<Entry>& entries, const Operator& who) {
  return std::ranges::any_of(entries, [&](const Entry& entry) {
    return entry.is.name == who.name && entry.is.role == who.role;
  });
}

std::optional<Operator> Operators::at(const std::string& where) {
  const auto entries = read();
  const std::lock_guard lock(mutex_);
  forget_idle();
  const auto place = places_.find(where);
  return entries && place != places_.end() && is_listed(*entries, place->second.who)
             ? std::optional(place->second.who)
             : std::nullopt;
}

Result<SignedName> Operators::who(const std::string& where, const std::string& typed,
                                  OperatorRole needed) {
  SIXPOINT_ASSIGN(const auto entries, read());
  if (entries.empty()) {
    if (printable(typed, typed.size()) != typed) {
      return fail(ErrorCode::bad_data, "a name has no control characters", printable(typed, 80),
                  "type it on one line");
    }
    return SignedName{typed, false};
  }
  const std::lock_guard lock(mutex_);
  forget_idle();
  const auto place = places_.find(where);
  if (place == places_.end() || !is_listed(entries, place->second.who)) {
    return fail(ErrorCode::permission, "no operator is signed in here", {},
                "sign in with your PIN");
  }
  if (needed == OperatorRole::engineer && place->second.who.role != OperatorRole::engineer) {
    return fail(ErrorCode::permission, "an engineer signs for this",
                printable(place->second.who.name, 80), "an engineer signs in with a PIN");
  }
  place->second.used = env_.clock.elapsed();
  return SignedName{place->second.who.name, true};
}

}  // namespace sixpoint::station
