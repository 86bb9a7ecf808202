#include "gap/recording/protocol.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/text/json_text.h"

namespace sixpoint::gap {
namespace {

using Json = nlohmann::json;

// Convention: protocols carry twelve digits, so that a rotation off by a tenth of a percent is
// wrong.
constexpr double kOrthonormal = 1e-3;
constexpr double kUnitLength = 0.01;  // convention, for the shaker's direction
constexpr double kSamePose = 1e-6;    // largest difference of two matrices of one pose

tl::unexpected<Error> bad(const std::string& where, std::string what) {
  return fail(ErrorCode::bad_data, std::move(what), where,
              "compare the file with the description of bundles");
}

// Reads values out of one JSON object and keeps the first problem.
class Fields {
 public:
  Fields(const Json& object, std::string where) : object_(object), where_(std::move(where)) {}

  double number(const char* key, double low, double high) {
    const Json& value = at(key);
    if (!value.is_number()) {
      reject(fmt::format("'{}' is missing or no number", key));
      return low;
    }
    return in_range(key, value.get<double>(), low, high);
  }
  std::string text(const char* key) {
    const Json& value = at(key);
    if (!value.is_string()) {
      reject(fmt::format("'{}' is missing or no text", key));
      return {};
    }
    return printable(value.get<std::string>(), 100);
  }
  std::size_t count(const char* key) {
    constexpr double kMost = 1LL << 40;
    const double value = number(key, 0, kMost);
    if (value != std::floor(value)) {
      reject(fmt::format("'{}' is no whole number", key));
    }
    return static_cast<std::size_t>(value);
  }
  Eigen::Vector3d vector(const char* key) { return vector_of(at(key), key); }
  Eigen::Matrix3d rotation(const char* key) {
    const Json& rows = at(key);
    if (!rows.is_array() || rows.size() != 3) {
      reject(fmt::format("'{}' is no 3x3 matrix", key));
      return Eigen::Matrix3d::Identity();
    }
    Eigen::Matrix3d matrix;
    for (Eigen::Index row = 0; row < 3; ++row) {
      matrix.row(row) = vector_of(rows[static_cast<std::size_t>(row)], key).transpose();
    }
    if (matrix.determinant() < -0.5) {
      reject(fmt::format("'{}' mirrors: it is no rotation", key));
    }
    const Eigen::Matrix3d off = matrix * matrix.transpose() - Eigen::Matrix3d::Identity();
    if (!(off.cwiseAbs().maxCoeff() < kOrthonormal && matrix.determinant() > 0)) {
      reject(fmt::format("'{}' is no rotation (its rows are not orthonormal)", key));
    }
    return matrix;
  }
  // One number, or [start, end].
  std::array<double, 2> temperature(const char* key) {
    constexpr double kLow_c = -100;
    constexpr double kHigh_c = 200;
    const Json& value = at(key);
    const bool pair =
        value.is_array() && value.size() == 2 && value[0].is_number() && value[1].is_number();
    if (!value.is_number() && !pair) {
      reject(fmt::format("'{}' is neither a number nor [start, end]", key));
      return {};
    }
    const Json& start = pair ? value[0] : value;
    const Json& end = pair ? value[1] : value;
    return {in_range(key, start.get<double>(), kLow_c, kHigh_c),
            in_range(key, end.get<double>(), kLow_c, kHigh_c)};
  }
  void reject(std::string what) {
    if (!problem_) {
      problem_ = std::move(what);
    }
  }
  Status status() const { return problem_ ? Status(bad(where_, *problem_)) : Status(); }

 private:
  const Json& at(const char* key) const {
    static const Json kNone;
    const auto found = object_.find(key);
    return found == object_.end() ? kNone : *found;
  }
  double in_range(const char* key, double value, double low, double high) {
    if (!(value >= low && value <= high)) {
      reject(fmt::format("'{}' is {}, not between {} and {}", key, value, low, high));
      return low;
    }
    return value;
  }
  Eigen::Vector3d vector_of(const Json& json, const char* key) {
    Eigen::Vector3d vector = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < 3; ++i) {
      if (!json.is_array() || json.size() != 3 || !json[i].is_number() ||
          !std::isfinite(json[i].get<double>())) {
        reject(fmt::format("'{}' does not hold three numbers", key));
        return Eigen::Vector3d::Zero();
      }
      vector[static_cast<Eigen::Index>(i)] = json[i].get<double>();
    }
    return vector;
  }

  const Json& object_;
  std::string where_;
  std::optional<std::string> problem_;
};

Result<Vibration> read_vibration(const Json& segment, const std::string& where) {
  const auto json = segment.find("vibration");
  if (json == segment.end() || !json->is_object()) {
    return bad(where, "a segment of kind 'vibration' does not say which");
  }
  Fields fields(*json, where + ".vibration");
  Vibration vibration;
  vibration.direction_lab = fields.vector("direction_lab");
  vibration.frequency_hz = fields.number("frequency_hz", 1e-3, 1e4);
  vibration.amplitude_g = fields.number("amplitude_g", 0, 100);
  const double length = vibration.direction_lab.norm();
  if (!(std::abs(length - 1) < kUnitLength)) {
    fields.reject("'direction_lab' is not of unit length");
  }
  SIXPOINT_CHECK(fields.status());
  vibration.direction_lab /= length;
  return vibration;
}

Result<Segment> read_segment(const Json& json, const std::string& where) {
  if (!json.is_object()) {
    return bad(where, "a segment is no object");
  }
  Fields fields(json, where);
  Segment segment;
  segment.name = fields.text("name");
  const std::string kind = fields.text("kind");
  segment.first_sample = fields.count("first_sample");
  segment.samples = fields.count("samples");
  segment.host_start_s = fields.number("host_start_s", -1e9, 1e9);
  segment.rotation = fields.rotation("rotation");
  const auto [start_c, end_c] = fields.temperature("temperature_c");
  segment.temperature_start_c = start_c;
  segment.temperature_end_c = end_c;
  constexpr std::array kKinds = {"still", "vibration", "ramp", "soak"};  // as Segment::Kind
  const auto* const known = std::find(kKinds.begin(), kKinds.end(), kind);
  if (known == kKinds.end()) {
    fields.reject(fmt::format("unknown kind '{}'", kind));
  }
  segment.kind = static_cast<Segment::Kind>(known - kKinds.begin());
  if (segment.samples == 0) {
    fields.reject("a segment without samples");
  }
  SIXPOINT_CHECK(fields.status());
  if (segment.kind == Segment::Kind::vibration) {
    SIXPOINT_ASSIGN(segment.vibration, read_vibration(json, where));
  }
  return segment;
}

// The segments follow each other, in samples and in time.
Status check_segment(const Bundle& bundle, const Segment& segment, const std::string& where) {
  if (!bundle.segments.empty()) {
    const Segment& last = bundle.segments.back();
    if (segment.first_sample < last.first_sample + last.samples) {
      return bad(where, "it begins before the end of the segment before");
    }
    if (segment.host_start_s < last.host_start_s) {
      return bad(where, "it starts earlier than the segment before");
    }
  }
  return {};
}

// A simulation of the run has a temperature for each of its seconds. A scenario may be as long.
Status check_span(const Bundle& bundle, const std::string& path) {
  constexpr double kMostDays = 400;
  const double begin_s = bundle.segments.front().host_start_s;
  double end_s = begin_s;
  for (const Segment& segment : bundle.segments) {
    end_s = std::max(end_s,
                     segment.host_start_s + static_cast<double>(segment.samples) / bundle.rate_hz);
  }
  if (end_s - begin_s > kMostDays * 86'400) {
    return bad(path, fmt::format("from the first segment to the end of the last there are more "
                                 "than {} days: diagnose parts of it",
                                 kMostDays));
  }
  return {};
}

// Whether the unit stayed where it was between two segments.
bool stays(const Segment& last, const Segment& now, double rate_hz) {
  constexpr double kNoPause_s = 0.05;    // convention: rounding of the protocol's times
  constexpr double kClockReach = 0.012;  // a clock off by 5000 ppm and lost samples
  constexpr double kTonePause_s = 5;     // three seconds, and what the host's clock adds
  const double last_s = static_cast<double>(last.samples) / rate_hz;
  const double pause_s = now.host_start_s - (last.host_start_s + last_s);
  const bool same_pose = (now.rotation - last.rotation).cwiseAbs().maxCoeff() < kSamePose;
  const bool tones = now.kind == Segment::Kind::vibration && last.kind == now.kind &&
                     now.name == last.name && pause_s < kTonePause_s;
  return same_pose && (std::abs(pause_s) < kNoPause_s + kClockReach * last_s || tones);
}

void number_placements(Bundle& bundle) {
  Eigen::Vector3d gravity_before = bundle.gravity_in_sensor(bundle.segments.front());
  HeldSigns held_sign = HeldSigns::Zero();
  std::vector<Eigen::Matrix3d> poses;
  int placement = -1;
  for (std::size_t i = 0; i < bundle.segments.size(); ++i) {
    Segment& now = bundle.segments[i];
    now.starts_placement = i == 0 || !stays(bundle.segments[i - 1], now, bundle.rate_hz);
    const auto pose = std::find_if(poses.begin(), poses.end(), [&](const Eigen::Matrix3d& known) {
      return (now.rotation - known).cwiseAbs().maxCoeff() < kSamePose;
    });
    now.pose = static_cast<int>(pose - poses.begin());
    if (pose == poses.end()) {
      poses.push_back(now.rotation);
    }
    if (now.starts_placement) {
      ++placement;
      const Eigen::Vector3d gravity = bundle.gravity_in_sensor(now);
      now.approach_g = gravity - gravity_before;
      hold_step(held_sign, now.approach_g);
      gravity_before = gravity;
    } else {
      now.approach_g = bundle.segments[i - 1].approach_g;
    }
    now.placement = placement;
    now.held_sign = held_sign;
  }
}

}  // namespace

Status read_protocol(FileSystem& files, const std::string& path, Bundle& bundle) {
  SIXPOINT_ASSIGN(const Bytes text, read_file(files, path));
  const Json protocol = parse_json<Json>(as_text(text));
  if (protocol.is_discarded() || !protocol.is_object()) {
    return bad(path, "no JSON object");
  }
  Fields fields(protocol, path);
  const std::string schema = fields.text("schema");
  if (schema != "sixpoint/bundle/1") {
    fields.reject(fmt::format("unknown schema '{}'", schema));
  }
  bundle.rate_hz = fields.number("sample_rate_hz", 1, 10'000);
  bundle.accel_scale_lsb_per_g = fields.number("accel_scale_lsb_per_g", 1, 100'000);
  bundle.gravity_g = fields.number("gravity_g", 0.99, 1.01);  // on Earth 0.9956 to 1.0028
  SIXPOINT_CHECK(fields.status());
  if (const auto unit = protocol.find("unit"); unit != protocol.end() && unit->is_object()) {
    if (const Json serial = unit->value("serial", Json()); serial.is_string()) {
      bundle.protocol_serial = printable(serial.get<std::string>(), 100);
    }
  }
  const auto segments = protocol.find("segments");
  if (segments == protocol.end() || !segments->is_array() || segments->empty()) {
    return bad(path, "'segments' is missing or empty");
  }
  // Nine times the engineering protocol's. The work of a diagnosis grows with the cube: of so many at
  // rest it is half a minute, of 300 vibrations, each with more features, more than a minute.
  constexpr std::size_t kMostSegments = 1'000;
  if (segments->size() > kMostSegments) {
    return bad(path, fmt::format("more than {} segments: diagnose parts of it", kMostSegments));
  }
  for (std::size_t i = 0; i < segments->size(); ++i) {
    const std::string where = fmt::format("{}: segments[{}]", path, i);
    SIXPOINT_ASSIGN(Segment segment, read_segment((*segments)[i], where));
    SIXPOINT_CHECK(check_segment(bundle, segment, where));
    bundle.segments.push_back(std::move(segment));
  }
  SIXPOINT_CHECK(check_span(bundle, path));
  // A shaker runs through its tones whatever the unit's sample rate is.
  if (const auto folded = std::count_if(
          bundle.segments.begin(), bundle.segments.end(),
          [&](const Segment& segment) {
            return segment.vibration && segment.vibration->frequency_hz >= bundle.rate_hz / 2;
          });
      folded > 0) {
    bundle.losses.push_back(
        fmt::format("{} tones of half of the sample rate and more say nothing", folded));
  }
  number_placements(bundle);
  return {};
}

}  // namespace sixpoint::gap
