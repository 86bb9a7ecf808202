#include <array>
#include <cmath>

#include "base/sha256.h"
#include "gt3x/forms/model.h"
#include "station/lanes/lane.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

template <class T>
Json name_or_null(const std::optional<T>& value) {
  return value ? Json(to_string(*value)) : Json(nullptr);
}

double rounded(double value, double steps_per_unit) {
  return std::round(value * steps_per_unit) / steps_per_unit;
}

}  // namespace

std::string_view to_string(LaneState state) {
  static constexpr std::array<std::string_view, 8> kNames = {
      "absent", "idle", "resuming", "running", "unit_away", "wrong_unit", "capturing", "done"};
  return kNames.at(static_cast<std::size_t>(state));
}

std::string public_name(const std::string& client) {
  return client.empty() ? std::string() : text_sha256("sixpoint client " + client).substr(0, 16);
}

LaneTrace Lanes::Lane::trace(std::uint64_t first) const {
  const std::lock_guard lock(mutex_);
  LaneTrace trace;
  const std::uint64_t oldest = readings_taken_ - readings_.size();
  trace.first = std::clamp(first, oldest, readings_taken_);
  trace.force_mg.assign(readings_.begin() + static_cast<std::ptrdiff_t>(trace.first - oldest),
                        readings_.end());
  trace.host_ms = newest_ms_;
  return trace;
}

Json Lanes::Lane::live() const {
  const std::lock_guard lock(mutex_);
  Json json;
  json["stillness"] = station::to_string(live_.stillness);
  json["dwell"] = rounded(live_.dwell_fraction, 100);
  json["face"] = live_.face ? Json(device::to_string(live_.face->pose)) : Json(nullptr);
  json["angle_deg"] = live_.face ? Json(rounded(live_.face->angle_deg, 10)) : Json(nullptr);
  return json;
}

Json Lanes::Lane::run_json() const {
  const JigProgress& progress = run_->progress;
  JigRunOptions options = shared_.options.session.run;
  options.write = write_;
  Json json;
  json["phase"] = station::to_string(progress.phase);
  json["wanted"] = name_or_null(run_->wanted);
  json["prompt"] = run_->prompt;
  json["open"] = Json::array();
  for (const Pose pose : run_->open) {
    json["open"].push_back(device::to_string(pose));
  }
  json["taken"] = Json::array();
  const std::array<std::pair<const char*, const std::vector<PoseReading>*>, 4> rounds = {
      {{"faces", &progress.faces},
       {"faces_reversed", &progress.reversed},
       {"reseat", &progress.reseat},
       {"recheck", &progress.recheck}}};
  for (const auto& [round, readings] : rounds) {
    for (const PoseReading& reading : *readings) {
      json["taken"].push_back({{"round", round},
                               {"pose", device::to_string(reading.pose)},
                               {"tilt_deg", rounded(reading.tilt_deg, 10)}});
    }
  }
  json["of"] = placements_of(options);
  json["refusals"] = progress.refusals;
  json["last_refusal"] = run_->last_refusal;
  json["waiting_since_ms"] = waiting_since_ms_;
  json["started_ms"] = unix_ms(run_->started);
  return json;
}

Json Lanes::Lane::to_json() const {
  const std::lock_guard lock(mutex_);
  Json json;
  json["lane"] = number_;
  json["device"] = printable(device_);
  json["state"] = station::to_string(state_);
  json["message"] = message_;
  json["turns_by_itself"] = turns_by_itself_;
  json["jig_fault"] = jig_fault_.empty() ? Json(nullptr) : Json(printable(jig_fault_, 120));
  json["unit"] = nullptr;
  if (state_ != LaneState::absent && !identity_.serial.empty()) {
    json["unit"] = {{"serial", identity_.serial},
                    {"firmware", identity_.firmware},
                    {"model", gt3x::model_of(identity_.serial)},
                    {"battery_mv", identity_.battery_mv}};
  }
  json["scan"] = nullptr;
  if (!scanned_.empty()) {
    json["scan"] = {{"serial", printable(scanned_, 40)},
                    {"matches", state_ != LaneState::absent && scanned_ == identity_.serial}};
  }
  json["operator"] = printable(operator_name_, 100);
  json["client"] = public_name(client_);
  json["write"] = write_;
  json["run"] = run_ ? run_json() : Json(nullptr);
  json["capture"] = nullptr;
  if (capture_) {
    json["capture"] = {{"side", name_or_null(capture_->side)},
                       {"number", capture_->number},
                       {"of", device::kPoses.size()},
                       {"placed", capture_->placed},
                       {"until_ms", capture_->until_ms},
                       {"side_s", shared_.options.capture.side_s},
                       {"again", Json::array()}};
    for (const Pose side : capture_->again) {
      json["capture"]["again"].push_back(device::to_string(side));
    }
  }
  json["result"] = result_;
  if (!unwritten_serial_.empty() && result_.is_object() && result_["serial"] == unwritten_serial_) {
    json["result"]["can_write"] = true;
  }
  json["log"] = Json::array();
  for (const LogLine& line : log_) {
    json["log"].push_back(
        {{"id", line.id}, {"kind", line.kind}, {"text", line.text}, {"at_ms", line.at_ms}});
  }
  return json;
}

}  // namespace sixpoint::station
