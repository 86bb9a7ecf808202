// Recordings made for the tests of repair, by code of their own: the firmware's rule is written out
// here once more, so that nothing under test vouches for itself.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "base/env.h"
#include "base/stored_constants.h"
#include "gt3x/forms/info.h"
#include "gt3x/forms/parameters.h"
#include "gt3x/log/record.h"
#include "gt3x/log/samples.h"
#include "gt3x/recording.h"
#include "gt3x/recording_writer.h"

namespace sixpoint::tests {

// As read in the affected unit MOS2A45130450.
inline constexpr StoredConstants kStored = {{326, 287, 303}, {-201, -268, -192}, {61, 4, 61}};

struct MadeRecording {
  std::string serial = "MOS2A45130450";
  std::string firmware = "1.5.0";
  std::int64_t calibrated = 1'384'266'733;  // 2013-11-12
  StoredConstants constants = kStored;
  unsigned rate_hz = 30;
  std::uint32_t start = 1'428'588'240;  // 2015-04-09
  bool info_says_start = false;
  bool activity2 = false;
  // Raw counts of the sensor, one entry per sample.
  std::vector<PerAxis<int>> raw;
  // Bytes put between records before second i.
  std::function<Bytes(std::size_t second)> between = [](std::size_t) { return Bytes{}; };

  // Eq. 1-6 and the firmware's rounding and clipping, in that order.
  static gt3x::Counts store(const StoredConstants& c, const PerAxis<int>& m, bool turned) {
    std::array<double, 3> g{};
    for (std::size_t a = 0; a < 3; ++a) {
      g[a] = 2.0 * (m[a] - c.zero_lsb[a]) / (c.positive_lsb[a] - c.negative_lsb[a]);
    }
    if (turned) {
      g = {-g[1], g[0], g[2]};
    }
    gt3x::Counts counts{};
    for (std::size_t a = 0; a < 3; ++a) {
      const double rounded = std::round(g[a] * 256);
      counts[a] = static_cast<std::int16_t>(std::fmax(-2048, std::fmin(2047, rounded)));
    }
    return counts;
  }

  std::vector<gt3x::Counts> stored() const {
    std::vector<gt3x::Counts> counts;
    for (const auto& m : raw) {
      counts.push_back(store(constants, m, firmware == "1.6.0"));
    }
    return counts;
  }

  Bytes parameters() const {
    gt3x::ParameterValues values;
    gt3x::set_constants(values, constants);
    values[gt3x::kParameterCalibrationTime] = static_cast<std::uint32_t>(calibrated);
    values[gt3x::kParameterAccelScale] = gt3x::encode_float(256);
    return gt3x::encode_parameters(values);
  }

  Bytes log() const {
    Bytes bytes;
    gt3x::append_record(bytes, gt3x::RecordType::parameters, start - 1, parameters());
    const std::vector<gt3x::Counts> all = stored();
    for (std::size_t second = 0; second * rate_hz < all.size(); ++second) {
      const Bytes extra = between(second);
      bytes.insert(bytes.end(), extra.begin(), extra.end());
      const auto samples = std::span(all).subspan(
          second * rate_hz, std::min<std::size_t>(rate_hz, all.size() - second * rate_hz));
      Bytes payload;
      if (activity2) {
        gt3x::append_activity2(payload, samples);
      } else {
        gt3x::append_activity(payload, samples);
      }
      const auto time = start + static_cast<std::uint32_t>(second);
      gt3x::append_record(bytes,
                          activity2 ? gt3x::RecordType::activity2 : gt3x::RecordType::activity,
                          time, payload);
      if (second % 10 == 0) {
        gt3x::append_record(bytes, gt3x::RecordType::battery, time, Bytes{0x10, 0x10});
      }
    }
    return bytes;
  }

  Status write(FileSystem& files, const std::string& path) const {
    return write(files, path, log());
  }

  Status write(FileSystem& files, const std::string& path, Bytes log_bytes) const {
    gt3x::Info info;
    info.set("Serial Number", serial);
    info.set("Firmware", firmware);
    info.set("Sample Rate", std::to_string(rate_hz));
    if (info_says_start) {  // ticks of 100 ns since the year 1
      info.set("Start Date", std::to_string((std::int64_t{start} + 62'135'596'800) * 10'000'000));
    }
    SIXPOINT_ASSIGN(auto writer, gt3x::RecordingWriter::create(files, path));
    SIXPOINT_CHECK(writer.add("log.bin", std::move(log_bytes)));
    SIXPOINT_CHECK(writer.add("info.txt", info.serialise()));
    SIXPOINT_CHECK(writer.add("extra.bin", Bytes{1, 2, 3}));
    return writer.commit();
  }
};

// The log of `made` (12 bits, no noise between the records), whose second half comes at twice the
// acceleration scale, which PARAMETERS before it say.
inline Bytes log_of_two_scales(const MadeRecording& made) {
  Bytes bytes;
  const std::size_t half = made.raw.size() / made.rate_hz / 2 * made.rate_hz;
  for (const double scale : {256.0, 512.0}) {
    gt3x::ParameterValues values;
    gt3x::set_constants(values, made.constants);
    values[gt3x::kParameterCalibrationTime] = static_cast<std::uint32_t>(made.calibrated);
    values[gt3x::kParameterAccelScale] = gt3x::encode_float(scale);
    const std::size_t begin = scale < 512 ? 0 : half;
    const std::size_t end = scale < 512 ? half : made.raw.size();
    const auto time = made.start + static_cast<std::uint32_t>(begin / made.rate_hz);
    gt3x::append_record(bytes, gt3x::RecordType::parameters, time, gt3x::encode_parameters(values));
    for (std::size_t i = begin; i < end; i += made.rate_hz) {
      std::vector<gt3x::Counts> second;
      for (std::size_t k = i; k < std::min<std::size_t>(i + made.rate_hz, end); ++k) {
        gt3x::Counts counts{};
        for (std::size_t a = 0; a < 3; ++a) {
          const double g = 2.0 * (made.raw[k][a] - made.constants.zero_lsb[a]) /
                           (made.constants.positive_lsb[a] - made.constants.negative_lsb[a]);
          counts[a] =
              static_cast<std::int16_t>(std::fmax(-2048, std::fmin(2047, std::round(g * scale))));
        }
        second.push_back(counts);
      }
      Bytes payload;
      gt3x::append_activity(payload, second);
      gt3x::append_record(bytes, gt3x::RecordType::activity,
                          made.start + static_cast<std::uint32_t>(i / made.rate_hz), payload);
    }
  }
  return bytes;
}

inline Bytes entry_of(FileSystem& files, const std::string& path, const std::string& name) {
  auto recording = gt3x::Recording::open(files, path);
  if (!recording) {
    return {};
  }
  auto source = recording->open_entry(name);
  return source ? gt3x::read_all(**source, 1ULL << 30).value_or(Bytes{}) : Bytes{};
}

inline std::vector<gt3x::Counts> samples_of(FileSystem& files, const std::string& path) {
  std::vector<gt3x::Counts> all;
  auto recording = gt3x::Recording::open(files, path);
  if (!recording) {
    return all;
  }
  auto log = recording->open_log();
  std::vector<gt3x::Counts> samples;
  while (log) {
    const auto item = log->next();
    if (!item || !item->has_value()) {
      break;
    }
    const gt3x::Record& record = (*item)->record;
    if ((*item)->kind != gt3x::LogItem::Kind::record || !record.checksum_ok ||
        record.payload.size() <= 1) {
      continue;
    }
    if (record.is(gt3x::RecordType::activity)) {
      gt3x::unpack_activity(record.payload, samples);
    } else if (record.is(gt3x::RecordType::activity2)) {
      gt3x::unpack_activity2(record.payload, samples);
    } else {
      continue;
    }
    all.insert(all.end(), samples.begin(), samples.end());
  }
  return all;
}

}  // namespace sixpoint::tests
