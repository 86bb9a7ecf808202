#include "repair/units/unit_answer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <tuple>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/text/counted.h"
#include "calib/application/agreement.h"
#include "calib/application/map_to_apply.h"
#include "calib/direction_cells.h"
#include "calib/solve.h"
#include "db/records.h"
#include "repair/rescale/applied_map.h"

namespace sixpoint::repair {
namespace {

// In the order of UnitRow.
constexpr std::array<std::string_view, 5> kRowNames = {"alone", "sibling", "pooled",
                                                       "contradiction", "missing"};

double start_of(const UnitFile& file) {
  return file.blocks.empty() ? 0 : file.blocks.front().start_time_s;
}

bool same_blocks(const UnitFile& a, const UnitFile& b) {
  return !a.blocks.empty() &&
         std::ranges::equal(
             a.blocks, b.blocks, [](const calib::StillBlock& one, const calib::StillBlock& other) {
               return one.start_time_s == other.start_time_s && one.mean_lsb == other.mean_lsb;
             });
}

// By time and content, so that neither names nor threads decide; copies are left out.
void put_in_order(std::vector<UnitFile>& files) {
  std::ranges::sort(files, [](const UnitFile& a, const UnitFile& b) {
    const auto key = [](const UnitFile& file) {
      const PerAxis<double> mean =
          file.blocks.empty() ? PerAxis<double>{} : file.blocks.front().mean_lsb;
      return std::tuple(start_of(file), file.blocks.size(), mean, std::cref(file.path).get());
    };
    return key(a) < key(b);
  });
  files.erase(std::unique(files.begin(), files.end(), same_blocks), files.end());
}

std::string name_of(const UnitFile& file) { return printable(file.path, 200); }

SensorsOwn sensors_own(const calib::ConstantsRecord& record) {
  return repair::sensors_own(record.calibration, record.uncertainty, record.cross_axis);
}

void take_sibling(const std::vector<UnitFile>& files, UnitAnswer& answer) {
  std::vector<const UnitFile*> own;
  for (const UnitFile& file : files) {
    if (file.own) {
      own.push_back(&file);
    }
  }
  const auto key = [](const UnitFile* file) {
    return std::tuple(!file->is_calibration_file,
                      calib::largest_uncertainty_mg(file->own->uncertainty), start_of(*file));
  };
  const UnitFile& best = **std::ranges::min_element(own, {}, key);
  const SensorsOwn its = sensors_own(*best.own);
  for (const UnitFile* other : own) {
    const SensorsOwn theirs = sensors_own(*other->own);
    const calib::Agreement between =
        calib::agreement(its.calibration, its.uncertainty, theirs.calibration, theirs.uncertainty);
    if (!between.agree()) {
      answer.row = UnitRow::contradiction;
      answer.why = fmt::format(
          "the constants that {} and {} of the unit have by themselves contradict each other: {}",
          name_of(best), name_of(*other), between.brief());
      return;
    }
  }
  answer.row = UnitRow::sibling;
  answer.record = best.own;
  answer.why =
      fmt::format("the constants are those of {}, another file of the unit", name_of(best));
}

// RMS over the directions of one file.
double distance_mg(const UnitFile& file, const calib::ConstantsRecord& record) {
  const bool has_terms = calib::map_to_apply(record).cross_axis;
  const auto cells = calib::cells_of(file.blocks);
  double square = 0;
  for (const calib::DirectionCell& cell : cells) {
    const PerAxis<double> g =
        has_terms ? record.cross_axis->to_g(cell.mean_lsb) : record.calibration.to_g(cell.mean_lsb);
    const double off_g = std::hypot(g[0], g[1], g[2]) - 1;
    square += off_g * off_g;
  }
  return kMgPerG * std::sqrt(square / static_cast<double>(cells.size()));
}

void widen(calib::ConstantsUncertainty& uncertainty) {
  for (double& zero_mg : uncertainty.zero_mg) {
    zero_mg = std::hypot(zero_mg, calib::kTemperatureAllowance_mg / std::sqrt(3.0));
  }
}

void refuse(UnitAnswer& answer, std::string why) {
  answer.row = UnitRow::contradiction;
  answer.record.reset();
  answer.why = "the files of the unit contradict each other: " + std::move(why);
}

// Where the record of the pool says it came from, for people.
std::string names_of(const std::vector<UnitFile>& files) {
  constexpr std::size_t kNamed = 3;
  std::vector<std::string> names;
  for (const UnitFile& file : files) {
    if (!file.blocks.empty() && names.size() < kNamed) {
      names.push_back(file_name_of(file.path));
    }
  }
  return db::storable_path(fmt::format("{} of the unit: {}{}", counted(files.size(), "file"),
                                       fmt::join(names, ", "),
                                       files.size() > names.size() ? ", ..." : ""));
}

// Every file against what all together say.
void judge_pool(const std::vector<UnitFile>& files, UnitAnswer& answer) {
  for (const UnitFile& file : files) {
    const double off_mg = file.blocks.empty() ? 0 : distance_mg(file, *answer.record);
    if (off_mg > kUnitTolerance_mg) {
      return refuse(answer,
                    fmt::format("by the constants of all together the still periods of {} are "
                                "{:.0f} mg from 1 g (limit {:.0f} mg)",
                                name_of(file), off_mg, kUnitTolerance_mg));
    }
  }
}

void take_pooled(const std::vector<UnitFile>& files, UtcTime now, UnitAnswer& answer) {
  std::vector<calib::StillBlock> blocks;
  const auto first =
      std::ranges::find_if(files, [](const UnitFile& file) { return !file.blocks.empty(); });
  for (const UnitFile& file : files) {
    for (calib::StillBlock block : file.blocks) {
      block.mean_g = first->file_constants.to_g(block.mean_lsb);
      block.temperature_c.reset();
      blocks.push_back(block);
    }
  }
  auto report = calib::solve_from_still_blocks(blocks, first->file_constants);
  if (!report) {
    answer.why = "the still periods of all its files together: " + report.error().brief();
    return;
  }
  answer.missing_sides = report->verification.missing_directions;
  if (!report->usable()) {
    answer.why =
        fmt::format("the still periods of its {} together do not suffice: {}",
                    counted(files.size(), "file"), fmt::join(report->verification.reasons, "; "));
    if (report->verification.contradicted) {
      refuse(answer, fmt::format("{}", fmt::join(report->verification.reasons, "; ")));
    }
    return;
  }
  report->serial = first->serial;
  report->filter = calib::FilterConfiguration::current;
  calib::ConstantsOrigin origin;
  origin.file = names_of(files);
  origin.kind = "file_scan";
  auto record = calib::record_of(*report, now, origin);
  if (!record) {
    answer.why = record.error().brief();
    return;
  }
  answer.row = UnitRow::pooled;
  answer.why = fmt::format("the constants are those of the still periods of {} of the unit",
                           counted(files.size(), "file"));
  answer.record = *std::move(record);
  judge_pool(files, answer);
  if (answer.record) {
    widen(answer.record->uncertainty);
    if (answer.record->cross_axis) {
      widen(answer.record->cross_axis->uncertainty);
    }
  }
}

}  // namespace

std::string_view to_string(UnitRow row) { return kRowNames[static_cast<std::size_t>(row)]; }

namespace {

UnitAnswer answer_of_all(std::vector<UnitFile> files, UtcTime now) {
  put_in_order(files);
  UnitAnswer answer;
  answer.files = files.size();
  std::vector<PerAxis<double>> means_g;
  bool one_serial = true;
  for (const UnitFile& file : files) {
    one_serial = one_serial && file.serial == files.front().serial;
    for (const calib::StillBlock& block : file.blocks) {
      means_g.push_back(file.file_constants.to_g(block.mean_lsb));
    }
  }
  answer.missing_sides = calib::coverage_of(means_g).missing_directions();
  const bool has_own = std::ranges::any_of(files, [](const auto& file) { return !!file.own; });
  answer.own_suffices = has_own;
  if (has_own) {
    answer.missing_sides.clear();
  }
  if (files.size() < 2) {
    return answer;
  }
  answer.row = UnitRow::missing;
  if (!one_serial) {
    refuse(answer, "they are of several serial numbers");
  } else if (has_own) {
    take_sibling(files, answer);
  } else if (means_g.empty()) {
    answer.why = "none of its files has a still period";
  } else {
    take_pooled(files, now, answer);
  }
  return answer;
}

}  // namespace

bool may_help(const FileFacts& facts) {
  return triage(facts).verdict == Verdict::not_affected &&
         filter_in_force(facts) == calib::FilterConfiguration::current;
}

UnitAnswer unit_answer(std::vector<UnitFile> files, UtcTime now) {
  std::vector<UnitFile> affected;
  std::ranges::copy_if(files, std::back_inserter(affected), std::not_fn(&UnitFile::only_helps));
  const bool helped = affected.size() < files.size() && !affected.empty();
  UnitAnswer answer = answer_of_all(std::move(affected), now);
  if (helped && !answer.own_suffices &&
      (answer.row == UnitRow::alone || answer.row == UnitRow::missing)) {
    if (UnitAnswer all = answer_of_all(std::move(files), now); all.row == UnitRow::pooled) {
      return all;
    }
  }
  return answer;
}

}  // namespace sixpoint::repair
