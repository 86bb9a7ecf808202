#include "gap/recording/logs.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

namespace sixpoint::gap {
namespace {

constexpr double kHighest_c = 200;  // a larger number is no temperature of a unit

using Row = std::pair<double, double>;

// The rows of two numbers under a header line that can be what the log says they are, by the first
// number. How many others there are is a loss of the bundle.
std::vector<Row> read_log(FileSystem& files, const std::string& path, const char* name,
                          bool (*possible)(const Bundle&, const Row&), Bundle& bundle) {
  std::vector<Row> rows;
  std::size_t left_out = 0;
  const auto bytes = read_file(files, path);
  if (!bytes) {
    return rows;
  }
  const char* at = reinterpret_cast<const char*>(bytes->data());
  const char* const end = at + bytes->size();
  for (bool header = true; at < end; header = false) {
    const char* line_end = std::find(at, end, '\n');
    double a = 0;
    double b = 0;
    const auto one = std::from_chars(at, line_end, a);
    const bool comma = one.ec == std::errc() && one.ptr < line_end && *one.ptr == ',';
    const auto two = comma ? std::from_chars(one.ptr + 1, line_end, b) : one;
    if (comma && two.ec == std::errc() && std::isfinite(a) && std::isfinite(b) &&
        possible(bundle, {a, b})) {
      rows.emplace_back(a, b);
    } else if (!header && line_end > at + 1) {
      ++left_out;
    }
    at = line_end == end ? end : line_end + 1;
  }
  if (left_out > 0) {
    bundle.losses.push_back(fmt::format(
        "{}: {} lines hold no reading of this recording and were left out", name, left_out));
  }
  std::stable_sort(rows.begin(), rows.end(),
                   [](const auto& x, const auto& y) { return x.first < y.first; });
  return rows;
}

bool can_be_temperature(const Bundle& /*bundle*/, const Row& row) {
  return std::abs(row.second) <= kHighest_c;
}

bool can_be_stamp(const Bundle& bundle, const Row& row) {
  return row.first >= 0 && row.first < static_cast<double>(bundle.samples.size()) &&
         row.first == std::floor(row.first);
}

// Stamps that are not of this recording's segments would make samples lost or repeated.
void drop_foreign_clock(Bundle& bundle) {
  std::size_t off = 0;
  std::size_t of_segments = 0;
  for (std::size_t i = 0; i < bundle.host_clock.sample_index.size(); ++i) {
    const std::size_t at = bundle.host_clock.sample_index[i];
    const auto segment = std::find_if(
        bundle.segments.begin(), bundle.segments.end(),
        [&](const Segment& s) { return at >= s.first_sample && at < s.first_sample + s.samples; });
    if (segment == bundle.segments.end()) {
      continue;
    }
    ++of_segments;
    const double into_s = static_cast<double>(at - segment->first_sample) / bundle.rate_hz;
    // A clock error of 0.5 %, and a hundredth of all samples lost or repeated.
    const double allowed_s = 0.5 + 0.02 * into_s;
    if (std::abs(bundle.host_clock.host_time_s[i] - segment->host_start_s - into_s) > allowed_s) {
      ++off;
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

}  // namespace

void read_temperature(FileSystem& files, const std::string& path, Bundle& bundle) {
  const std::vector<Row> rows =
      read_log(files, path, "temperature.csv", can_be_temperature, bundle);
  if (rows.size() < 2 || !(rows.back().first > rows.front().first)) {
    bundle.losses.emplace_back(
        "temperature.csv is missing or empty: the commanded temperatures are used instead, effects "
        "of temperature are told from effects of time less well");
    return;
  }
  // A running mean over +-15 s, as many rows before as behind: the log has 0.1 C of noise, the unit
  // follows in minutes. A log may pause while nothing is recorded, and may be sparse.
  constexpr double kReach_s = 15.5;  // of a row a second: 15 rows, whatever their times end in
  std::vector<double> sum(rows.size() + 1, 0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    sum[i + 1] = sum[i] + rows[i].second;
  }
  const auto apart_s = [&](std::size_t early, std::size_t late) {
    return rows[late].first - rows[early].first;
  };
  std::size_t first = 0;
  std::size_t last = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    while (apart_s(first, i) > kReach_s) {
      ++first;
    }
    while (last + 1 < rows.size() && apart_s(i, last + 1) <= kReach_s) {
      ++last;
    }
    const std::size_t half = std::min(i - first, last - i);
    bundle.temperature.host_time_s.push_back(rows[i].first);
    bundle.temperature.temperature_c.push_back((sum[i + half + 1] - sum[i - half]) /
                                               static_cast<double>(2 * half + 1));
  }
}

void read_host_clock(FileSystem& files, const std::string& path, Bundle& bundle) {
  const std::vector<Row> rows = read_log(files, path, "host_clock.csv", can_be_stamp, bundle);
  if (rows.size() < 2) {
    bundle.losses.emplace_back(
        "host_clock.csv is missing or empty: an error of the sample clock and lost or repeated "
        "samples show in shaker tones only");
    return;
  }
  for (const auto& [index, time] : rows) {
    bundle.host_clock.sample_index.push_back(static_cast<std::size_t>(index));
    bundle.host_clock.host_time_s.push_back(time);
  }
}

void check_logs(Bundle& bundle) {
  drop_foreign_clock(bundle);
  constexpr double kReach_s = 60;  // convention: the temperature follows in minutes
  constexpr double kFar_c = 20;    // the unit lags behind the chamber by less
  std::size_t unlogged = 0;
  std::size_t far = 0;
  std::size_t unstamped = 0;
  for (const Segment& segment : bundle.segments) {
    const double end_s =
        segment.host_start_s + static_cast<double>(segment.samples) / bundle.rate_hz;
    if (!bundle.temperature.empty()) {
      const bool covered =
          segment.host_start_s >= bundle.temperature.host_time_s.front() - kReach_s &&
          end_s <= bundle.temperature.host_time_s.back() + kReach_s;
      unlogged += covered ? 0 : 1;
      const double commanded_c = 0.5 * (segment.temperature_start_c + segment.temperature_end_c);
      const double logged_c = bundle.temperature_at(0.5 * (segment.host_start_s + end_s));
      far += std::abs(logged_c - commanded_c) > kFar_c ? 1 : 0;
    }
    const auto& stamps = bundle.host_clock.sample_index;
    const auto stamp = std::lower_bound(stamps.begin(), stamps.end(), segment.first_sample);
    unstamped += stamp == stamps.end() || *stamp >= segment.first_sample + segment.samples ? 1 : 0;
  }
  const std::size_t all = bundle.segments.size();
  if (unlogged > 0) {
    bundle.losses.push_back(fmt::format(
        "temperature.csv does not cover {} of {} segments: there its nearest reading and what was "
        "commanded are used, effects of temperature are told from effects of time less well",
        unlogged, all));
  }
  if (far > 0) {
    bundle.losses.push_back(
        fmt::format("temperature.csv is more than {:g} C from what was commanded in {} of {} "
                    "segments: one of the two is wrong, the log is used",
                    kFar_c, far, all));
  }
  if (!bundle.host_clock.empty() && unstamped > 0) {
    bundle.losses.push_back(fmt::format(
        "host_clock.csv has no stamp in {} of {} segments: an error of the sample clock "
        "and lost or repeated samples are searched for in the others",
        unstamped, all));
  }
}

}  // namespace sixpoint::gap
