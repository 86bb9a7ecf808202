#include "gap/unguided/rests.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "gap/unguided/block_line.h"
#include "gt3x/forms/agdc.h"
#include "gt3x/forms/parameters.h"
#include "gt3x/forms/sample_rate.h"
#include "gt3x/recording.h"
#include "gt3x/sample_reader.h"

namespace sixpoint::gap {
namespace {

constexpr double kRestBlock_s = 4;            // paper, Step 2
constexpr double kSlope_g_per_sample = 5e-4;  // paper, Step 2
constexpr double kNoise_g = 0.009;            // of the noisiest axis, rounding included
constexpr double kHum_g = 0.04;               // the fan of a climate chamber
constexpr std::size_t kMostRests = 200'000;   // bounds the memory
constexpr double kActivity3_lsb_per_g = 256;  // nominal, without calibration.json
constexpr int kTemperatureRecord = 30;        // of .agdc

// Cuts a stream of samples into blocks and collects those at rest.
class RestFinder {
 public:
  explicit RestFinder(double rate_hz)
      : length_(static_cast<std::size_t>(std::max(20.0, std::round(kRestBlock_s * rate_hz)))) {}

  void push(double time_s, const Eigen::Vector3d& g, std::optional<double> temperature_c) {
    if (run_.empty()) {
      start_s_ = time_s;
    }
    run_.push_back(g);
    if (run_.size() == length_) {
      end_block(temperature_c);
      run_.clear();
    }
  }
  void break_run() { run_.clear(); }
  std::vector<Rest> take() { return std::move(rests_); }

 private:
  void end_block(std::optional<double> temperature_c) {
    const BlockLine line = line_through(run_);
    const bool zero =
        std::ranges::all_of(run_, [](const Eigen::Vector3d& g) { return g.isZero(); });
    const Eigen::Vector3d variance = line.square / static_cast<double>(length_);
    const bool one_value = variance.isZero();  // repeated: no measurement
    const double noise_g = std::sqrt(variance.maxCoeff());
    if (!zero && !one_value && line.slope.cwiseAbs().maxCoeff() < kSlope_g_per_sample &&
        noise_g < kHum_g && rests_.size() < kMostRests) {
      rests_.push_back({start_s_, line.mean, temperature_c, noise_g < kNoise_g});
    }
  }

  std::size_t length_;
  double start_s_ = 0;
  std::vector<Eigen::Vector3d> run_;
  std::vector<Rest> rests_;
};

// A small entry of the zip; nothing where there is none.
Result<std::optional<std::string>> entry_text(gt3x::Recording& recording, const std::string& name) {
  if (!recording.has_entry(name)) {
    return std::optional<std::string>();
  }
  SIXPOINT_ASSIGN(auto source, recording.open_entry(name));
  std::string text;
  std::array<std::uint8_t, 4096> piece{};
  for (;;) {
    SIXPOINT_ASSIGN(const std::size_t n, source->read(piece));
    if (n == 0) {
      return std::optional(std::move(text));
    }
    text.append(reinterpret_cast<const char*>(piece.data()), n);
    if (text.size() > (1U << 20U)) {
      return fail(ErrorCode::bad_data, "an entry that should be small is not", name,
                  "download the recording again");
    }
  }
}

class RestReader {
 public:
  RestReader(gt3x::Recording& recording, double rate_hz)
      : recording_(recording),
        finder_(rate_hz),
        scale_(gt3x::accel_scale_lsb_per_g(recording.info(), nullptr).value_or(256)) {
    out_.serial = recording.info().serial();
    out_.firmware = recording.info().firmware();
  }

  Status read_calibrations(int rate_hz) {
    SIXPOINT_ASSIGN(const auto sensor, entry_text(recording_, "calibration.json"));
    if (sensor) {
      if (auto calibration = gt3x::parse_agdc_calibration(*sensor, rate_hz)) {
        agdc_ = *calibration;
        raw_counts_ = !calibration->already_applied;
      }
    }
    SIXPOINT_ASSIGN(const auto thermometer, entry_text(recording_, "temperature_calibration.json"));
    if (thermometer) {
      if (auto calibration = gt3x::parse_temperature_calibration(*thermometer)) {
        thermometer_ = *calibration;
      }
    }
    return {};
  }

  Result<RecordingRests> read_log() {
    SIXPOINT_ASSIGN(auto log, recording_.open_log());
    for (;;) {
      SIXPOINT_ASSIGN(const auto item, log.next());
      if (!item) {
        break;
      }
      if (item->kind == gt3x::LogItem::Kind::record && item->record.checksum_ok) {
        take(item->record);
      } else if (item->kind != gt3x::LogItem::Kind::stray) {
        finder_.break_run();
      }
    }
    out_.rests = finder_.take();
    return std::move(out_);
  }

 private:
  void take(const gt3x::Record& record) {
    if (record.is(gt3x::RecordType::parameters)) {
      take_parameters(record);
    } else if (static_cast<int>(record.type) == kTemperatureRecord) {
      take_temperature(record);
    } else if (record.payload.size() <= 1) {
      finder_.break_run();
    } else if (record.is(gt3x::RecordType::activity)) {
      gt3x::unpack_activity(record.payload, samples_);
      take_samples(record, false);
    } else if (record.is(gt3x::RecordType::activity2)) {
      gt3x::unpack_activity2(record.payload, samples_);
      take_samples(record, false);
    } else if (record.is(gt3x::RecordType::activity3)) {
      gt3x::unpack_activity3(record.payload, samples_);
      take_samples(record, true);
    }
  }

  void take_parameters(const gt3x::Record& record) {
    if (const auto parsed = gt3x::parse_parameters(record.payload)) {
      if (!out_.calibration_time) {
        out_.calibration_time = parsed->calibration_time;
      }
      scale_ = gt3x::accel_scale_lsb_per_g(recording_.info(), &*parsed).value_or(scale_);
    }
  }

  // The accelerometer's own thermometer, once there is one; else the processor's.
  void take_temperature(const gt3x::Record& record) {
    const auto reading = gt3x::parse_temperature(record.payload);
    if (!reading || !thermometer_) {
      return;
    }
    if (reading->accelerometer_adc) {
      temperature_c_ = thermometer_->accelerometer_c(*reading->accelerometer_adc);
      own_thermometer_ = true;
    } else if (reading->processor_adc && !own_thermometer_) {
      temperature_c_ = thermometer_->processor_c(*reading->processor_adc);
    }
  }

  void take_samples(const gt3x::Record& record, bool raw) {
    if (last_ && record.unix_time != *last_ + 1) {
      finder_.break_run();
    }
    last_ = record.unix_time;
    const double step_s = samples_.empty() ? 0 : 1.0 / static_cast<double>(samples_.size());
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const gt3x::Counts& counts = samples_[i];
      Eigen::Vector3d g;
      if (raw && raw_counts_ && agdc_) {
        const PerAxis<double> applied = agdc_->apply(counts);
        g = Eigen::Vector3d(applied[0], applied[1], applied[2]);
      } else {
        g = Eigen::Vector3d(counts[0], counts[1], counts[2]) /
            (raw && raw_counts_ ? kActivity3_lsb_per_g : scale_);
      }
      finder_.push(static_cast<double>(record.unix_time) + static_cast<double>(i) * step_s, g,
                   temperature_c_);
    }
  }

  gt3x::Recording& recording_;
  RestFinder finder_;
  RecordingRests out_;
  std::optional<gt3x::AgdcCalibration> agdc_;
  bool raw_counts_ = true;  // of ACTIVITY3 records; false: already in g times the file's scale
  std::optional<gt3x::TemperatureCalibration> thermometer_;
  double scale_;
  std::optional<double> temperature_c_;
  bool own_thermometer_ = false;
  std::optional<std::uint32_t> last_;
  std::vector<gt3x::Counts> samples_;
};

}  // namespace

Result<RecordingRests> read_rests(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, path));
  SIXPOINT_ASSIGN(const double rate_hz, gt3x::usable_sample_rate_hz(recording.info(), path, 1000));
  RestReader reader(recording, rate_hz);
  SIXPOINT_CHECK(reader.read_calibrations(static_cast<int>(rate_hz)));
  return reader.read_log();
}

}  // namespace sixpoint::gap
