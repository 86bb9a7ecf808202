#include "gap/bundle.h"

#include <Eigen/LU>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "gap/header_evidence.h"
#include "gt3x/recording.h"
#include "gt3x/sample_reader.h"

namespace sixpoint::gap {
namespace {

using Json = nlohmann::json;

constexpr double kOrthonormal =
    1e-3;  // protocols carry twelve digits; a tenth of a percent is a lie

tl::unexpected<Error> bad(const std::string& where, std::string what) {
  return fail(ErrorCode::bad_data, std::move(what), where,
              "compare the file with the description of bundles");
}

// Reads values out of one JSON object and keeps the first complaint.
class Fields {
 public:
  Fields(const Json& object, std::string where) : object_(object), where_(std::move(where)) {}

  double number(const char* key, double low, double high) {
    const auto found = object_.find(key);
    if (found == object_.end() || !found->is_number()) {
      complain(fmt::format("'{}' is missing or no number", key));
      return low;
    }
    return in_range(key, found->get<double>(), low, high);
  }
  std::string text(const char* key) {
    const auto found = object_.find(key);
    if (found == object_.end() || !found->is_string()) {
      complain(fmt::format("'{}' is missing or no text", key));
      return {};
    }
    return printable(found->get<std::string>(), 100);
  }
  std::size_t count(const char* key, std::size_t high) {
    return static_cast<std::size_t>(number_whole(key, static_cast<double>(high)));
  }
  Eigen::Vector3d vector(const char* key) {
    const auto found = object_.find(key);
    return found == object_.end()
               ? (complain(fmt::format("'{}' is missing", key)), Eigen::Vector3d::Zero())
               : vector_of(*found, key);
  }
  Eigen::Matrix3d rotation(const char* key) {
    const auto found = object_.find(key);
    if (found == object_.end() || !found->is_array() || found->size() != 3) {
      complain(fmt::format("'{}' is no 3x3 matrix", key));
      return Eigen::Matrix3d::Identity();
    }
    Eigen::Matrix3d matrix;
    for (Eigen::Index row = 0; row < 3; ++row) {
      matrix.row(row) = vector_of((*found)[static_cast<std::size_t>(row)], key).transpose();
    }
    if (!problem_ && matrix.determinant() < -0.5) {
      complain(fmt::format("'{}' mirrors: it is no rotation", key));
    }
    if (!problem_ &&
        (!((matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <
           kOrthonormal) ||
         !(matrix.determinant() > 0))) {
      complain(fmt::format("'{}' is no rotation (its rows are not orthonormal)", key));
    }
    return matrix;
  }
  // One number, or [start, end].
  std::pair<double, double> temperature(const char* key) {
    const auto found = object_.find(key);
    if (found != object_.end() && found->is_number()) {
      const double t = in_range(key, found->get<double>(), -100, 200);
      return {t, t};
    }
    if (found != object_.end() && found->is_array() && found->size() == 2 &&
        (*found)[0].is_number() && (*found)[1].is_number()) {
      return {in_range(key, (*found)[0].get<double>(), -100, 200),
              in_range(key, (*found)[1].get<double>(), -100, 200)};
    }
    complain(fmt::format("'{}' is neither a number nor [start, end]", key));
    return {};
  }
  const Json* object(const char* key) const {
    const auto found = object_.find(key);
    return found != object_.end() && found->is_object() ? &*found : nullptr;
  }
  void complain(std::string what) {
    if (!problem_) {
      problem_ = std::move(what);
    }
  }
  Status status() const {
    if (problem_) {
      return bad(where_, *problem_);
    }
    return {};
  }

 private:
  double number_whole(const char* key, double high) {
    const double value = number(key, 0, high);
    if (value != std::floor(value)) {
      complain(fmt::format("'{}' is no whole number", key));
    }
    return value;
  }
  double in_range(const char* key, double value, double low, double high) {
    if (!(value >= low && value <= high)) {
      complain(fmt::format("'{}' is {}, not between {} and {}", key, value, low, high));
      return low;
    }
    return value;
  }
  Eigen::Vector3d vector_of(const Json& json, const char* key) {
    Eigen::Vector3d vector = Eigen::Vector3d::Zero();
    if (!json.is_array() || json.size() != 3) {
      complain(fmt::format("'{}' does not hold three numbers", key));
      return vector;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      if (!json[i].is_number() || !std::isfinite(json[i].get<double>())) {
        complain(fmt::format("'{}' does not hold three numbers", key));
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

Result<Segment> read_segment(const Json& json, const std::string& where) {
  if (!json.is_object()) {
    return bad(where, "a segment is no object");
  }
  Fields fields(json, where);
  Segment segment;
  segment.name = fields.text("name");
  const std::string kind = fields.text("kind");
  segment.first_sample = fields.count("first_sample", std::size_t{1} << 40U);
  segment.samples = fields.count("samples", std::size_t{1} << 40U);
  segment.host_start_s = fields.number("host_start_s", -1e9, 1e9);
  segment.rotation = fields.rotation("rotation");
  std::tie(segment.temperature_start_c, segment.temperature_end_c) =
      fields.temperature("temperature_c");
  if (kind == "still") {
    segment.kind = Segment::Kind::still;
  } else if (kind == "vibration") {
    segment.kind = Segment::Kind::vibration;
  } else if (kind == "ramp") {
    segment.kind = Segment::Kind::ramp;
  } else if (kind == "soak") {
    segment.kind = Segment::Kind::soak;
  } else {
    fields.complain(fmt::format("unknown kind '{}'", kind));
  }
  if (segment.samples == 0) {
    fields.complain("a segment without samples");
  }
  SIXPOINT_CHECK(fields.status());
  if (segment.kind == Segment::Kind::vibration) {
    const Json* vibration = fields.object("vibration");
    if (vibration == nullptr) {
      return bad(where, "a segment of kind 'vibration' does not say which");
    }
    Fields inner(*vibration, where + ".vibration");
    Vibration v;
    v.direction_lab = inner.vector("direction_lab");
    v.frequency_hz = inner.number("frequency_hz", 1e-3, 1e4);
    v.amplitude_g = inner.number("amplitude_g", 0, 100);
    const double length = v.direction_lab.norm();
    if (!(std::abs(length - 1) < 0.01)) {
      inner.complain("'direction_lab' is not of unit length");
    }
    SIXPOINT_CHECK(inner.status());
    v.direction_lab /= length;
    segment.vibration = v;
  }
  return segment;
}

// Rows of two numbers under a header line; lines that hold none are counted.
struct TwoColumns {
  std::vector<std::pair<double, double>> rows;
  std::size_t skipped = 0;
};

TwoColumns parse_two_columns(const Bytes& bytes) {
  TwoColumns table;
  const char* at = reinterpret_cast<const char*>(bytes.data());
  const char* const end = at + bytes.size();
  bool first = true;
  while (at < end) {
    const char* line_end = std::find(at, end, '\n');
    double a = 0;
    double b = 0;
    const auto one = std::from_chars(at, line_end, a);
    const bool comma = one.ec == std::errc() && one.ptr < line_end && *one.ptr == ',';
    const auto two = comma ? std::from_chars(one.ptr + 1, line_end, b) : one;
    if (comma && two.ec == std::errc() && std::isfinite(a) && std::isfinite(b)) {
      table.rows.emplace_back(a, b);
    } else if (!first && line_end > at + 1) {
      ++table.skipped;
    }
    first = false;
    at = line_end == end ? end : line_end + 1;
  }
  return table;
}

void read_temperature(FileSystem& files, const std::string& folder, Bundle& bundle) {
  const auto bytes = read_file(files, folder + "/temperature.csv");
  TwoColumns table;
  if (bytes) {
    table = parse_two_columns(*bytes);
  }
  if (table.skipped > 0) {
    bundle.losses.push_back(fmt::format(
        "temperature.csv: {} lines hold no numbers and were passed over", table.skipped));
  }
  std::stable_sort(table.rows.begin(), table.rows.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::erase_if(table.rows, [](const auto& row) { return std::abs(row.second) > 200; });
  if (table.rows.size() < 2 || !(table.rows.back().first > table.rows.front().first)) {
    bundle.losses.emplace_back(
        "temperature.csv is missing or empty: the commanded temperatures stand in for the unit's, "
        "effects of "
        "temperature are told from effects of time less well");
    return;
  }
  // A running mean over +-15 rows: the log has 0.1 C of noise, the unit follows in minutes.
  constexpr std::ptrdiff_t kHalf = 15;
  const auto rows = static_cast<std::ptrdiff_t>(table.rows.size());
  std::vector<double> sum(table.rows.size() + 1, 0);
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    sum[i + 1] = sum[i] + table.rows[i].second;
  }
  for (std::ptrdiff_t i = 0; i < rows; ++i) {
    const std::ptrdiff_t half = std::min({kHalf, i, rows - 1 - i});
    bundle.temperature.host_time_s.push_back(table.rows[static_cast<std::size_t>(i)].first);
    bundle.temperature.temperature_c.push_back(
        (sum[static_cast<std::size_t>(i + half + 1)] - sum[static_cast<std::size_t>(i - half)]) /
        static_cast<double>(2 * half + 1));
  }
}

void read_host_clock(FileSystem& files, const std::string& folder, Bundle& bundle) {
  const auto bytes = read_file(files, folder + "/host_clock.csv");
  TwoColumns table;
  if (bytes) {
    table = parse_two_columns(*bytes);
  }
  std::erase_if(table.rows, [&](const auto& row) {
    return row.first < 0 || row.first >= static_cast<double>(bundle.samples.size()) ||
           row.first != std::floor(row.first);
  });
  std::stable_sort(table.rows.begin(), table.rows.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  if (table.rows.size() < 2) {
    bundle.losses.emplace_back(
        "host_clock.csv is missing or empty: an error of the sample clock and lost or repeated "
        "samples show in "
        "shaker tones only");
    return;
  }
  for (const auto& [index, time] : table.rows) {
    bundle.host_clock.sample_index.push_back(static_cast<std::size_t>(index));
    bundle.host_clock.host_time_s.push_back(time);
  }
}

Status read_recording(FileSystem& files, const std::string& path, const BundleLimits& limits,
                      Bundle& bundle, HeaderClaims& claims) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, path));
  bundle.header.serial = recording.info().serial();
  bundle.header.model = recording.info().device_type();
  bundle.header.firmware = recording.info().firmware();
  gt3x::SampleReader reader(recording);
  std::uint64_t damaged_s = 0;
  std::map<std::size_t, std::size_t> records_of;  // so many samples
  const auto claim_scale = [&claims](const char* source, std::optional<double> lsb_per_g) {
    const bool known = std::any_of(claims.scales.begin(), claims.scales.end(),
                                   [&](const auto& claim) { return claim.source == source; });
    if (lsb_per_g && std::isfinite(*lsb_per_g) && *lsb_per_g > 0 && !known) {
      claims.scales.push_back({source, *lsb_per_g});
    }
  };
  claim_scale("info.txt", recording.info().accel_scale_lsb_per_g());
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, reader.next());
    if (!item) {
      break;
    }
    if (item->kind == gt3x::SampleItem::Kind::recorded) {
      if (bundle.samples.size() + item->counts.size() > limits.max_samples) {
        return bad(path, fmt::format("more than {} samples", limits.max_samples));
      }
      bundle.samples.insert(bundle.samples.end(), item->counts.begin(), item->counts.end());
      ++records_of[item->counts.size()];
      if (item->parameters != nullptr) {
        bundle.header.calibration_time = item->parameters->calibration_time;
        claim_scale("PARAMETERS record", item->parameters->accel_scale_lsb_per_g);
      }
    } else if (item->gap == gt3x::GapKind::damaged) {
      damaged_s += item->seconds;
    }
  }
  if (damaged_s > 0) {
    return bad(path,
               fmt::format("{} seconds of the recording are damaged, so that the protocol's sample "
                           "numbers no longer hold",
                           damaged_s));
  }
  if (const auto rate = recording.info().sample_rate_hz(); rate && *rate > 0) {
    claims.rate_hz = *rate;
  }
  const auto most =
      std::max_element(records_of.begin(), records_of.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most != records_of.end() && most->first > 0) {
    claims.samples_per_record = static_cast<double>(most->first);
  }
  return {};
}

// A log that ends early or is of another day is read on as its last value: say so.
void weigh_logs(Bundle& bundle) {
  constexpr double kReach_s = 60;
  constexpr double kFar_c = 20;  // the unit lags behind the chamber by less
  std::size_t unlogged = 0;
  std::size_t far = 0;
  std::size_t unstamped = 0;
  for (const Segment& segment : bundle.segments) {
    const double end_s =
        segment.host_start_s + static_cast<double>(segment.samples) / bundle.rate_hz;
    if (!bundle.temperature.empty()) {
      unlogged += segment.host_start_s < bundle.temperature.host_time_s.front() - kReach_s ||
                          end_s > bundle.temperature.host_time_s.back() + kReach_s
                      ? 1
                      : 0;
      const double commanded = 0.5 * (segment.temperature_start_c + segment.temperature_end_c);
      far +=
          std::abs(bundle.temperature_at(0.5 * (segment.host_start_s + end_s)) - commanded) > kFar_c
              ? 1
              : 0;
    }
    const auto& stamps = bundle.host_clock.sample_index;
    const auto stamp = std::lower_bound(stamps.begin(), stamps.end(), segment.first_sample);
    unstamped += stamp == stamps.end() || *stamp >= segment.first_sample + segment.samples ? 1 : 0;
  }
  const std::size_t all = bundle.segments.size();
  if (unlogged > 0) {
    bundle.losses.push_back(
        fmt::format("temperature.csv does not cover {} of {} segments: its nearest reading stands "
                    "in, effects of temperature are told from effects of time less well",
                    unlogged, all));
  }
  if (far > 0) {
    bundle.losses.push_back(
        fmt::format("temperature.csv is more than {:g} C from what was commanded in {} of {} "
                    "segments: one of the two is wrong, the log is taken",
                    kFar_c, far, all));
  }
  if (!bundle.host_clock.empty() && unstamped > 0) {
    bundle.losses.push_back(fmt::format(
        "host_clock.csv has no stamp in {} of {} segments: an error of the sample clock "
        "and lost or repeated samples are looked for in the others",
        unstamped, all));
  }
}

// Stamps that are not of this recording's segments would make samples lost or repeated.
void drop_foreign_clock(Bundle& bundle) {
  std::size_t off = 0;
  std::size_t of_segments = 0;
  for (std::size_t i = 0; i < bundle.host_clock.sample_index.size(); ++i) {
    const std::size_t at = bundle.host_clock.sample_index[i];
    for (const Segment& segment : bundle.segments) {
      if (at >= segment.first_sample && at < segment.first_sample + segment.samples) {
        const double into_s = static_cast<double>(at - segment.first_sample) / bundle.rate_hz;
        // A clock error of 0.5 %, and a hundredth of all samples lost or repeated.
        off += std::abs(bundle.host_clock.host_time_s[i] - segment.host_start_s - into_s) >
                       0.5 + 0.02 * into_s
                   ? 1
                   : 0;
        ++of_segments;
        break;
      }
    }
  }
  if (2 * off > of_segments) {
    bundle.losses.push_back(fmt::format(
        "host_clock.csv contradicts the protocol's times ({} of {} stamps) and was left "
        "out: lost or repeated samples and the clock's error show in shaker tones only",
        off, of_segments));
    bundle.host_clock = {};
  }
}

void find_placements(Bundle& bundle) {
  constexpr double kNoPause_s = 0.05;
  constexpr double kClockReach = 0.012;
  constexpr double kTonePause_s = 5;  // three seconds, and what the host's clock adds
  Eigen::Vector3d pose_before = bundle.gravity_in_sensor(bundle.segments.front());
  int placement = -1;
  Eigen::Vector3d held = Eigen::Vector3d::Zero();
  std::vector<Eigen::Matrix3d> poses;
  for (std::size_t i = 0; i < bundle.segments.size(); ++i) {
    Segment& now = bundle.segments[i];
    if (i > 0) {
      const Segment& last = bundle.segments[i - 1];
      const double pause_s =
          now.host_start_s -
          (last.host_start_s + static_cast<double>(last.samples) / bundle.rate_hz);
      const bool same_pose = (now.rotation - last.rotation).cwiseAbs().maxCoeff() < 1e-6;
      const bool tones = now.kind == Segment::Kind::vibration && last.kind == now.kind &&
                         now.name == last.name && pause_s < kTonePause_s;
      // A sample clock that is off, or lost samples, make a pause where there was none.
      const double no_pause_s =
          kNoPause_s + kClockReach * static_cast<double>(last.samples) / bundle.rate_hz;
      now.starts_placement = !(same_pose && (std::abs(pause_s) < no_pause_s || tones));
    }
    const auto seen = std::find_if(poses.begin(), poses.end(), [&](const Eigen::Matrix3d& pose) {
      return (now.rotation - pose).cwiseAbs().maxCoeff() < 1e-6;
    });
    now.pose = static_cast<int>(seen - poses.begin());
    if (seen == poses.end()) {
      poses.push_back(now.rotation);
    }
    if (now.starts_placement) {
      ++placement;
      const Eigen::Vector3d pose = bundle.gravity_in_sensor(now);
      now.approach_g = pose - pose_before;
      for (Eigen::Index a = 0; a < 3; ++a) {
        held[a] =
            std::abs(now.approach_g[a]) > 0.05 ? std::copysign(1.0, now.approach_g[a]) : held[a];
      }
      pose_before = pose;
    } else {
      now.approach_g = bundle.segments[i - 1].approach_g;
    }
    now.placement = placement;
    now.held_sign = held;
  }
}

}  // namespace

double Bundle::temperature_at(double host_time_s) const {
  if (!temperature.empty()) {
    const auto& t = temperature.host_time_s;
    const auto after = std::lower_bound(t.begin(), t.end(), host_time_s);
    if (after == t.begin()) {
      return temperature.temperature_c.front();
    }
    if (after == t.end()) {
      return temperature.temperature_c.back();
    }
    const auto i = static_cast<std::size_t>(after - t.begin());
    const double step = t[i] - t[i - 1];
    const double share = step > 0 ? (host_time_s - t[i - 1]) / step : 0;
    return temperature.temperature_c[i - 1] * (1 - share) + temperature.temperature_c[i] * share;
  }
  const Segment* segment = &segments.front();
  for (const Segment& candidate : segments) {
    if (candidate.host_start_s <= host_time_s) {
      segment = &candidate;
    }
  }
  const double share = std::clamp(
      (host_time_s - segment->host_start_s) * rate_hz / static_cast<double>(segment->samples), 0.0,
      1.0);
  return segment->temperature_start_c * (1 - share) + segment->temperature_end_c * share;
}

Result<Bundle> read_bundle(FileSystem& files, const std::string& folder,
                           const BundleLimits& limits) {
  const std::string protocol_path = folder + "/protocol.json";
  SIXPOINT_ASSIGN(const Bytes text, read_file(files, protocol_path));
  const Json protocol = Json::parse(text, nullptr, false);
  if (protocol.is_discarded() || !protocol.is_object()) {
    return bad(protocol_path, "no JSON object");
  }
  Bundle bundle;
  bundle.path = folder;
  Fields fields(protocol, protocol_path);
  const std::string schema = fields.text("schema");
  if (schema != "sixpoint/bundle/1") {
    fields.complain(fmt::format("unknown schema '{}'", schema));
  }
  bundle.rate_hz = fields.number("sample_rate_hz", 1, 10'000);
  bundle.accel_scale_lsb_per_g = fields.number("accel_scale_lsb_per_g", 1, 100'000);
  bundle.gravity_g = fields.number("gravity_g", 0.99, 1.01);  // 0.9956 to 1.0028
  SIXPOINT_CHECK(fields.status());
  if (const Json* unit = fields.object("unit")) {
    if (const auto serial = unit->find("serial"); serial != unit->end() && serial->is_string()) {
      bundle.protocol_serial = printable(serial->get<std::string>(), 100);
    }
  }
  const auto segments = protocol.find("segments");
  if (segments == protocol.end() || !segments->is_array() || segments->empty()) {
    return bad(protocol_path, "'segments' is missing or empty");
  }
  if (segments->size() > limits.max_segments) {
    return bad(protocol_path, fmt::format("more than {} segments", limits.max_segments));
  }
  HeaderClaims claims;
  SIXPOINT_CHECK(read_recording(files, folder + "/recording.gt3x", limits, bundle, claims));
  std::size_t end = 0;
  for (std::size_t i = 0; i < segments->size(); ++i) {
    const std::string where = fmt::format("{}: segments[{}]", protocol_path, i);
    SIXPOINT_ASSIGN(Segment segment, read_segment((*segments)[i], where));
    if (segment.first_sample < end) {
      return bad(where, "it begins before the end of the segment before");
    }
    if (segment.first_sample > bundle.samples.size() ||
        segment.samples > bundle.samples.size() - segment.first_sample) {
      return bad(where, fmt::format("it reaches to sample {}, the recording holds {}",
                                    segment.first_sample + segment.samples, bundle.samples.size()));
    }
    if (!bundle.segments.empty() && segment.host_start_s < bundle.segments.back().host_start_s) {
      return bad(where, "it starts earlier than the segment before");
    }
    if (segment.vibration && segment.vibration->frequency_hz >= bundle.rate_hz / 2) {
      return bad(where, fmt::format("a tone of {} Hz can't be seen at {} Hz",
                                    segment.vibration->frequency_hz, bundle.rate_hz));
    }
    end = segment.first_sample + segment.samples;
    bundle.segments.push_back(std::move(segment));
  }
  if (!bundle.protocol_serial.empty() && !bundle.header.serial.empty() &&
      bundle.protocol_serial != bundle.header.serial) {
    bundle.losses.push_back(fmt::format(
        "the protocol is of unit {}, the recording's header names {}: headers are copied, but make "
        "sure that this is the right recording",
        bundle.protocol_serial, printable(bundle.header.serial, 100)));
  }
  read_temperature(files, folder, bundle);
  read_host_clock(files, folder, bundle);
  SIXPOINT_CHECK(weigh_header(claims, bundle));
  drop_foreign_clock(bundle);
  weigh_logs(bundle);
  find_placements(bundle);
  return bundle;
}

}  // namespace sixpoint::gap
