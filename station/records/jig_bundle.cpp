#include "station/records/jig_bundle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/text/json_text.h"
#include "device/jig.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::json;

constexpr const char* kDamaged = "'sixpoint audit verify' says whether the store was changed";
constexpr std::size_t kMostSamples = 2'000'000;  // five hours at 100 Hz

struct Samples {
  std::vector<double> device_time_s;
  std::vector<gt3x::Counts> counts;
  std::vector<double> temperature_c;
};

// One "time,x,y,z,temperature" line.
bool read_line(std::string_view line, Samples& samples) {
  std::array<double, 5> number{};
  for (std::size_t k = 0; k < number.size(); ++k) {
    const std::size_t comma = std::min(line.find(','), line.size());
    const auto [end, error] = std::from_chars(line.data(), line.data() + comma, number[k]);
    if (error != std::errc() || end != line.data() + comma || !std::isfinite(number[k])) {
      return false;
    }
    line.remove_prefix(std::min(comma + 1, line.size()));
  }
  gt3x::Counts counts{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (std::abs(number[axis + 1]) > std::numeric_limits<std::int16_t>::max() / 2.0) {
      return false;
    }
    counts[axis] = static_cast<std::int16_t>(number[axis + 1]);
  }
  samples.device_time_s.push_back(number[0] * 1e-6);
  samples.counts.push_back(counts);
  samples.temperature_c.push_back(number[4]);
  return true;
}

Result<Samples> read_samples(std::string_view csv) {
  Samples samples;
  std::size_t number = 0;
  while (!csv.empty()) {
    const std::size_t end = std::min(csv.find('\n'), csv.size());
    if (++number > 1 && end > 0 && !read_line(csv.substr(0, end), samples)) {
      return fail(ErrorCode::bad_data, "the capture holds a line that is no sample",
                  fmt::format("line {}", number), kDamaged);
    }
    if (samples.counts.size() > kMostSamples) {
      return fail(ErrorCode::bad_data, "the capture is longer than a jig run can be",
                  "samples.csv");
    }
    csv.remove_prefix(std::min(end + 1, csv.size()));
  }
  return samples;
}

// A reading and where its samples are.
struct Reading {
  std::string round;  // "faces", "reseat" or "half_turn"
  StoredReading stored;
  std::array<std::int64_t, 3> sum{};
  std::size_t first_sample = 0;
};

Status add_readings(const Json& list, const char* round, std::vector<Reading>& readings) {
  SIXPOINT_ASSIGN(const auto stored, stored_readings(list));
  for (const StoredReading& each : stored) {
    Reading reading{round, each, {}, 0};
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      reading.sum[axis] = std::llround(each.mean_lsb[axis] * static_cast<double>(each.samples));
    }
    readings.push_back(std::move(reading));
  }
  return {};
}

Result<std::vector<Reading>> readings_of(const Json& report) {
  std::vector<Reading> readings;
  SIXPOINT_CHECK(add_readings(report["poses"], "faces", readings));
  if (report.contains("verification") && report["verification"].is_object() &&
      report["verification"].contains("poses")) {
    SIXPOINT_CHECK(add_readings(report["verification"]["poses"], "reseat", readings));
  }
  if (report.contains("half_turn")) {
    SIXPOINT_CHECK(add_readings(report["half_turn"], "half_turn", readings));
  }
  return readings;
}

// Sets `first_sample` and sorts by it; answers with the number of readings that were found.
std::size_t find_readings(const Samples& samples, std::vector<Reading>& readings) {
  const std::size_t count = samples.counts.size();
  std::vector<std::array<std::int64_t, 3>> sums(count + 1);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      sums[i + 1][axis] = sums[i][axis] + samples.counts[i][axis];
    }
  }
  std::size_t found = 0;
  for (Reading& reading : readings) {
    const std::size_t length = reading.stored.samples;
    for (std::size_t i = 0; length > 0 && i + length <= count; ++i) {
      const auto& a = sums[i];
      const auto& b = sums[i + length];
      if (b[0] - a[0] == reading.sum[0] && b[1] - a[1] == reading.sum[1] &&
          b[2] - a[2] == reading.sum[2]) {
        reading.first_sample = i;
        ++found;
        break;
      }
    }
  }
  std::sort(readings.begin(), readings.end(),
            [](const Reading& a, const Reading& b) { return a.first_sample < b.first_sample; });
  return found;
}

// The middle of each axis, from its two faces; 0 where they are not there.
std::array<std::int16_t, 3> middle_of_axes(const std::vector<Reading>& readings) {
  std::array<std::int16_t, 3> middle{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    double sum = 0;
    int faces = 0;
    for (const Reading& reading : readings) {
      if (reading.round == "faces" && device::axis_of(reading.stored.pose) == axis) {
        sum += static_cast<double>(reading.sum[axis]) / static_cast<double>(reading.stored.samples);
        ++faces;
      }
    }
    middle[axis] = static_cast<std::int16_t>(faces == 2 ? std::lround(sum / 2) : 0);
  }
  return middle;
}

void add_segments(gap::Bundle& bundle, const Samples& samples,
                  const std::vector<Reading>& readings) {
  const std::array<std::int16_t, 3> middle = middle_of_axes(readings);
  gap::HeldSigns held_sign = gap::HeldSigns::Zero();
  for (const Reading& reading : readings) {
    const std::size_t first = reading.first_sample;
    gap::Segment segment;
    segment.name = reading.round;
    segment.first_sample = bundle.samples.size();
    segment.samples = reading.stored.samples;
    segment.host_start_s = samples.device_time_s[first] - samples.device_time_s.front();
    // A report of the protocol `production` does not hold how the unit lay: as in the others.
    segment.rotation = rotation_on_jig(reading.stored.pose, reading.stored.half_turned);
    segment.temperature_start_c = samples.temperature_c[first];
    segment.temperature_end_c = segment.temperature_start_c;
    segment.settled = true;
    segment.pose = static_cast<int>(reading.stored.pose) +
                   (reading.stored.half_turned ? static_cast<int>(device::kPoses.size()) : 0);
    segment.placement = static_cast<int>(bundle.segments.size());
    segment.approach_g = Eigen::Vector3d::Zero();
    if (!bundle.segments.empty()) {
      segment.approach_g = segment.rotation.col(2) - bundle.segments.back().rotation.col(2);
    }
    gap::hold_step(held_sign, segment.approach_g);
    segment.held_sign = held_sign;
    for (std::size_t i = first; i < first + reading.stored.samples; ++i) {
      gt3x::Counts counts = samples.counts[i];
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        counts[axis] = static_cast<std::int16_t>(counts[axis] - middle[axis]);
      }
      bundle.samples.push_back(counts);
    }
    bundle.segments.push_back(std::move(segment));
  }
}

// Within a block of samples the unit's own clock is exact to a microsecond. 0 where the times are
// not those of a sample clock.
double rate_of(const Samples& samples) {
  const auto& time_s = samples.device_time_s;
  const double rate_hz =
      time_s.size() > 1 && time_s[1] > time_s[0] ? std::round(1 / (time_s[1] - time_s[0])) : 100;
  return rate_hz >= 10 && rate_hz <= 400 && time_s.back() > time_s.front() ? rate_hz : 0;
}

Result<StoredRun> run_of(const db::Row& row) {
  if (row.size() != 6) {
    return fail(ErrorCode::internal, "the store answered with another table", "runs", kDamaged);
  }
  return StoredRun{db::text_of(row[0]), db::text_of(row[1]), db::text_of(row[2]),
                   db::text_of(row[3]), db::text_of(row[4]), db::text_of(row[5])};
}

constexpr const char* kColumns = "SELECT id, serial, kind, station, jig, document FROM runs";

}  // namespace

Result<std::vector<StoredRun>> stored_jig_runs(db::Store& store) {
  SIXPOINT_ASSIGN(const auto rows, store.database().query(fmt::format(
                                       "{} WHERE kind = 'jig' ORDER BY started_ns, id", kColumns)));
  std::vector<StoredRun> runs;
  for (const db::Row& row : rows) {
    SIXPOINT_ASSIGN(StoredRun run, run_of(row));
    runs.push_back(std::move(run));
  }
  return runs;
}

Result<StoredRun> stored_run(db::Store& store, const std::string& id) {
  SIXPOINT_ASSIGN(const std::string key, store.whole_key("runs", id));
  SIXPOINT_ASSIGN(const auto rows, store.database().query(fmt::format("{} WHERE id = $1", kColumns),
                                                          std::vector<db::Value>{key}));
  return run_of(rows.front());
}

Result<std::string> samples_of_run(db::Store& store, const std::string& id) {
  const std::array<db::Value, 1> parameters = {db::Value(id)};
  SIXPOINT_ASSIGN(
      const auto rows,
      store.database().query("SELECT attachments.bytes FROM captures JOIN attachments ON "
                             "attachments.sha256 = captures.sha256 WHERE captures.run_id = $1 AND "
                             "captures.name = 'samples.csv'",
                             parameters));
  const Bytes* bytes =
      rows.size() == 1 && rows[0].size() == 1 ? std::get_if<Bytes>(rows[0].data()) : nullptr;
  if (bytes == nullptr) {
    return fail(ErrorCode::no_input, "the run has no samples in the store", printable(id, 80),
                "runs of kind 'jig' have them");
  }
  return std::string(bytes->begin(), bytes->end());
}

Result<std::vector<StoredReading>> stored_readings(const Json& list) {
  std::vector<StoredReading> readings;
  for (const Json& item : list.is_array() ? list : Json::array()) {
    StoredReading reading;
    try {
      SIXPOINT_ASSIGN(reading.pose, device::parse_pose(item.at("pose").get<std::string>()));
      reading.mean_lsb = item.at("mean_lsb").get<PerAxis<double>>();
      reading.samples = item.at("samples").get<std::size_t>();
      reading.half_turned = item.value("turned_deg", 0) == 180;
    } catch (const Json::exception&) {
      reading.samples = kMostSamples + 1;
    }
    if (reading.samples > kMostSamples) {
      return fail(ErrorCode::bad_data, "the run's report holds an incomplete reading", "poses",
                  kDamaged);
    }
    readings.push_back(reading);
  }
  return readings;
}

Eigen::Matrix3d rotation_on_jig(device::Pose pose, bool half_turned) {
  const PerAxis<double> up = device::direction_of(pose);
  const Eigen::Vector3d direction(up[0], up[1], up[2]);
  Eigen::Matrix3d rotation =
      direction.z() < -0.5 ? Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()).toRotationMatrix()
                           : Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), direction)
                                 .toRotationMatrix();
  if (half_turned) {
    rotation.leftCols<2>() *= -1;
  }
  return rotation;
}

Result<gap::Bundle> bundle_of_run(const StoredRun& run, std::string_view samples_csv) {
  constexpr std::size_t kTemperatures = 2000;  // in the bundle, spread over the run
  const Json report = parse_json<Json>(run.document);
  if (!report.is_object() || !report.contains("poses")) {
    return fail(ErrorCode::bad_data, "the run's document is no jig report", run.id, kDamaged);
  }
  SIXPOINT_ASSIGN(std::vector<Reading> readings, readings_of(report));
  SIXPOINT_ASSIGN(const Samples samples, read_samples(samples_csv));
  const std::size_t found = find_readings(samples, readings);
  if (found < readings.size() || readings.size() < device::kPoses.size()) {
    return fail(
        ErrorCode::bad_data,
        fmt::format("{} of the report's {} readings are in the samples", found, readings.size()),
        run.id, "a jig run has six at least");
  }
  gap::Bundle bundle;
  bundle.path = "run " + run.id;
  bundle.protocol_serial = run.serial;
  bundle.header.serial = run.serial;
  if (report.contains("firmware") && report["firmware"].is_string()) {
    bundle.header.firmware = report["firmware"].get<std::string>();
  }
  bundle.rate_hz = rate_of(samples);
  if (bundle.rate_hz == 0) {
    return fail(ErrorCode::bad_data, "the capture's times are no sample clock's", run.id, kDamaged);
  }
  add_segments(bundle, samples, readings);
  const std::size_t count = samples.counts.size();
  for (std::size_t i = 0; i < count; i += std::max<std::size_t>(1, count / kTemperatures)) {
    bundle.temperature.host_time_s.push_back(samples.device_time_s[i] -
                                             samples.device_time_s.front());
    bundle.temperature.temperature_c.push_back(samples.temperature_c[i]);
  }
  bundle.losses.push_back(
      "a jig run holds raw counts and no host clock: the filter mismatch and the sample clock "
      "can't be judged, and truncation only by chance");
  return bundle;
}

}  // namespace sixpoint::station
