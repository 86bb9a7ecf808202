#include "mocks/faults/fault_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/serial.h"
#include "base/text/json_keys.h"
#include "base/text/json_text.h"

namespace sixpoint::mocks {

namespace {

using Json = nlohmann::json;

template <class Value, std::size_t kCount>
using Names = std::array<std::pair<Value, std::string_view>, kCount>;

constexpr Names<FaultKind, 20> kNames = {{
    {FaultKind::stall, "stall"},
    {FaultKind::delay, "delay"},
    {FaultKind::short_packet, "short_packet"},
    {FaultKind::garbage, "garbage"},
    {FaultKind::bit_flip, "bit_flip"},
    {FaultKind::bad_crc, "bad_crc"},
    {FaultKind::duplicate, "duplicate"},
    {FaultKind::lost, "lost"},
    {FaultKind::wrong_sequence, "wrong_sequence"},
    {FaultKind::reset, "reset"},
    {FaultKind::reenumerate, "reenumerate"},
    {FaultKind::unplug, "unplug"},
    {FaultKind::swap, "swap"},
    {FaultKind::full_flash, "full_flash"},
    {FaultKind::battery_low, "battery_low"},
    {FaultKind::frozen_sensor, "frozen_sensor"},
    {FaultKind::axis_stuck, "axis_stuck"},
    {FaultKind::bad_page, "bad_page"},
    {FaultKind::clock_jump, "clock_jump"},
    {FaultKind::power_loss, "power_loss"},
}};

constexpr std::size_t kMostFaults = 1000;
constexpr std::uint64_t kMostCount = 1ULL << 40U;
constexpr double kLongest_s = 86'400;

tl::unexpected<Error> wrong(const std::string& path, std::string what) {
  return fail(ErrorCode::configuration, std::move(what),
              path.empty() ? "fault plan" : "fault plan: " + printable(path, 100),
              "docs/faults.md describes every key");
}

// One fault of the plan, with its path for messages.
class Reader {
 public:
  Reader(const Json& json, std::string path) : json_(json), path_(std::move(path)) {}

  const Json* find(const char* key) const {
    const auto found = json_.find(key);
    return found == json_.end() ? nullptr : &*found;
  }
  std::string path(const char* key) const { return fmt::format("{}/{}", path_, key); }

  template <class Value>
  Status whole(const char* key, Value& value, std::uint64_t low, std::uint64_t high) const {
    return read(key, value, &Json::is_number_unsigned, "a whole number", low, high);
  }
  Status number(const char* key, std::optional<double>& value, double low, double high) const {
    return read(key, value, &Json::is_number, "a number", low, high);
  }
  template <class Value, std::size_t kCount>
  Status choice(const char* key, Value& value, const Names<Value, kCount>& names) const {
    const Json* found = find(key);
    if (found == nullptr) {
      return {};
    }
    for (const auto& [known, name] : names) {
      if (found->is_string() && found->get_ref<const std::string&>() == name) {
        value = known;
        return {};
      }
    }
    std::string all;
    for (const auto& entry : names) {
      all += (all.empty() ? "" : ", ") + std::string(entry.second);
    }
    return wrong(path(key), "this must be one of: " + all);
  }

 private:
  template <class Number, class Value>
  Status read(const char* key, Value& value, bool (Json::*is_kind)() const noexcept,
              const char* kind, Number low, Number high) const {
    const Json* found = find(key);
    if (found == nullptr) {
      return {};
    }
    if (!(found->*is_kind)() || !(found->get<Number>() >= low && found->get<Number>() <= high)) {
      return wrong(path(key), fmt::format("this must be {} from {} to {}", kind, low, high));
    }
    value = static_cast<Value>(found->get<Number>());
    return {};
  }

  const Json& json_;
  std::string path_;
};

Status check_keys(const Json& json, const std::string& path) {
  constexpr std::array<std::string_view, 16> kKeys = {
      "fault", "at_report", "at_byte", "at_s", "channel",    "direction", "of",     "count",
      "every", "seconds",   "bytes",   "bit",  "battery_mv", "axis",      "serial", "byte"};
  for (const auto& [key, value] : json.items()) {
    if (std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end()) {
      return wrong(fmt::format("{}/{}", path, key), "this key is not known");
    }
  }
  return {};
}

Status read_time(const Reader& in, const std::string& path, FaultTime& at) {
  SIXPOINT_CHECK(in.whole("at_report", at.report, 1, kMostCount));
  SIXPOINT_CHECK(in.whole("at_byte", at.byte, 0, kMostCount));
  SIXPOINT_CHECK(in.number("at_s", at.time_s, 0, kLongest_s));
  const int times =
      int{at.report.has_value()} + int{at.byte.has_value()} + int{at.time_s.has_value()};
  return times == 1 ? Status{}
                    : wrong(path, "a fault needs exactly one of at_report, at_byte and at_s");
}

// Which transfers count.
Status read_place(const Reader& in, const std::string& path, Fault& fault) {
  constexpr Names<FaultChannel, 2> kChannels = {
      {{FaultChannel::reports, "reports"}, {FaultChannel::bulk, "bulk"}}};
  constexpr Names<FaultDirection, 2> kDirections = {
      {{FaultDirection::from_unit, "from_unit"}, {FaultDirection::to_unit, "to_unit"}}};
  constexpr Names<FaultSubject, 3> kSubjects = {{{FaultSubject::any, "any"},
                                                 {FaultSubject::replies, "replies"},
                                                 {FaultSubject::samples, "samples"}}};
  SIXPOINT_CHECK(in.choice("channel", fault.channel, kChannels));
  SIXPOINT_CHECK(in.choice("direction", fault.direction, kDirections));
  SIXPOINT_CHECK(in.choice("of", fault.subject, kSubjects));
  const bool to_unit = fault.direction == FaultDirection::to_unit;
  const bool some_subject = fault.subject != FaultSubject::any;
  if (fault.channel == FaultChannel::bulk && (to_unit || some_subject)) {
    return wrong(path, "on the bulk channel there are blocks from the unit only");
  }
  return to_unit && some_subject
             ? wrong(in.path("of"), "a transfer to the unit is neither a reply nor a sample")
             : Status{};
}

// What the kind of fault needs besides.
Status read_values(const Reader& in, Fault& fault) {
  SIXPOINT_CHECK(in.whole("count", fault.count, 0, kMostCount));
  SIXPOINT_CHECK(in.whole("every", fault.every, 1, kMostCount));
  SIXPOINT_CHECK(in.number("seconds", fault.seconds,
                           fault.kind == FaultKind::clock_jump ? -kLongest_s : 0, kLongest_s));
  SIXPOINT_CHECK(in.whole("bytes", fault.bytes, 0, 1U << 20U));
  SIXPOINT_CHECK(in.whole("bit", fault.bit, 0, 7));
  SIXPOINT_CHECK(in.whole("byte", fault.byte, 0, 1U << 20U));
  SIXPOINT_CHECK(in.whole("battery_mv", fault.battery_mv, 0, 65'535));
  constexpr Names<std::size_t, 3> kAxisNames = {{{0U, "x"}, {1U, "y"}, {2U, "z"}}};
  SIXPOINT_CHECK(in.choice("axis", fault.axis, kAxisNames));
  if (const Json* serial = in.find("serial")) {
    if (!serial->is_string() || !is_serial(serial->get_ref<const std::string&>())) {
      return wrong(in.path("serial"), "this must be a serial number of 1 to 16 letters and digits");
    }
    fault.serial = serial->get<std::string>();
  }
  return {};
}

Result<Fault> read_fault(const Json& json, const std::string& path) {
  if (!json.is_object()) {
    return wrong(path, "this must be an object");
  }
  SIXPOINT_CHECK(check_keys(json, path));
  const Reader in(json, path);
  if (in.find("fault") == nullptr) {
    return wrong(path, "a fault needs the key 'fault'");
  }
  Fault fault;
  SIXPOINT_CHECK(in.choice("fault", fault.kind, kNames));
  SIXPOINT_CHECK(read_time(in, path, fault.at));
  SIXPOINT_CHECK(read_place(in, path, fault));
  SIXPOINT_CHECK(read_values(in, fault));
  const bool needs_seconds = fault.kind == FaultKind::delay || fault.kind == FaultKind::clock_jump;
  if (needs_seconds && !fault.seconds) {
    return wrong(path, "this fault needs the key 'seconds'");
  }
  if (fault.every && fault.at.time_s) {
    return wrong(in.path("every"), "this goes with at_report and at_byte only");
  }
  if (fault.every && fault.count >= *fault.every) {
    return wrong(in.path("every"), "this must be more than 'count'");
  }
  if (!is_of_transfer(fault.kind) && fault.count != 1) {
    return wrong(in.path("count"), "this goes with faults of transfers only");
  }
  return fault;
}

}  // namespace

std::string_view to_string(FaultKind kind) {
  for (const auto& [known, name] : kNames) {
    if (known == kind) {
      return name;
    }
  }
  return "?";
}

bool is_of_transfer(FaultKind kind) { return kind <= FaultKind::wrong_sequence; }

Result<FaultPlan> parse_fault_plan(std::string_view text) {
  if (const auto doubled = doubled_json_key(text)) {
    return wrong(*doubled, "this key stands twice");
  }
  const Json json = parse_json<Json>(text);
  if (json.is_discarded()) {
    return wrong("", "this is not JSON: " + why_no_json(text));
  }
  if (!json.is_object()) {
    return wrong("", "this is no JSON object");
  }
  for (const auto& [key, value] : json.items()) {
    if (key != "schema" && key != "seed" && key != "faults" && key != "comment") {
      return wrong("/" + key, "this key is not known");
    }
  }
  const auto schema = json.find("schema");
  if (schema == json.end() || *schema != "sixpoint/faults/1") {
    return wrong("/schema", "this must be \"sixpoint/faults/1\"");
  }
  FaultPlan plan;
  SIXPOINT_CHECK(Reader(json, "").whole("seed", plan.seed, 0, UINT64_MAX));
  const auto faults = json.find("faults");
  if (faults == json.end() || !faults->is_array() || faults->size() > kMostFaults) {
    return wrong("/faults", fmt::format("this must be a list of at most {} faults", kMostFaults));
  }
  for (std::size_t i = 0; i < faults->size(); ++i) {
    SIXPOINT_ASSIGN(Fault fault, read_fault((*faults)[i], fmt::format("/faults/{}", i)));
    plan.faults.push_back(std::move(fault));
  }
  return plan;
}

Result<FaultPlan> read_fault_plan(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(const Bytes bytes, read_file(files, path, 1U << 20U));
  auto plan = parse_fault_plan(as_text(bytes));
  if (!plan) {
    Error error = std::move(plan).error();
    error.where = printable(path, 200) + ": " + error.where;
    return fail(std::move(error));
  }
  return plan;
}

}  // namespace sixpoint::mocks
