#include "repair/impact/study_impact.h"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/text/counted.h"
#include "base/text/csv_field.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

Json number_pair(double before, double after) { return {{"before", before}, {"after", after}}; }

double change_mg(const FileImpact& file) { return file.is.enmo_mg - file.was.enmo_mg; }

Json file_json(const FileImpact& file, const std::vector<CutPoint>& cuts) {
  Json json = {{"before", printable(file.before, 4096)}, {"after", printable(file.after, 4096)}};
  if (file.error) {
    json["error"] = file.error->brief();
    return json;
  }
  json["recorded_minutes"] = file.is.recorded_minutes;
  json["enmo_mg"] = number_pair(file.was.enmo_mg, file.is.enmo_mg);
  json["enmo_uncertainty_mg"] =
      file.is.enmo_uncertainty_mg ? Json(*file.is.enmo_uncertainty_mg) : Json(nullptr);
  json["mad_mg"] = number_pair(file.was.mad_mg, file.is.mad_mg);
  const auto moved = moves(file);
  json["moves"] = moved ? Json(*moved) : Json(nullptr);
  Json& minutes = json["minutes_above"] = Json::object();
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    minutes[printable(cuts[i].name, 200)] =
        number_pair(file.was.minutes[i].above, file.is.minutes[i].above);
  }
  return json;
}

}  // namespace

std::optional<bool> moves(const FileImpact& file) {
  if (!file.is.enmo_uncertainty_mg) {
    return std::nullopt;
  }
  return std::abs(change_mg(file)) > 2 * *file.is.enmo_uncertainty_mg;
}

StudyImpact::Summary StudyImpact::summary() const {
  Summary sum;
  sum.minutes_before.assign(cuts.size(), 0);
  sum.minutes_after.assign(cuts.size(), 0);
  for (const FileImpact& file : files) {
    if (file.error) {
      ++sum.failed;
      continue;
    }
    ++sum.files;
    const double minutes = file.is.recorded_minutes;
    sum.recorded_minutes += minutes;
    sum.enmo_before_mg += minutes * file.was.enmo_mg;
    sum.enmo_after_mg += minutes * file.is.enmo_mg;
    sum.mad_before_mg += minutes * file.was.mad_mg;
    sum.mad_after_mg += minutes * file.is.mad_mg;
    for (std::size_t i = 0; i < cuts.size(); ++i) {
      sum.minutes_before[i] += file.was.minutes[i].above;
      sum.minutes_after[i] += file.is.minutes[i].above;
    }
    const auto moved = moves(file);
    sum.moved += moved.value_or(false) ? 1 : 0;
    sum.unknown += moved ? 0 : 1;
    if (sum.most_file.empty() || std::abs(change_mg(file)) > std::abs(sum.most_mg)) {
      sum.most_mg = change_mg(file);
      sum.most_file = file.after;
    }
  }
  if (sum.recorded_minutes > 0) {
    for (double* mean :
         {&sum.enmo_before_mg, &sum.enmo_after_mg, &sum.mad_before_mg, &sum.mad_after_mg}) {
      *mean /= sum.recorded_minutes;
    }
  }
  return sum;
}

std::string StudyImpact::brief() const {
  std::string text = fmt::format("{:>12} {:>11} {:>11} {:>9} {:>11} {:>11}  {}\n", "minutes",
                                 "ENMO, mg", "after, mg", "+- mg", "MAD, mg", "after, mg", "file");
  for (const FileImpact& file : files) {
    if (file.error) {
      text += fmt::format("{:>70}  {}: {}\n", "-",
                          printable(file.after.empty() ? file.before : file.after),
                          file.error->brief());
      continue;
    }
    text += fmt::format(
        "{:>12.1f} {:>11.2f} {:>11.2f} {:>9} {:>11.2f} {:>11.2f}  {}\n", file.is.recorded_minutes,
        file.was.enmo_mg, file.is.enmo_mg,
        file.is.enmo_uncertainty_mg ? fmt::format("{:.2f}", *file.is.enmo_uncertainty_mg) : "-",
        file.was.mad_mg, file.is.mad_mg, printable(file.after));
  }
  const Summary sum = summary();
  if (sum.files == 0) {
    text += "no recording could be compared with its copy\n";
  } else {
    text += fmt::format("{}, {:.0f} minutes: ENMO {:.2f} -> {:.2f} mg, MAD {:.2f} -> {:.2f} mg\n",
                        counted(sum.files, "file"), sum.recorded_minutes, sum.enmo_before_mg,
                        sum.enmo_after_mg, sum.mad_before_mg, sum.mad_after_mg);
    for (std::size_t i = 0; i < cuts.size(); ++i) {
      text += fmt::format("minutes {} > {:g}, {}: {:.1f} -> {:.1f}\n", to_string(cuts[i].measure),
                          cuts[i].value, printable(cuts[i].name, 40), sum.minutes_before[i],
                          sum.minutes_after[i]);
    }
    text +=
        fmt::format("{} of them move by more than twice their uncertainty, most {:+.2f} mg ({})\n",
                    sum.moved, sum.most_mg, printable(sum.most_file));
  }
  if (sum.unknown > 0) {
    text += fmt::format("{} state no uncertainty\n", sum.unknown);
  }
  if (without_copy > 0) {
    text += fmt::format("{} more have no repaired copy: they are as they were\n", without_copy);
  }
  return text;
}

Json StudyImpact::to_json() const {
  Json json = {{"epoch_s", epoch_s}, {"recordings", Json::array()}};
  for (const FileImpact& file : files) {
    json["recordings"].push_back(file_json(file, cuts));
  }
  const Summary sum = summary();
  // There is no mean of nothing.
  const auto mean_pair = [&](double before, double after) {
    return sum.files > 0 ? number_pair(before, after)
                         : Json({{"before", nullptr}, {"after", nullptr}});
  };
  Json minutes = Json::object();
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    minutes[printable(cuts[i].name, 200)] =
        number_pair(sum.minutes_before[i], sum.minutes_after[i]);
  }
  json["summary"] = {
      {"files", sum.files},
      {"failed", sum.failed},
      {"without_copy", without_copy},
      {"recorded_minutes", sum.recorded_minutes},
      {"enmo_mg", mean_pair(sum.enmo_before_mg, sum.enmo_after_mg)},
      {"mad_mg", mean_pair(sum.mad_before_mg, sum.mad_after_mg)},
      {"minutes_above", std::move(minutes)},
      {"moved", sum.moved},
      {"uncertainty_not_stated", sum.unknown},
      {"largest_change_mg", sum.files > 0 ? Json(sum.most_mg) : Json(nullptr)},
      {"largest_change_in", sum.files > 0 ? Json(printable(sum.most_file, 4096)) : Json(nullptr)}};
  return json;
}

std::string study_csv(const StudyImpact& study) {
  std::string csv =
      "before,after,recorded_minutes,before_enmo_mg,after_enmo_mg,after_enmo_uncertainty_mg,"
      "before_mad_mg,after_mad_mg";
  for (const CutPoint& cut : study.cuts) {
    csv += fmt::format(",{},{}", csv_field(fmt::format("before_minutes_{}", cut.name)),
                       csv_field(fmt::format("after_minutes_{}", cut.name)));
  }
  csv += ",error\n";
  for (const FileImpact& file : study.files) {
    csv += fmt::format("{},{}", csv_field(file.before), csv_field(file.after));
    if (file.error) {
      csv.append(7 + 2 * study.cuts.size(), ',');
      csv += fmt::format("{}\n", csv_field(file.error->brief()));
      continue;
    }
    csv += fmt::format(
        ",{:.3f},{:.3f},{:.3f},{},{:.3f},{:.3f}", file.is.recorded_minutes, file.was.enmo_mg,
        file.is.enmo_mg,
        file.is.enmo_uncertainty_mg ? fmt::format("{:.3f}", *file.is.enmo_uncertainty_mg) : "",
        file.was.mad_mg, file.is.mad_mg);
    for (std::size_t i = 0; i < study.cuts.size(); ++i) {
      csv += fmt::format(",{:.3f},{:.3f}", file.was.minutes[i].above, file.is.minutes[i].above);
    }
    csv += ",\n";
  }
  return csv;
}

}  // namespace sixpoint::repair
