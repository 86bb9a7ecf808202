#include "repair/triage/survey.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/text/json_text.h"
#include "gt3x/container/byte_source.h"
#include "gt3x/forms/agdc.h"
#include "gt3x/forms/clock.h"
#include "gt3x/forms/model.h"
#include "gt3x/forms/sample_rate.h"
#include "gt3x/log/samples.h"
#include "gt3x/recording.h"
#include "gt3x/sample_reader.h"

namespace sixpoint::repair {

bool is_repair_mark(const gt3x::Record& record) {
  if (!record.is(gt3x::RecordType::metadata)) {
    return false;
  }
  const auto json = parse_json<nlohmann::json>(as_text(record.payload));
  return json.is_object() && json.value("MetadataType", nlohmann::json()) == kRepairMarkType;
}

Result<bool> carries_repair_mark(gt3x::Recording& recording) {
  if (recording.has_entry(kRepairMark) || !recording.has_log()) {
    return recording.has_entry(kRepairMark);
  }
  SIXPOINT_ASSIGN(auto log, recording.open_log_beginning());
  while (true) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item.has_value()) {
      return false;
    }
    if (item->kind == gt3x::LogItem::Kind::record && item->record.checksum_ok) {
      return is_repair_mark(item->record);
    }
  }
}

Result<gt3x::UnitMemory> unit_memory(gt3x::Recording& recording) {
  SIXPOINT_ASSIGN(const auto source, recording.open_entry("eeprom.bin"));
  SIXPOINT_ASSIGN(const Bytes bytes, gt3x::read_all(*source, 1U << 20U));
  SIXPOINT_ASSIGN(auto memory, gt3x::parse_eeprom(bytes));
  const std::string serial = recording.info().serial();
  if (!memory.serial.empty() && gt3x::unit_serial(memory.serial) != gt3x::unit_serial(serial)) {
    return fail(ErrorCode::bad_data,
                fmt::format("eeprom.bin is of {}, the recording of {}",
                            printable(memory.serial, 16), printable(serial, 16)),
                recording.path(), "download the recording from the unit again");
  }
  return memory;
}

namespace {

void add_firmware(const std::string& firmware, FileFacts& facts) {
  if (facts.firmware.empty()) {
    facts.firmware = firmware;
  } else if (!firmware.empty() && parse_firmware(firmware) != parse_firmware(facts.firmware)) {
    facts.other_firmware = firmware;
  }
}

}  // namespace

FileFacts header_facts(const gt3x::Info& info) {
  FileFacts facts;
  facts.serial = gt3x::unit_serial(info.serial());
  facts.other_serial = gt3x::unit_serial(info.other("Serial Number").value_or(""));
  if (facts.other_serial == facts.serial) {
    facts.other_serial.clear();
  }
  facts.firmware = info.firmware();
  add_firmware(std::string(info.other("Firmware").value_or("")), facts);
  facts.recorded = info.start();
  return facts;
}

void add_facts(const gt3x::Parameters& in_force, FileFacts& facts) {
  facts.calibration_time = in_force.calibration_time;
  add_firmware(in_force.firmware.value_or(""), facts);
}

void add_facts(const gt3x::UnitMemory& memory, FileFacts& facts) {
  facts.calibration_time = memory.calibration_time;
  add_firmware(memory.firmware, facts);
}

namespace {

constexpr double kHum_g = 0.04;  // standard deviation under a climate chamber's fan

bool has_samples(const gt3x::Record& record) {
  // A one-byte payload in place of samples is a USB event.
  return record.payload.size() > 1 &&
         (record.is(gt3x::RecordType::activity) || record.is(gt3x::RecordType::activity2) ||
          record.is(gt3x::RecordType::activity3));
}

}  // namespace

std::optional<StoredConstants> FirstParameters::known_constants() const {
  const bool contradicted =
      record && !record->constants && constants && !record->agrees_with(*constants);
  return contradicted ? std::nullopt : constants;
}

Result<FirstParameters> first_parameters(gt3x::Recording& recording, bool with_constants) {
  SIXPOINT_ASSIGN(auto log, recording.open_log_beginning());
  FirstParameters found;
  bool sampled = false;
  while (!(sampled && found.record && (found.constants || !with_constants))) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item.has_value()) {
      break;
    }
    if (item->kind != gt3x::LogItem::Kind::record || !item->record.checksum_ok) {
      continue;
    }
    if (item->record.is(gt3x::RecordType::parameters)) {
      if (auto parameters = gt3x::parse_parameters(item->record.payload)) {
        if (parameters->constants && !(sampled && found.constants)) {
          found.constants = parameters->constants;
          found.constants_stand_before = !sampled;
        }
        if (found.record && !parameters->firmware) {  // a later record need not repeat it
          parameters->firmware = found.record->firmware;
        }
        if (!(sampled && found.record)) {
          found.record = *std::move(parameters);
          found.record_stands_before = !sampled;
        }
      }
    }
    sampled = sampled || has_samples(item->record);
  }
  return found;
}

Result<FirstParameters> first_parameters(gt3x::Recording& recording,
                                         const gt3x::SampleReader& read) {
  const auto& sets = read.parameter_sets();
  if (sets.empty()) {
    return FirstParameters();
  }
  return first_parameters(recording, std::ranges::any_of(sets, [](const auto& set) {
                            return set->parameters.constants.has_value();
                          }));
}

namespace {

// A small entry of an .agdc file; empty where it is missing or too large.
std::string text_of(gt3x::Recording& recording, const std::string& name) {
  if (!recording.has_entry(name)) {
    return {};
  }
  auto source = recording.open_entry(name);
  if (!source) {
    return {};
  }
  const auto bytes = gt3x::read_all(**source, 1U << 20U);
  return bytes ? std::string(bytes->begin(), bytes->end()) : std::string();
}

std::optional<double> celsius_of(const gt3x::Record& record,
                                 const gt3x::TemperatureCalibration& thermometer) {
  const auto reading = gt3x::parse_temperature(record.payload);
  if (!reading || !reading->accelerometer_adc) {
    return std::nullopt;
  }
  const double celsius = thermometer.accelerometer_c(*reading->accelerometer_adc);
  return std::isfinite(celsius) && std::abs(celsius) < 200 ? std::optional(celsius) : std::nullopt;
}

Error no_constants(std::string what, const std::string& path, std::string hint) {
  return {ErrorCode::bad_data, std::move(what), path, std::move(hint)};
}

// What the scan of the whole recording found.
void take_scan(StillScan& scan, const std::string& path, Survey& result) {
  result.blocks = scan.finish();
  result.plausibility = scan.plausibility();
  result.still_tally = scan.tally();
  if (result.raw_counts && result.agdc) {
    for (calib::StillBlock& block : result.blocks) {
      block.mean_g = result.agdc->apply_to_mean(block.mean_lsb);
    }
  }
  if (result.still_tally.thinned > 1) {
    result.notes.push_back(fmt::format("of {} still periods, {} evenly taken ones were used",
                                       result.still_tally.blocks, result.blocks.size()));
  }
  result.magnitude = magnitude_error(result.blocks);
  result.duration_s = static_cast<double>(result.samples) / result.rate_hz;
  if (result.samples == 0) {
    result.constants_problem =
        no_constants("the recording holds no samples", path,
                     "it can be neither solved nor repaired; download it from the unit again");
  }
}

// activity.bin: samples without records, and constants in the image of the unit's memory.
Status survey_old_form(gt3x::Recording& recording, const calib::StillBlockOptions& options,
                       Survey& result) {
  const auto scale = gt3x::accel_scale_lsb_per_g(recording.info(), nullptr);
  result.accel_scale_known = scale.has_value();
  result.accel_scale_lsb_per_g = scale.value_or(kUsualScale_lsb_per_g);
  result.header_scale_lsb_per_g = result.accel_scale_lsb_per_g;
  SIXPOINT_ASSIGN(auto still,
                  StillScan::make(result.rate_hz, result.accel_scale_lsb_per_g, options));
  if (const auto memory = unit_memory(recording)) {
    add_facts(*memory, result.facts);
    if (auto status = still.set_constants(memory->constants); status) {
      result.constants.push_back(memory->constants);
    } else {
      result.constants_problem = status.error();
    }
  } else {
    result.constants_problem = memory.error();
  }
  gt3x::SampleReader reader(recording);
  while (true) {
    SIXPOINT_ASSIGN(const auto item, reader.next());
    if (!item) {
      break;
    }
    if (item->kind != gt3x::SampleItem::Kind::recorded) {
      still.break_run();
      continue;
    }
    result.samples += item->counts.size();
    result.clipped_samples += static_cast<std::uint64_t>(std::ranges::count_if(
        item->counts, [&](const gt3x::Counts& sample) { return item->clipped(sample); }));
    still.push(item->unix_time, item->counts);
  }
  if (result.constants_problem) {
    result.constants_problem->where = recording.path();
  }
  take_scan(still, recording.path(), result);
  return {};
}

}  // namespace

Result<FileFacts> facts_of(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, path));
  FileFacts facts = header_facts(recording.info());
  if (!recording.has_log()) {
    if (const auto memory = unit_memory(recording)) {
      add_facts(*memory, facts);
    }
  } else {
    SIXPOINT_ASSIGN(const auto first, first_parameters(recording, false));
    if (first.record) {
      add_facts(*first.record, facts);
    }
  }
  return facts;
}

namespace {

// What stands outside the samples.
Result<Survey> begin_survey(gt3x::Recording& recording) {
  Survey result;
  result.facts = header_facts(recording.info());
  result.model = gt3x::model_of(result.facts.serial);
  SIXPOINT_ASSIGN(result.already_repaired, carries_repair_mark(recording));
  SIXPOINT_ASSIGN(result.rate_hz, gt3x::usable_sample_rate_hz(recording.info(), recording.path()));
  return result;
}

Result<Survey> survey_log(gt3x::Recording& recording, const calib::StillBlockOptions& options) {
  SIXPOINT_ASSIGN(auto passing, LogSurvey::begin(recording, options));
  SIXPOINT_ASSIGN(auto log, recording.open_log());
  while (true) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item.has_value()) {
      return passing.finish(log.statistics());
    }
    SIXPOINT_CHECK(passing.take(*item));
  }
}

}  // namespace

class LogSurvey::Pass {
 public:
  Pass(gt3x::Recording& recording, const calib::StillBlockOptions& options, Survey begun)
      : recording_(recording), options_(options), result_(std::move(begun)) {}

  // Finds out the scale, and the constants of the samples before the first PARAMETERS record.
  Status begin() {
    SIXPOINT_ASSIGN(const auto first, first_parameters(recording_, true));
    take_scale(first.record);
    if (first.record) {
      add_facts(*first.record, result_.facts);
    }
    scale_lsb_per_g_ = result_.header_scale_lsb_per_g;
    rotated_ = triage(result_.facts).axes_rotated && !result_.already_repaired;
    SIXPOINT_ASSIGN(still_, make_scan(result_.header_scale_lsb_per_g, options_));
    if (first.constants) {
      use_constants(*first.constants);
    }
    return {};
  }

  void on_block(StillScan::OnBlock tell) { still_->on_block(std::move(tell)); }

  Status take(const gt3x::LogItem& item) {
    result_.log_bytes += item.raw.size();
    result_.log_bytes_wide += item.raw.size();
    if (item.kind == gt3x::LogItem::Kind::record && item.record.checksum_ok) {
      return take_good(item.record);
    }
    if (item.kind != gt3x::LogItem::Kind::stray) {
      // Zero bytes between records are legal and end no run.
      still_->break_run();
      break_raw_run();
    }
    return {};
  }

  std::uint64_t samples() const { return result_.samples; }

  Survey finish(const gt3x::LogStatistics& log) {
    result_.log = log;
    end();
    return std::move(result_);
  }

 private:
  void take_scale(const std::optional<gt3x::Parameters>& first) {
    std::optional<double> scale = first ? first->accel_scale_lsb_per_g : std::nullopt;
    if (!scale) {
      scale = recording_.info().accel_scale_lsb_per_g();
    }
    if (!scale) {
      scale = gt3x::default_accel_scale_lsb_per_g(result_.facts.serial);
    }
    result_.accel_scale_known = scale.has_value();
    result_.accel_scale_lsb_per_g = scale.value_or(kUsualScale_lsb_per_g);
    result_.header_scale_lsb_per_g = gt3x::accel_scale_lsb_per_g(recording_.info(), nullptr)
                                         .value_or(result_.accel_scale_lsb_per_g);
    const auto replaced = [&](const char* where, const std::string& value) {
      result_.notes.push_back(
          fmt::format("{} gives an acceleration scale of {}, which no unit has: {} LSB/g was used",
                      where, value, result_.accel_scale_lsb_per_g));
    };
    const auto written = recording_.info().get("Acceleration Scale");
    if (written && !recording_.info().accel_scale_lsb_per_g()) {
      replaced("info.txt", fmt::format("'{}'", printable(*written, 20)));
    }
    if (first && first->doubled.contains(gt3x::kParameterAccelScale)) {
      result_.notes.push_back(
          fmt::format("PARAMETERS give two acceleration scales: {} LSB/g was used",
                      result_.accel_scale_lsb_per_g));
    } else if (first && !first->accel_scale_lsb_per_g) {
      const auto code = first->values.find(gt3x::kParameterAccelScale);
      if (code != first->values.end()) {
        replaced("PARAMETERS", fmt::format("{:g}", gt3x::decode_float(code->second)));
      }
    }
  }

  Result<StillScan> make_scan(double scale_lsb_per_g, const calib::StillBlockOptions& options) {
    return StillScan::make(result_.rate_hz, scale_lsb_per_g, options);
  }

  void use_constants(const StoredConstants& constants) {
    // A repaired file's counts come from other constants than its PARAMETERS say.
    if (result_.already_repaired) {
      return;
    }
    in_force_ = constants;
    if (auto status = still_->set_constants(constants); !status) {
      result_.constants_problem = status.error();
      result_.constants_problem->where = recording_.path();
    }
    if (std::ranges::find(result_.constants, constants) == result_.constants.end() &&
        result_.constants.size() <= kMaxSetsOfConstants) {
      result_.constants.push_back(constants);
    }
  }

  // The table of Survey::constants.
  void use_constants_of(const gt3x::Parameters& parameters) {
    if (parameters.constants) {
      use_constants(*parameters.constants);
      is_complete_ = true;
    }
    contradicted_ = !parameters.constants && in_force_ && !parameters.agrees_with(*in_force_);
  }

  void check_constants_of_samples() {
    if (contradicted_ && !result_.constants_problem) {
      result_.constants_problem = no_constants(
          "a PARAMETERS record has some of the nine constants only, and other ones than the "
          "complete "
          "record: which constants its samples were made by is not known",
          recording_.path(), "download the recording from the unit again");
    }
    if (in_force_ && !is_complete_) {
      samples_before_constants_ += samples_.size();
    }
  }

  void use_scale(const gt3x::Parameters& parameters) {
    const double scale_lsb_per_g =
        parameters.accel_scale_lsb_per_g.value_or(result_.header_scale_lsb_per_g);
    if (auto status = still_->set_scale(scale_lsb_per_g); !status) {
      result_.constants_problem = status.error();
      result_.constants_problem->where = recording_.path();
    }
    constexpr std::size_t kMostNotes = 20;
    if (result_.samples > 0 && scale_lsb_per_g != scale_lsb_per_g_ &&
        result_.notes.size() < kMostNotes) {
      result_.notes.push_back(
          fmt::format("the acceleration scale changes within the recording, from {} to {} LSB/g",
                      scale_lsb_per_g_, scale_lsb_per_g));
    }
    scale_lsb_per_g_ = scale_lsb_per_g;
  }

  // A date, or a firmware, behind the first samples that leads to another answer.
  void use_later_facts(const gt3x::Parameters& parameters) {
    if (result_.samples == 0) {
      return;
    }
    FileFacts other = result_.facts;
    other.calibration_time = parameters.calibration_time;
    if (date_of_constants(other) && result_.facts.calibration_time &&
        triage(other).verdict != triage(result_.facts).verdict) {
      result_.facts.other_calibration_time = parameters.calibration_time;
    }
    other = result_.facts;
    other.firmware = parameters.firmware.value_or("");
    if (!other.firmware.empty() && result_.facts.other_firmware.empty() &&
        !leads_to_same_answers(other, result_.facts)) {
      result_.facts.other_firmware = other.firmware;
    }
  }

  static bool leads_to_same_answers(const FileFacts& one, const FileFacts& other) {
    const Triage of_one = triage(one);
    const Triage of_other = triage(other);
    return of_one.verdict == of_other.verdict && of_one.axes_rotated == of_other.axes_rotated &&
           filter_in_force(one) == filter_in_force(other);
  }

  Status take_good(const gt3x::Record& record) {
    if (record.is(gt3x::RecordType::parameters)) {
      if (const auto parameters = gt3x::parse_parameters(record.payload)) {
        use_scale(*parameters);
        use_constants_of(*parameters);
        use_later_facts(*parameters);
      }
    } else if (record.is(gt3x::RecordType::activity) || record.is(gt3x::RecordType::activity2)) {
      if (has_samples(record)) {
        take_samples(record);
      } else {
        still_->break_run();
      }
    } else if (record.is(gt3x::RecordType::activity3)) {
      if (has_samples(record)) {
        return take_raw_samples(record);
      }
      break_raw_run();
    } else if (record.is(gt3x::RecordType::temperature) && thermometer_ && raw_still_) {
      const auto celsius = celsius_of(record, *thermometer_);
      raw_still_->set_temperature(celsius);
      raw_resting_->set_temperature(celsius);
    } else if (record.is(gt3x::RecordType::event) && record.payload.size() == 1) {
      still_->break_run();  // idle sleep
    }
    return {};
  }

  void take_samples(const gt3x::Record& record) {
    if (record.is(gt3x::RecordType::activity)) {
      gt3x::unpack_activity(record.payload, samples_);
      // Packed anew, in as many records as it takes (RescaledLog).
      const std::size_t records = (samples_.size() + kMaxWideSamples - 1) / kMaxWideSamples;
      result_.log_bytes_wide += samples_.size() * sizeof(gt3x::Counts) +
                                records * gt3x::kRecordOverhead - record.raw.size();
    } else {
      gt3x::unpack_activity2(record.payload, samples_);
    }
    ++result_.sample_records;
    result_.samples += samples_.size();
    check_constants_of_samples();
    if (const auto all = gt3x::range_of(samples_);
        all.low <= gt3x::kMin12 || all.high >= gt3x::kMax12) {
      result_.beyond_12_bits =
          result_.beyond_12_bits || all.low < gt3x::kMin12 || all.high > gt3x::kMax12;
      result_.clipped_samples += static_cast<std::uint64_t>(
          std::ranges::count_if(samples_, [](const gt3x::Counts& sample) {
            const auto [low, high] = std::ranges::minmax(sample);
            return low <= gt3x::kMin12 || high >= gt3x::kMax12;
          }));
    }
    if (rotated_) {
      undo_rotation(samples_, record.is(gt3x::RecordType::activity) ? calib::RecordWidth::bits12
                                                                    : calib::RecordWidth::bits16);
    }
    still_->push(record.unix_time, samples_);
  }

  Status take_raw_samples(const gt3x::Record& record) {
    if (!raw_still_) {
      if (auto agdc = gt3x::agdc_calibration(recording_, result_.rate_hz)) {
        result_.agdc = *std::move(agdc);
      }
      result_.raw_counts = !result_.agdc || !result_.agdc->already_applied;
      const double scale_lsb_per_g = result_.raw_counts ? kUsualScale_lsb_per_g : scale_lsb_per_g_;
      const auto parsed =
          gt3x::parse_temperature_calibration(text_of(recording_, "temperature_calibration.json"));
      thermometer_ = parsed ? std::optional(*parsed) : std::nullopt;
      calib::StillBlockOptions humming = options_;
      humming.noisy_sd_g = kHum_g;
      SIXPOINT_ASSIGN(raw_still_, make_scan(scale_lsb_per_g, options_));
      SIXPOINT_ASSIGN(raw_resting_, make_scan(scale_lsb_per_g, humming));
    }
    gt3x::unpack_activity3(record.payload, samples_);
    result_.samples += samples_.size();
    raw_still_->push(record.unix_time, samples_);
    raw_resting_->push(record.unix_time, samples_);
    return {};
  }

  void break_raw_run() {
    if (raw_still_) {
      raw_still_->break_run();
      raw_resting_->break_run();
    }
  }

  void end() {
    StillScan& scan = raw_still_ ? *raw_still_ : *still_;
    take_scan(scan, recording_.path(), result_);
    if (samples_before_constants_ > 0) {
      result_.notes.push_back(fmt::format(
          "the first {} samples stand before all complete PARAMETERS: they are taken to have been "
          "made by the constants of the first ones behind them",
          samples_before_constants_));
    }
    if (raw_resting_) {
      result_.resting = raw_resting_->finish();
    }
    if (result_.samples == 0) {
      return;
    }
    if (result_.raw_counts) {
      result_.constants_problem = no_constants(
          result_.agdc ? "the recording holds raw counts, which no constants have been applied to"
                       : "the recording holds raw counts and no calibration.json that fits them",
          recording_.path(), "it needs no repair");
    } else if (result_.agdc) {
      result_.constants_problem = no_constants(
          "its samples were calibrated before they were written (calibration.json): what the "
          "sensor "
          "counted is not known",
          recording_.path(), "solve a recording of raw counts of this unit");
    } else if (result_.constants.empty() && !result_.already_repaired) {
      result_.constants_problem = no_constants(
          "the recording holds no complete set of constants (PARAMETERS)", recording_.path(),
          "without them the scaling cannot be undone; download the recording from the unit again");
    }
  }

  gt3x::Recording& recording_;
  calib::StillBlockOptions options_;
  Survey result_;
  bool rotated_ = false;
  double scale_lsb_per_g_ = 0;  // in force
  std::optional<StoredConstants> in_force_;
  bool is_complete_ = false;   // a record with all nine stood before
  bool contradicted_ = false;  // the last record has some of them, and not those in force
  std::uint64_t samples_before_constants_ = 0;
  std::optional<StillScan> still_;
  std::optional<StillScan> raw_still_;  // of ACTIVITY3 (.agdc)
  std::optional<StillScan> raw_resting_;
  std::optional<gt3x::TemperatureCalibration> thermometer_;
  std::vector<gt3x::Counts> samples_;
};

LogSurvey::LogSurvey(std::unique_ptr<Pass> pass) : pass_(std::move(pass)) {}
LogSurvey::LogSurvey(LogSurvey&&) noexcept = default;
LogSurvey& LogSurvey::operator=(LogSurvey&&) noexcept = default;
LogSurvey::~LogSurvey() = default;

Result<LogSurvey> LogSurvey::begin(gt3x::Recording& recording,
                                   const calib::StillBlockOptions& options) {
  SIXPOINT_ASSIGN(auto begun, begin_survey(recording));
  auto pass = std::make_unique<Pass>(recording, options, std::move(begun));
  SIXPOINT_CHECK(pass->begin());
  return LogSurvey(std::move(pass));
}

void LogSurvey::on_block(StillScan::OnBlock tell) { pass_->on_block(std::move(tell)); }
Status LogSurvey::take(const gt3x::LogItem& item) { return pass_->take(item); }
Survey LogSurvey::finish(const gt3x::LogStatistics& log) { return pass_->finish(log); }

Result<Survey> survey_beginning(gt3x::Recording& recording, const calib::StillBlockOptions& options,
                                std::uint64_t samples) {
  SIXPOINT_ASSIGN(auto passing, LogSurvey::begin(recording, options));
  SIXPOINT_ASSIGN(auto log, recording.open_log_beginning());
  while (passing.pass_->samples() < samples) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item.has_value()) {
      break;
    }
    SIXPOINT_CHECK(passing.take(*item));
  }
  return passing.finish(log.statistics());
}

Result<Survey> survey(FileSystem& files, const std::string& path,
                      const calib::StillBlockOptions& options, const gt3x::RecordingOptions& how) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, path, how));
  Survey result;
  if (recording.has_log()) {
    SIXPOINT_ASSIGN(result, survey_log(recording, options));
  } else {
    SIXPOINT_ASSIGN(result, begin_survey(recording));
    SIXPOINT_CHECK(survey_old_form(recording, options, result));
  }
  if (how.salvage) {
    SIXPOINT_ASSIGN(result.losses, gt3x::salvage_losses(recording, result.log));
  }
  return result;
}

nlohmann::ordered_json losses_to_json(const std::vector<gt3x::SalvageLoss>& losses) {
  using Json = nlohmann::ordered_json;
  const auto time = [](std::optional<std::uint32_t> unix_time) {
    return unix_time ? Json(gt3x::clock_time({}, *unix_time)) : Json(nullptr);
  };
  Json list = Json::array();
  for (const gt3x::SalvageLoss& loss : losses) {
    list.push_back({{"kind", gt3x::to_string(loss.kind)},
                    {"entry", loss.entry.empty() ? Json(nullptr) : Json(loss.entry)},
                    {"from", time(loss.from)},
                    {"to", time(loss.to)},
                    {"why", loss.why}});
  }
  return list;
}

}  // namespace sixpoint::repair
