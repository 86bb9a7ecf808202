#include "repair/survey.h"

#include <algorithm>

#include <fmt/format.h>

#include "gt3x/agdc.h"
#include "gt3x/byte_source.h"
#include "gt3x/model.h"
#include "gt3x/parameters.h"
#include "gt3x/recording.h"
#include "gt3x/samples.h"

namespace sixpoint::repair {
namespace {

constexpr double kUsualScale_lsb_per_g = 256;
constexpr double kHum_g = 0.04;  // standard deviation under a climate chamber's fan

bool at_limit(const gt3x::Counts& sample) {
  return std::any_of(sample.begin(), sample.end(), [](std::int16_t count) {
    return count <= gt3x::kMin12 || count >= gt3x::kMax12;
  });
}

bool is_samples(const gt3x::Record& record) {
  // A one-byte payload is a USB event, not data.
  return (record.is(gt3x::RecordType::activity) || record.is(gt3x::RecordType::activity2)) &&
         record.payload.size() > 1;
}

void take_parameters(const gt3x::Parameters& parameters, FileFacts& facts) {
  if (!facts.calibration_time.has_value()) {
    facts.calibration_time = parameters.calibration_time;
  }
  if (facts.firmware.empty() && parameters.firmware.has_value()) {
    facts.firmware = *parameters.firmware;
  }
}

// The first PARAMETERS record of the log whose checksum holds; nothing when there is none.
Result<std::optional<gt3x::Parameters>> first_parameters(gt3x::Recording& recording) {
  SIXPOINT_ASSIGN(auto log, recording.open_log());
  while (true) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item.has_value()) {
      return std::nullopt;
    }
    if (item->kind == gt3x::LogItem::Kind::record && item->record.checksum_ok &&
        item->record.is(gt3x::RecordType::parameters)) {
      if (auto parameters = gt3x::parse_parameters(item->record.payload)) {
        return *std::move(parameters);
      }
    }
  }
}

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

// What an .agdc file says about its raw counts.
std::optional<calib::Calibration> raw_calibration_of(gt3x::Recording& recording, double rate_hz) {
  const auto calibration = gt3x::parse_agdc_calibration(text_of(recording, "calibration.json"),
                                                        static_cast<int>(rate_hz));
  if (!calibration || calibration->already_applied) {
    return std::nullopt;
  }
  if (calibration->constants) {
    if (const auto six_point = calib::calibration_from(*calibration->constants)) {
      return *six_point;
    }
  }
  calib::Calibration out;
  for (std::size_t a = 0; a < kAxes; ++a) {
    out.sensitivity_g_per_lsb[a] = calibration->sensitivity_g_per_lsb[a][a];
    out.zero_lsb[a] = calibration->offset_lsb[a];
  }
  return calib::validate(out) ? std::optional(out) : std::nullopt;
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

FileFacts facts_of(const gt3x::Info& info) {
  return FileFacts{info.serial(), info.firmware(), std::nullopt};
}

}  // namespace

Result<Survey> survey(FileSystem& files, const std::string& path,
                      const calib::StillBlockOptions& options) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, path));
  Survey result;
  result.facts = facts_of(recording.info());
  result.model = gt3x::model_of(result.facts.serial);
  result.already_repaired = recording.has_entry(kRepairMark);
  result.rate_hz = recording.info().sample_rate_hz().value_or(0);
  if (!recording.has_log()) {
    result.constants_problem =
        Error{ErrorCode::bad_data,
              "the recording has the old form (activity.bin), which holds no constants", path,
              "only recordings with a log.bin can be worked on"};
    return result;
  }
  if (result.rate_hz <= 0) {
    return fail(ErrorCode::bad_data, "info.txt gives no sample rate above 0", path,
                "download the recording from the unit again");
  }

  SIXPOINT_ASSIGN(const auto first, first_parameters(recording));
  std::optional<double> scale = first ? first->accel_scale_lsb_per_g : std::nullopt;
  if (!scale) {
    scale = recording.info().accel_scale_lsb_per_g();
  }
  if (!scale) {
    scale = gt3x::default_accel_scale_lsb_per_g(result.facts.serial);
  }
  result.accel_scale_known = scale.has_value();
  result.accel_scale_lsb_per_g = scale.value_or(kUsualScale_lsb_per_g);
  if (first.has_value()) {
    take_parameters(*first, result.facts);
  }
  const bool rotated = triage(result.facts).axes_rotated && !result.already_repaired;

  SIXPOINT_ASSIGN(auto still,
                  StillScan::make(result.rate_hz, result.accel_scale_lsb_per_g, options));
  const auto use_constants = [&](const gt3x::Parameters& parameters) {
    // A mended file's counts come from other constants than its PARAMETERS say.
    if (!parameters.constants.has_value() || result.already_repaired) {
      return;
    }
    if (auto status = still.set_constants(*parameters.constants); !status) {
      result.constants_problem = status.error();
      result.constants_problem->where = path;
    }
    if (std::find(result.constants.begin(), result.constants.end(), *parameters.constants) ==
        result.constants.end()) {
      result.constants.push_back(*parameters.constants);
    }
  };
  // Samples before the first PARAMETERS record are taken to be scaled by it.
  if (first.has_value()) {
    use_constants(*first);
  }

  std::optional<gt3x::TemperatureCalibration> thermometer;
  if (auto parsed =
          gt3x::parse_temperature_calibration(text_of(recording, "temperature_calibration.json"))) {
    thermometer = *parsed;
  }
  std::optional<StillScan> raw_still;
  std::optional<StillScan> raw_resting;
  calib::StillBlockOptions humming = options;
  humming.noisy_sd_g = kHum_g;
  SIXPOINT_ASSIGN(auto log, recording.open_log());
  std::vector<gt3x::Counts> samples;
  while (true) {
    SIXPOINT_ASSIGN(const auto item, log.next());
    if (!item.has_value()) {
      break;
    }
    result.log_bytes += item->raw.size();
    result.log_bytes_wide += item->raw.size();
    if (item->kind != gt3x::LogItem::Kind::record || !item->record.checksum_ok) {
      // Zero bytes between records are legal and part nothing.
      if (item->kind != gt3x::LogItem::Kind::stray) {
        still.break_run();
        if (raw_still) {
          raw_still->break_run();
          raw_resting->break_run();
        }
      }
      continue;
    }
    const gt3x::Record& record = item->record;
    if (record.is(gt3x::RecordType::parameters)) {
      if (const auto parameters = gt3x::parse_parameters(record.payload)) {
        use_constants(*parameters);
      }
    } else if (is_samples(record)) {
      if (record.is(gt3x::RecordType::activity)) {
        gt3x::unpack_activity(record.payload, samples);
        result.log_bytes_wide += samples.size() * sizeof(gt3x::Counts) - record.payload.size();
      } else {
        gt3x::unpack_activity2(record.payload, samples);
      }
      ++result.sample_records;
      result.samples += samples.size();
      for (const gt3x::Counts& sample : samples) {
        result.clipped_samples += at_limit(sample) ? 1 : 0;
        for (const std::int16_t count : sample) {
          result.beyond_12_bits =
              result.beyond_12_bits || count < gt3x::kMin12 || count > gt3x::kMax12;
        }
      }
      if (rotated) {
        undo_rotation(samples);
      }
      still.push(record.unix_time, samples);
    } else if (record.is(gt3x::RecordType::activity3) && record.payload.size() > 1) {
      if (!raw_still) {
        result.raw_counts = true;
        result.raw_calibration = raw_calibration_of(recording, result.rate_hz);
        SIXPOINT_ASSIGN(raw_still, StillScan::make(result.rate_hz, kUsualScale_lsb_per_g, options));
        SIXPOINT_ASSIGN(raw_resting,
                        StillScan::make(result.rate_hz, kUsualScale_lsb_per_g, humming));
      }
      gt3x::unpack_activity3(record.payload, samples);
      result.samples += samples.size();
      raw_still->push(record.unix_time, samples);
      raw_resting->push(record.unix_time, samples);
    } else if (record.is(gt3x::RecordType::temperature)) {
      if (thermometer && raw_still) {
        const auto celsius = celsius_of(record, *thermometer);
        raw_still->set_temperature(celsius);
        raw_resting->set_temperature(celsius);
      }
    } else if (record.is(gt3x::RecordType::activity3)) {
      if (raw_still) {
        raw_still->break_run();  // USB
        raw_resting->break_run();
      }
    } else if (record.is(gt3x::RecordType::activity) || record.is(gt3x::RecordType::activity2) ||
               (record.is(gt3x::RecordType::event) && record.payload.size() == 1)) {
      still.break_run();  // USB, idle sleep
    }
  }
  result.log = log.statistics();
  result.blocks = still.finish();
  result.plausibility = still.plausibility();
  result.still_tally = still.tally();
  if (raw_still) {
    result.blocks = raw_still->finish();
    result.resting = raw_resting->finish();
    result.plausibility = raw_still->plausibility();
    result.still_tally = raw_still->tally();
    for (calib::StillBlock& block : result.blocks) {
      if (result.raw_calibration) {
        block.mean_g = result.raw_calibration->to_g(block.mean_lsb);
      }
    }
  }
  result.magnitude = magnitude_error(result.blocks);
  result.duration_s = static_cast<double>(result.samples) / result.rate_hz;
  if (result.samples == 0) {
    result.constants_problem =
        Error{ErrorCode::bad_data, "the recording holds no samples", path,
              "nothing can be learnt from it or mended; download it from the unit again"};
  } else if (result.raw_counts) {
    result.constants_problem =
        Error{ErrorCode::bad_data,
              result.raw_calibration
                  ? "the recording holds raw counts, which no constants have been applied to"
                  : "the recording holds raw counts and no calibration.json that fits them",
              path, "nothing has to be mended in it"};
  } else if (result.constants.empty() && !result.already_repaired) {
    result.constants_problem = Error{
        ErrorCode::bad_data, "the recording holds no complete set of constants (PARAMETERS)", path,
        "without them the scaling cannot be undone; download the recording from the unit again"};
  }
  return result;
}

}  // namespace sixpoint::repair
