#include "repair/triage/inspection.h"

#include <algorithm>

#include <fmt/format.h>

#include "base/time.h"
#include "gt3x/forms/agdc.h"
#include "gt3x/forms/sample_rate.h"
#include "repair/triage/agd.h"
#include "repair/triage/file_tree.h"
#include "repair/triage/survey.h"

namespace sixpoint::repair {
namespace {

// Finds still blocks while the samples are read, so that no recording must fit into memory.
class StillWatch {
 public:
  StillWatch(bool use_constants, const gt3x::Info& info, std::vector<std::string>& warnings)
      : use_constants_(use_constants), info_(info), warnings_(warnings) {}

  // `constants`: of the samples before any PARAMETERS (the old form). `rotated`: the axes are to
  // be turned back.
  Status start(double rate_hz, double scale, const std::optional<StoredConstants>& constants,
               bool rotated) {
    SIXPOINT_ASSIGN(auto made, StillScan::make(rate_hz, scale));
    scan_.emplace(std::move(made));
    rotated_ = rotated;
    return constants && use_constants_ ? scan_->set_constants(*constants) : Status();
  }

  void push(const gt3x::SampleItem& item, bool raw_counts) {
    if (!scan_) {
      return;
    }
    if (item.parameters != parameters_ && item.parameters != nullptr) {
      const auto scale_lsb_per_g =
          raw_counts ? std::nullopt : gt3x::accel_scale_lsb_per_g(info_, item.parameters);
      Status status = scan_->set_scale(scale_lsb_per_g.value_or(kUsualScale_lsb_per_g));
      if (status && item.parameters->constants && use_constants_) {
        status = scan_->set_constants(*item.parameters->constants);
      }
      if (!status) {
        warnings_.push_back("still periods cannot be judged: " + status.error().what);
        scan_.reset();
        return;
      }
    }
    parameters_ = item.parameters;
    if (item.broke_order) {
      scan_->break_run();
    }
    if (rotated_) {
      turned_.assign(item.counts.begin(), item.counts.end());
      undo_rotation(turned_, item.type == gt3x::RecordType::activity ? calib::RecordWidth::bits12
                                                                     : calib::RecordWidth::bits16);
      scan_->push(item.unix_time, turned_);
    } else {
      scan_->push(item.unix_time, item.counts);
    }
  }

  void break_run() {
    if (scan_) {
      scan_->break_run();
    }
  }

  // `agdc`: how the raw counts of such a file become g; null where counts have a scale.
  std::optional<InspectedStill> finish(const gt3x::AgdcCalibration* agdc) {
    if (!scan_) {
      return std::nullopt;
    }
    auto blocks = scan_->finish();
    if (agdc != nullptr) {
      for (calib::StillBlock& block : blocks) {
        block.mean_g = agdc->apply_to_mean(block.mean_lsb);
      }
    }
    return InspectedStill{calib::coverage_of(blocks), magnitude_error(blocks)};
  }

 private:
  bool use_constants_;
  const gt3x::Info& info_;
  std::vector<std::string>& warnings_;
  bool rotated_ = false;
  std::optional<StillScan> scan_;
  const gt3x::Parameters* parameters_ = nullptr;
  std::vector<gt3x::Counts> turned_;
};

void take_samples(Inspection& found, StillWatch& still, const gt3x::SampleItem& item,
                  const gt3x::Info& info, bool raw_counts) {
  if (found.samples == 0) {  // the first sample decides
    found.start = item.unix_time;
    found.accel_scale_lsb_per_g = gt3x::accel_scale_lsb_per_g(info, item.parameters);
    if (raw_counts) {
      found.accel_scale_lsb_per_g.reset();  // the file says 1, which is no scale
    }
    if (found.rate_hz.value_or(0) > 0 && (found.accel_scale_lsb_per_g || raw_counts)) {
      if (const Status started = still.start(
              *found.rate_hz, found.accel_scale_lsb_per_g.value_or(kUsualScale_lsb_per_g),
              found.form == "gt3x_old" ? found.constants : std::nullopt,
              triage(found.facts).axes_rotated && !found.already_repaired);
          !started) {
        found.problem = started.error();
      }
    }
  }
  found.samples += item.counts.size();
  if (const auto all = gt3x::range_of(item.counts);
      all.low <= item.limit_min || all.high >= item.limit_max) {
    found.clipped_samples += static_cast<std::uint64_t>(std::ranges::count_if(
        item.counts, [&](const gt3x::Counts& sample) { return item.clipped(sample); }));
  }
  if (found.rate_hz.value_or(0) > 0) {
    found.end_s = std::max(
        found.end_s, item.unix_time + static_cast<double>(item.counts.size()) / *found.rate_hz);
  }
  still.push(item, raw_counts);
}

// What is irregular about the times, a line for each kind that was met.
void add_time_warnings(Inspection& found) {
  using enum gt3x::IrregularKind;
  const auto warn = [&](gt3x::IrregularKind kind, const char* what) {
    const auto& places = found.irregular.places;
    const auto first = std::ranges::find(places, kind, &gt3x::Irregular::Place::kind);
    if (first != places.end()) {
      found.warnings.push_back(fmt::format("{} {}; the first at {}", found.irregular.count(kind),
                                           what, gt3x::clock_time(found.clock, first->unix_time)));
    }
  };
  warn(repeated, "records repeat a second");
  warn(repeated_otherwise, "records repeat a second with other samples");
  warn(out_of_order, "records stand behind later ones");
  warn(late, "records come so late that they have no place and are left out");
  warn(odd_size, "records hold more or fewer samples than the rate");
  warn(jump, "times leap back, or forward by more than an hour, and nothing in the file says why");
}

// Where PARAMETERS and info.txt, or two PARAMETERS, say two things.
class HeaderCheck {
 public:
  explicit HeaderCheck(Inspection& found) : found_(found) {}

  void run(const gt3x::Info& info, const gt3x::SampleReader& reader) {
    std::optional<double> rate_hz = info.sample_rate_hz();
    std::optional<double> scale_lsb_per_g = info.accel_scale_lsb_per_g();
    std::string firmware = info.firmware();
    std::string before = "info.txt";
    for (const char* key : {"Serial Number", "Firmware", "Sample Rate", "Acceleration Scale"}) {
      if (const auto other = info.other(key)) {
        found_.warnings.push_back(
            fmt::format("info.txt says two things for '{}': {}, which counts, "
                        "and {}",
                        key, printable(*info.get(key), 60), printable(*other, 60)));
      }
    }
    for (const auto& set : reader.parameter_sets()) {
      const auto rate = set->parameters.values.find(gt3x::kParameterSampleRate);
      if (rate != set->parameters.values.end()) {
        compare("a sample rate of", "Hz", rate_hz, static_cast<double>(rate->second), before, *set,
                "info.txt holds");
      }
      if (set->parameters.accel_scale_lsb_per_g) {
        compare("an acceleration scale of", "LSB/g", scale_lsb_per_g,
                *set->parameters.accel_scale_lsb_per_g, before, *set,
                "PARAMETERS hold, from there on");
      }
      if (set->parameters.firmware) {
        if (!firmware.empty() &&
            parse_firmware(firmware) != parse_firmware(*set->parameters.firmware)) {
          say(fmt::format("firmware {}", firmware), *set->parameters.firmware, before, *set,
              "what the samples were made by is not known");
        }
        firmware = *set->parameters.firmware;
      }
      before = "the PARAMETERS record before";
    }
  }

 private:
  void compare(const char* what, const char* unit, std::optional<double>& known, double value,
               const std::string& before, const gt3x::ParameterSet& set, const char* holds) {
    if (known && *known != value) {
      say(fmt::format("{} {} {}", what, *known, unit), fmt::format("{}", value), before, set,
          holds);
    }
    known = value;
  }

  void say(const std::string& what, const std::string& other, const std::string& before,
           const gt3x::ParameterSet& set, const char* holds) {
    constexpr int kMostSaid = 10;
    if (++said_ <= kMostSaid) {
      found_.warnings.push_back(fmt::format("{} says {}, PARAMETERS of {} say {}; {}", before, what,
                                            gt3x::clock_time(found_.clock, set.unix_time), other,
                                            holds));
    }
  }

  Inspection& found_;
  int said_ = 0;
};

void add_warnings(Inspection& found, const gt3x::SampleReader& reader,
                  const FirstParameters& first) {
  const auto warn = [&](std::string text) { found.warnings.push_back(std::move(text)); };
  const gt3x::LogStatistics& log = reader.statistics();
  if (log.checksum_failures > 0) {
    warn(fmt::format("{} records have a wrong checksum; their samples are not used",
                     log.checksum_failures));
  }
  for (const gt3x::Loss& loss : log.losses) {
    if (found.warnings.size() > 20) {
      warn(fmt::format("... {} damaged stretches in all", log.damaged_stretches));
      break;
    }
    const auto time_or_dash = [&](std::optional<std::uint32_t> unix_time) {
      return unix_time ? gt3x::clock_time(found.clock, *unix_time) : "-";
    };
    warn(fmt::format("{} bytes at {} are damaged, between {} and {}", loss.bytes, loss.offset,
                     time_or_dash(loss.time_before), time_or_dash(loss.time_after)));
  }
  if (found.form == "gt3x" && reader.parameter_sets().empty()) {
    warn("there are no PARAMETERS: the recording does not say which constants it was scaled with");
  } else if (found.form == "gt3x" && !first.constants_stand_before && found.samples > 0) {
    warn("the first sample has no complete set of constants (PARAMETERS) before it");
  }
  if (first.constants && !first.known_constants()) {
    warn(
        "PARAMETERS have some of the nine constants only, and other ones than a complete record: "
        "which constants the first samples were made by is not known");
  }
  if (reader.constants_changed()) {
    warn("PARAMETERS are repeated with other constants; for each sample the last before it hold");
  }
  if (reader.unreadable_parameters() > 0) {
    warn(fmt::format("{} PARAMETERS records cannot be read", reader.unreadable_parameters()));
  }
  for (const auto& set : reader.parameter_sets()) {
    if (set->parameters.has_zero_range()) {
      warn("an axis has the same positive and negative reading: Eq. 1-3 divide by zero");
      break;
    }
  }
  add_time_warnings(found);
}

Result<Inspection> inspect_recording(FileSystem& files, const std::string& path,
                                     const gt3x::RecordingOptions& how) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, path, how));
  const gt3x::Info& info = recording.info();
  Inspection found;
  found.form = recording.has_log() ? "gt3x" : "gt3x_old";
  found.facts = header_facts(info);
  found.device_type = info.device_type();
  found.rate_hz = info.sample_rate_hz();
  found.entries = recording.entries();
  SIXPOINT_ASSIGN(found.already_repaired, carries_repair_mark(recording));
  found.accel_scale_lsb_per_g = gt3x::accel_scale_lsb_per_g(info, nullptr);
  const auto rate = gt3x::usable_sample_rate_hz(info, path);
  if (!rate && !recording.has_log()) {
    return tl::unexpected(rate.error());
  }

  std::optional<gt3x::AgdcCalibration> agdc;
  if (recording.has_entry("calibration.json")) {
    auto calibration = gt3x::agdc_calibration(recording, found.rate_hz.value_or(0));
    if (calibration) {
      agdc = *std::move(calibration);
    } else {
      found.warnings.push_back("calibration.json: " + calibration.error().what);
    }
  }

  if (recording.has_log()) {  // whether axes are turned is asked of the first sample
    SIXPOINT_ASSIGN(const auto first, first_parameters(recording, /*with_constants=*/false));
    if (first.record) {
      add_facts(*first.record, found.facts);
    }
  } else {
    if (const auto memory = unit_memory(recording)) {
      found.constants = memory->constants;
      add_facts(*memory, found.facts);
    } else {
      found.warnings.push_back("there are no constants: " + memory.error().what);
    }
    if (!info.start()) {
      found.warnings.emplace_back(
          "info.txt gives no Start Date, and activity.bin no times: they begin in 1970");
    }
  }

  // A repaired file keeps its PARAMETERS, but its counts come from other constants.
  StillWatch still(!found.already_repaired, info, found.warnings);
  gt3x::SampleReader reader(recording);
  gt3x::GapList gaps;
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, reader.next());
    if (!item) {
      break;
    }
    if (item->kind != gt3x::SampleItem::Kind::recorded) {
      still.break_run();
      gaps.add(*item);
      found.end_s = std::max(found.end_s, static_cast<double>(item->unix_time) + item->seconds);
      continue;
    }
    if (item->type == gt3x::RecordType::activity3) {
      found.form = "agdc";
    }
    const bool raw_counts = found.form == "agdc" && !(agdc && agdc->already_applied);
    take_samples(found, still, *item, info, raw_counts);
  }
  FirstParameters first;
  if (recording.has_log()) {
    SIXPOINT_ASSIGN(first, first_parameters(recording, reader));
    found.constants = first.known_constants();
  }
  found.gaps = gaps.listed();
  found.gap_count = gaps.count();
  found.gap_seconds = gaps.seconds();
  found.log = reader.statistics();
  found.irregular = reader.irregular();
  found.clock = reader.clock();
  if (const auto start = info.start(); start && found.start) {
    found.first_after_start_s = std::int64_t{*found.start} - to_unix_seconds(*start);
  }
  if (found.form != "agdc" || agdc) {
    found.still = still.finish(agdc && !agdc->already_applied ? &*agdc : nullptr);
  }
  if (found.form == "agdc") {
    found.constants = agdc ? agdc->constants : std::nullopt;
  }
  if (found.problem) {
    found.problem->where = path;
  }
  add_warnings(found, reader, first);
  if (recording.bytes_behind() > 0) {
    found.warnings.push_back(
        fmt::format("{} bytes stand behind the end of the archive; they are ignored",
                    recording.bytes_behind()));
  }
  HeaderCheck(found).run(info, reader);
  if (how.salvage) {
    SIXPOINT_ASSIGN(found.losses, gt3x::salvage_losses(recording, found.log));
  }
  if (!rate) {
    found.problem = rate.error();
  } else if (found.samples == 0) {
    found.problem = Error{ErrorCode::bad_data, "the recording holds no samples", path,
                          "check that the unit was started, and download it again"};
  }
  return found;
}

Result<Inspection> inspect_agd(const std::string& path) {
  SIXPOINT_ASSIGN(auto facts, read_agd_facts(path));
  Inspection found;
  found.form = "agd";
  found.facts = std::move(facts);
  found.warnings.emplace_back(
      "an .agd holds epochs, and no samples: those are in the .gt3x that it was made from");
  return found;
}

}  // namespace

double Inspection::duration_s() const { return start ? std::max(0.0, end_s - *start) : 0; }

Result<Inspection> inspect(FileSystem& files, const std::string& path,
                           const gt3x::RecordingOptions& how) {
  return has_ending(path, ".agd") ? inspect_agd(path) : inspect_recording(files, path, how);
}

}  // namespace sixpoint::repair
