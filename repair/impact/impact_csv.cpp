#include <iterator>
#include <map>

#include <fmt/format.h>

#include "base/time.h"
#include "repair/impact/impact.h"

namespace sixpoint::repair {
namespace {

constexpr const char* kColumns = ",samples,enmo_mg,mad_mg,counts_x,counts_y,counts_z";

std::string columns_of(const char* which) {
  std::string text = kColumns;
  for (std::size_t at = 0; (at = text.find(',', at)) != std::string::npos; at += 1) {
    text.insert(at + 1, which);
  }
  return text;
}

void append(std::string& csv, const EpochSeries& series, const Epoch* epoch) {
  if (epoch == nullptr) {
    csv += ",,,,,,";
    return;
  }
  fmt::format_to(std::back_inserter(csv), ",{},{:.3f},{:.3f}", epoch->samples, epoch->enmo_mg,
                 epoch->mad_mg);
  for (const int count : epoch->counts) {
    csv += series.has_counts ? fmt::format(",{}", count) : ",";
  }
}

}  // namespace

std::string impact_csv(const Impact& impact) {
  // Both are in order of time.
  struct Pair {
    const Epoch* before = nullptr;
    const Epoch* after = nullptr;
  };
  std::map<std::uint32_t, Pair> epochs;
  std::string csv = "unix_time,time";
  if (impact.before) {
    csv += columns_of(impact.after ? "before_" : "");
    for (const Epoch& epoch : impact.before->epochs) {
      epochs[epoch.unix_time].before = &epoch;
    }
  }
  if (impact.after) {
    csv += columns_of("after_");
    for (const Epoch& epoch : impact.after->epochs) {
      epochs[epoch.unix_time].after = &epoch;
    }
  }
  csv += '\n';
  for (const auto& [time, pair] : epochs) {
    // The file's own clock: no zone is known here.
    std::string words = to_iso8601(from_unix_seconds(time));
    if (words.ends_with('Z')) {
      words.pop_back();
    }
    fmt::format_to(std::back_inserter(csv), "{},{}", time, words);
    if (impact.before) {
      append(csv, *impact.before, pair.before);
    }
    if (impact.after) {
      append(csv, *impact.after, pair.after);
    }
    csv += '\n';
  }
  return csv;
}

}  // namespace sixpoint::repair
