// sixpoint inspect FILE: what a recording holds, without judging it.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "calib/coverage.h"
#include "gt3x/agdc.h"
#include "gt3x/model.h"
#include "gt3x/sample_reader.h"
#include "repair/agd.h"
#include "repair/file_tree.h"
#include "repair/still_scan.h"
#include "repair/survey.h"
#include "repair/triage.h"
#include "station/cli/command.h"

namespace sixpoint::cli {
namespace {

struct Gap {
  std::uint32_t start = 0;
  std::uint64_t seconds = 0;
  gt3x::GapKind kind = gt3x::GapKind::unexplained;
};

struct Still {
  calib::Coverage coverage;
  repair::MagnitudeError magnitude;
};

struct Findings {
  static constexpr std::size_t kMaxGapsListed = 10'000;

  std::string form;
  repair::FileFacts facts;
  std::string device_type;
  std::optional<double> rate_hz;
  std::optional<double> accel_scale_lsb_per_g;
  std::optional<std::uint32_t> start;
  double end_s = 0;  // Unix time behind the last sample, or the last gap where that is later
  std::uint64_t samples = 0;
  std::uint64_t clipped_samples = 0;
  gt3x::LogStatistics log;
  std::optional<StoredConstants> constants;
  std::vector<Gap> gaps;
  std::uint64_t gap_count = 0;
  std::uint64_t gap_seconds = 0;
  std::optional<Still> still;
  bool already_repaired = false;
  std::vector<gt3x::EntryInfo> entries;
  std::vector<std::string> warnings;
  std::optional<Error> problem;  // the file can be read but not used
};

void add_gap(Findings& findings, const gt3x::SampleItem& item) {
  const bool usb_record = item.kind == gt3x::SampleItem::Kind::usb;
  const gt3x::GapKind kind = usb_record ? gt3x::GapKind::usb : item.gap;
  findings.gap_seconds += item.seconds;
  findings.end_s = std::max(findings.end_s, static_cast<double>(item.unix_time) + item.seconds);
  if (!findings.gaps.empty() && findings.gaps.size() == findings.gap_count) {
    Gap& last = findings.gaps.back();
    // A USB record and the silence behind it are one stretch of charging.
    if (last.kind == gt3x::GapKind::usb && kind == gt3x::GapKind::usb &&
        last.start + last.seconds == item.unix_time) {
      last.seconds += item.seconds;
      return;
    }
  }
  ++findings.gap_count;
  if (findings.gaps.size() < Findings::kMaxGapsListed) {
    findings.gaps.push_back({item.unix_time, item.seconds, kind});
  }
}

// The constants that an .agdc file carries beside its raw counts.
std::optional<StoredConstants> agdc_constants(gt3x::Recording& recording, double rate_hz) {
  auto source = recording.open_entry("calibration.json");
  if (!source) {
    return std::nullopt;
  }
  const auto bytes = gt3x::read_all(**source, 1 << 20);
  if (!bytes) {
    return std::nullopt;
  }
  const auto calibration = gt3x::parse_agdc_calibration(
      std::string_view(reinterpret_cast<const char*>(bytes->data()), bytes->size()),
      static_cast<int>(rate_hz));
  return calibration ? calibration->constants : std::nullopt;
}

// Feeds the still-block finder while the samples go by.
class StillWatch {
 public:
  StillWatch(bool use_constants, std::vector<std::string>& warnings)
      : use_constants_(use_constants), warnings_(warnings) {}

  void start(double rate_hz, double scale) {
    if (auto made = repair::StillScan::make(rate_hz, scale)) {
      scan_.emplace(*std::move(made));
    }
  }

  void push(const gt3x::SampleItem& item, bool rotated) {
    if (!scan_) {
      return;
    }
    if (item.parameters != parameters_ && item.parameters != nullptr &&
        item.parameters->constants && use_constants_) {
      if (auto status = scan_->set_constants(*item.parameters->constants); !status) {
        warnings_.push_back("still periods cannot be judged: " + status.error().what);
        scan_.reset();
        return;
      }
    }
    parameters_ = item.parameters;
    if (item.broke_order) {
      scan_->break_run();
    }
    if (rotated) {
      turned_.assign(item.counts.begin(), item.counts.end());
      repair::undo_rotation(turned_);
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

  std::optional<Still> finish() {
    if (!scan_) {
      return std::nullopt;
    }
    const auto blocks = scan_->finish();
    return Still{calib::coverage_of(blocks), repair::magnitude_error(blocks)};
  }

 private:
  bool use_constants_;
  std::vector<std::string>& warnings_;
  std::optional<repair::StillScan> scan_;
  const gt3x::Parameters* parameters_ = nullptr;
  std::vector<gt3x::Counts> turned_;
};

void take_samples(Findings& findings, StillWatch& still, const gt3x::SampleItem& item,
                  const gt3x::Info& info) {
  if (findings.samples == 0) {  // the first sample decides
    findings.start = item.unix_time;
    findings.accel_scale_lsb_per_g = gt3x::accel_scale_lsb_per_g(info, item.parameters);
    if (item.parameters != nullptr) {
      findings.constants = item.parameters->constants;
      findings.facts.calibration_time = item.parameters->calibration_time;
      if (findings.facts.firmware.empty()) {
        findings.facts.firmware = item.parameters->firmware.value_or("");
      }
    }
    if (findings.rate_hz.value_or(0) > 0 && findings.accel_scale_lsb_per_g &&
        item.type != gt3x::RecordType::activity3) {
      still.start(*findings.rate_hz, *findings.accel_scale_lsb_per_g);
    }
  }
  findings.samples += item.counts.size();
  findings.clipped_samples += static_cast<std::uint64_t>(std::ranges::count_if(
      item.counts, [&](const gt3x::Counts& sample) { return item.clipped(sample); }));
  if (findings.rate_hz.value_or(0) > 0) {
    findings.end_s =
        std::max(findings.end_s,
                 item.unix_time + static_cast<double>(item.counts.size()) / *findings.rate_hz);
  }
  const bool rotated = repair::triage(findings.facts).axes_rotated && !findings.already_repaired;
  still.push(item, rotated);
}

void add_warnings(Findings& findings, const gt3x::SampleReader& reader, std::uint64_t steps_back) {
  const auto warn = [&](std::string text) { findings.warnings.push_back(std::move(text)); };
  const gt3x::LogStatistics& log = reader.statistics();
  if (log.checksum_failures > 0) {
    warn(fmt::format("{} records have a wrong checksum; their samples are not used",
                     log.checksum_failures));
  }
  for (const gt3x::Loss& loss : log.losses) {
    const auto time = [](std::optional<std::uint32_t> unix_time) {
      return unix_time ? to_iso8601(from_unix_seconds(*unix_time)) : std::string("-");
    };
    if (findings.warnings.size() > 20) {
      warn(fmt::format("... {} damaged stretches in all", log.damaged_stretches));
      break;
    }
    warn(fmt::format("{} bytes at {} are damaged, between {} and {}", loss.bytes, loss.offset,
                     time(loss.time_before), time(loss.time_after)));
  }
  if (findings.form == "gt3x" && reader.parameter_sets().empty()) {
    warn("there are no PARAMETERS: the recording does not say which constants it was scaled with");
  } else if (findings.form == "gt3x" && !findings.constants && findings.samples > 0) {
    warn("the first sample has no complete set of constants (PARAMETERS) before it");
  }
  if (reader.constants_changed()) {
    warn("PARAMETERS are repeated with other constants; for each sample the last before it hold");
  }
  if (reader.unreadable_parameters() > 0) {
    warn(fmt::format("{} PARAMETERS records make no sense", reader.unreadable_parameters()));
  }
  for (const auto& set : reader.parameter_sets()) {
    if (set->parameters.has_zero_range()) {
      warn("an axis has the same positive and negative reading: Eq. 1-3 divide by zero");
      break;
    }
  }
  if (steps_back > 0) {
    warn(fmt::format("the time does not go forward at {} records", steps_back));
  }
}

Result<Findings> inspect_recording(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, path));
  const gt3x::Info& info = recording.info();
  Findings findings;
  findings.form = recording.has_log() ? "gt3x" : "gt3x_old";
  findings.facts.serial = info.serial();
  findings.facts.firmware = info.firmware();
  findings.device_type = info.device_type();
  findings.rate_hz = info.sample_rate_hz();
  findings.entries = recording.entries();
  findings.already_repaired = recording.has_entry(repair::kRepairMark);
  findings.accel_scale_lsb_per_g = gt3x::accel_scale_lsb_per_g(info, nullptr);
  if (findings.rate_hz.value_or(0) <= 0 && !recording.has_log()) {
    return fail(ErrorCode::bad_data, "info.txt names no sample rate above 0", path,
                "download the recording from the unit again");
  }

  // A mended file's counts come from other constants than its PARAMETERS say.
  StillWatch still(!findings.already_repaired, findings.warnings);
  gt3x::SampleReader reader(recording);
  std::uint64_t steps_back = 0;
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, reader.next());
    if (!item) {
      break;
    }
    if (item->kind != gt3x::SampleItem::Kind::recorded) {
      still.break_run();
      add_gap(findings, *item);
      continue;
    }
    if (item->type == gt3x::RecordType::activity3) {
      findings.form = "agdc";
    }
    steps_back += item->broke_order ? 1 : 0;
    take_samples(findings, still, *item, info);
  }
  findings.log = reader.statistics();
  findings.still = still.finish();
  if (findings.samples == 0 && !reader.parameter_sets().empty()) {
    const gt3x::Parameters& last = reader.parameter_sets().back()->parameters;
    findings.constants = last.constants;
    findings.facts.calibration_time = last.calibration_time;
  }
  if (findings.form == "agdc") {
    findings.constants = agdc_constants(recording, findings.rate_hz.value_or(0));
  }
  add_warnings(findings, reader, steps_back);
  if (findings.rate_hz.value_or(0) <= 0) {
    findings.problem = Error{ErrorCode::bad_data, "info.txt names no sample rate above 0", path,
                             "download the recording from the unit again"};
  } else if (findings.samples == 0) {
    findings.problem = Error{ErrorCode::bad_data, "the recording holds no samples", path,
                             "check that the unit was started, and download it again"};
  }
  return findings;
}

Result<Findings> inspect_agd(const std::string& path) {
  SIXPOINT_ASSIGN(auto facts, repair::read_agd_facts(path));
  Findings findings;
  findings.form = "agd";
  findings.facts = std::move(facts);
  findings.warnings.emplace_back(
      "an .agd holds epochs, no samples; make it anew from its repaired recording");
  return findings;
}

Json axes(const PerAxis<int>& values) { return Json{values[0], values[1], values[2]}; }
Json axes(const PerAxis<double>& values) {
  return Json{number(values[0]), number(values[1]), number(values[2])};
}
Json time_or_null(std::optional<UtcTime> time) {
  return time ? Json(to_iso8601(*time)) : Json(nullptr);
}
std::string filter_name(std::optional<calib::FilterConfiguration> filter) {
  return std::string(filter ? calib::to_string(*filter) : "unknown");
}
double duration_s(const Findings& findings) {
  return findings.start ? std::max(0.0, findings.end_s - *findings.start) : 0;
}

Json to_json(const Findings& findings, const std::string& path) {
  Json json = document("inspect");
  json["path"] = path;
  json["form"] = findings.form;
  json["serial"] = findings.facts.serial;
  json["firmware"] = findings.facts.firmware;
  json["model"] = gt3x::model_of(findings.facts.serial);
  json["device_type"] = findings.device_type;
  json["sample_rate_hz"] = findings.rate_hz ? number(*findings.rate_hz) : Json(nullptr);
  json["accel_scale_lsb_per_g"] =
      findings.accel_scale_lsb_per_g ? number(*findings.accel_scale_lsb_per_g) : Json(nullptr);
  json["start"] = findings.start ? Json(to_iso8601(from_unix_seconds(*findings.start))) : nullptr;
  json["samples"] = findings.samples;
  json["duration_s"] = number(duration_s(findings));
  Json records = Json::object();
  for (std::size_t type = 0; type < findings.log.records.size(); ++type) {
    if (findings.log.records[type] > 0) {
      records[gt3x::record_type_name(static_cast<std::uint8_t>(type))] = findings.log.records[type];
    }
  }
  json["records"] = std::move(records);
  json["constants"] = nullptr;
  if (findings.constants) {
    json["constants"] = {{"positive_lsb", axes(findings.constants->positive_lsb)},
                         {"negative_lsb", axes(findings.constants->negative_lsb)},
                         {"zero_lsb", axes(findings.constants->zero_lsb)}};
  }
  json["calibration_time"] = time_or_null(findings.facts.calibration_time);
  json["filter"] = {
      {"in_force", filter_name(repair::filter_in_force(findings.facts))},
      {"constants_measured_under", filter_name(repair::filter_of_constants(findings.facts))}};
  json["gaps"] = Json::array();
  for (const Gap& gap : findings.gaps) {
    json["gaps"].push_back({{"start", to_iso8601(from_unix_seconds(gap.start))},
                            {"seconds", gap.seconds},
                            {"kind", gt3x::to_string(gap.kind)}});
  }
  json["gap_count"] = findings.gap_count;
  json["gap_seconds"] = findings.gap_seconds;
  json["clipped_samples"] = findings.clipped_samples;
  json["checksum_failures"] = findings.log.checksum_failures;
  json["still"] = nullptr;
  if (findings.still) {
    const Still& still = *findings.still;
    const bool any = still.magnitude.blocks > 0;
    json["still"] = {{"blocks", still.magnitude.blocks},
                     {"coverage_g",
                      {{"min", any ? axes(still.coverage.min_g) : Json(nullptr)},
                       {"max", any ? axes(still.coverage.max_g) : Json(nullptr)}}},
                     {"magnitude_mg",
                      {{"mean_error", any ? number(still.magnitude.mean_mg) : Json(nullptr)},
                       {"worst_error", any ? number(still.magnitude.worst_mg) : Json(nullptr)}}}};
  }
  json["damage"] = {{"stretches", findings.log.damaged_stretches},
                    {"bytes", findings.log.damaged_bytes},
                    {"stray_bytes", findings.log.stray_bytes},
                    {"losses", Json::array()}};
  for (const gt3x::Loss& loss : findings.log.losses) {
    const auto time = [](std::optional<std::uint32_t> unix_time) {
      return unix_time ? Json(to_iso8601(from_unix_seconds(*unix_time))) : Json(nullptr);
    };
    json["damage"]["losses"].push_back({{"offset", loss.offset},
                                        {"bytes", loss.bytes},
                                        {"after", time(loss.time_before)},
                                        {"before", time(loss.time_after)}});
  }
  json["already_repaired"] = findings.already_repaired;
  json["entries"] = Json::array();
  for (const gt3x::EntryInfo& entry : findings.entries) {
    json["entries"].push_back({{"name", entry.name}, {"bytes", entry.size}});
  }
  json["warnings"] = findings.warnings;
  if (findings.problem) {
    json["error"] = error_to_json(*findings.problem);
  }
  return json;
}

void print_axes(std::ostream& out, const char* name, const PerAxis<int>& values) {
  out << fmt::format("  {:<18}{:>8}{:>8}{:>8}\n", name, values[0], values[1], values[2]);
}

void print(std::ostream& out, const Findings& findings, const std::string& path) {
  const auto line = [&](const char* name, const std::string& value) {
    out << fmt::format("{:<20}{}\n", name, printable(value, 200));
  };
  line("file", path);
  line("unit", fmt::format("{} ({}), firmware {}", findings.facts.serial,
                           gt3x::model_of(findings.facts.serial),
                           findings.facts.firmware.empty() ? "?" : findings.facts.firmware));
  if (findings.form != "agd") {
    line("samples",
         fmt::format("{} at {} Hz, {} LSB/g", findings.samples, findings.rate_hz.value_or(0),
                     findings.accel_scale_lsb_per_g.value_or(0)));
    line("start", findings.start ? to_iso8601(from_unix_seconds(*findings.start)) : "-");
    line("duration", fmt::format("{:.1f} s, of which {} s are gaps", duration_s(findings),
                                 findings.gap_seconds));
  }
  line("calibrated", findings.facts.calibration_time ? to_iso8601(*findings.facts.calibration_time)
                                                     : std::string("not said"));
  line("filter", fmt::format("{} in force, constants measured under {}",
                             filter_name(repair::filter_in_force(findings.facts)),
                             filter_name(repair::filter_of_constants(findings.facts))));
  if (findings.constants) {
    out << fmt::format("{:<20}{:>8}{:>8}{:>8}\n", "constants in LSB", "X", "Y", "Z");
    print_axes(out, "positive", findings.constants->positive_lsb);
    print_axes(out, "negative", findings.constants->negative_lsb);
    print_axes(out, "zero", findings.constants->zero_lsb);
  }
  if (findings.still) {
    const Still& still = *findings.still;
    line("still periods", fmt::format("{} of 4 s", still.magnitude.blocks));
    if (still.magnitude.blocks > 0) {
      line("  reach in g",
           fmt::format("X {:.2f} .. {:.2f}   Y {:.2f} .. {:.2f}   Z {:.2f} .. {:.2f}",
                       still.coverage.min_g[0], still.coverage.max_g[0], still.coverage.min_g[1],
                       still.coverage.max_g[1], still.coverage.min_g[2], still.coverage.max_g[2]));
      line("  from 1 g", fmt::format("{:.1f} mg on average, {:.1f} mg at worst",
                                     still.magnitude.mean_mg, still.magnitude.worst_mg));
    }
  }
  line("clipped samples", fmt::format("{}", findings.clipped_samples));
  line("wrong checksums", fmt::format("{}", findings.log.checksum_failures));
  for (std::size_t type = 0; type < findings.log.records.size(); ++type) {
    if (findings.log.records[type] > 0) {
      line("records", fmt::format("{:>9} {}", findings.log.records[type],
                                  gt3x::record_type_name(static_cast<std::uint8_t>(type))));
    }
  }
  constexpr std::size_t kGapsShown = 20;
  for (std::size_t i = 0; i < std::min(findings.gaps.size(), kGapsShown); ++i) {
    const Gap& gap = findings.gaps[i];
    line("gap", fmt::format("{}  {:>7} s  {}", to_iso8601(from_unix_seconds(gap.start)),
                            gap.seconds, gt3x::to_string(gap.kind)));
  }
  if (findings.gap_count > kGapsShown) {
    line("gap", fmt::format("... {} in all; --json lists them", findings.gap_count));
  }
}

}  // namespace

void add_inspect(CLI::App& app, Context& context) {
  struct Options {
    std::string path;
    bool json = false;
  };
  auto* command = app.add_subcommand("inspect", "what a .gt3x, .agdc or .agd file holds");
  auto options = std::make_shared<Options>();
  command->add_option("FILE", options->path, "the recording")->required();
  command->add_flag("--json", options->json, "one JSON document on standard output");
  command->callback([options, &context] {
    const auto findings = repair::has_ending(options->path, ".agd")
                              ? inspect_agd(options->path)
                              : inspect_recording(context.env.files, options->path);
    if (!findings) {
      report_error(context, "inspect", findings.error(), options->json);
      return;
    }
    if (options->json) {
      print_json(context, to_json(*findings, options->path));
    } else {
      print(context.out, *findings, options->path);
    }
    for (const std::string& warning : findings->warnings) {
      context.log().warn("{}: {}", printable(options->path), warning);
    }
    if (findings->problem) {
      report_error(context, "inspect", *findings->problem, false);
    }
  });
}

}  // namespace sixpoint::cli
