// Small logs made for tests: known records, so that every damage has a known answer.
#pragma once

#include "gt3x/forms/parameters.h"
#include "gt3x/log/record.h"
#include "gt3x/log/samples.h"
#include "gt3x/recording_writer.h"

namespace sixpoint::gt3x::tests {

inline constexpr std::uint32_t kStart = 1'428'588'240;

// The samples of second `second` of a made log.
inline std::vector<Counts> samples_of(std::uint32_t second, std::size_t rate = 30) {
  std::vector<Counts> samples(rate);
  for (std::size_t i = 0; i < rate; ++i) {
    const int value = static_cast<int>((std::size_t{second} * 131 + i * 17) % 3000) - 1500;
    samples[i] = {static_cast<std::int16_t>(value), static_cast<std::int16_t>(-value / 2),
                  static_cast<std::int16_t>(256 + static_cast<int>(i))};
  }
  return samples;
}

inline void append_second(Bytes& log, std::uint32_t second, std::size_t rate = 30) {
  Bytes payload;
  append_activity(payload, samples_of(second, rate));
  append_record(log, RecordType::activity, kStart + second, payload);
}

inline ParameterValues made_parameters(const StoredConstants& constants = {
                                           {326, 287, 303}, {-201, -268, -192}, {61, 4, 61}}) {
  ParameterValues values;
  set_constants(values, constants);
  values[kParameterCalibrationTime] = 1'384'266'733;
  values[kParameterFirmwareVersion] = 0x01050000;
  values[kParameterAccelScale] = encode_float(256);
  return values;
}

// METADATA, PARAMETERS, then `seconds` seconds with a LUX record before each.
inline Bytes made_log(std::uint32_t seconds, std::size_t rate = 30) {
  Bytes log;
  const std::string text = R"({"MetadataType":"Bio"})";
  append_record(log, RecordType::metadata, kStart - 70,
                std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  append_record(log, RecordType::parameters, kStart - 70, encode_parameters(made_parameters()));
  for (std::uint32_t second = 0; second < seconds; ++second) {
    append_record(log, RecordType::lux, kStart + second, Bytes{7, 0});
    append_second(log, second, rate);
  }
  return log;
}

inline std::string made_info(const std::string& rate = "30") {
  return "Serial Number: MOS2A45130450\r\nFirmware: 1.5.0\r\nSample Rate: " + rate +
         "\r\nStart Date: 635641850400000000\r\nAcceleration Scale: 256.0\r\n"
         "Acceleration Min: -8.0\r\nAcceleration Max: 8.0\r\n";
}

// A .gt3x file of this log.
inline Status put_recording(FileSystem& files, const std::string& path, const Bytes& log,
                            const std::string& info = made_info()) {
  SIXPOINT_ASSIGN(auto out, RecordingWriter::create(files, path));
  SIXPOINT_CHECK(out.add("log.bin", log));
  SIXPOINT_CHECK(out.add("info.txt", std::string_view(info)));
  return out.commit();
}

}  // namespace sixpoint::gt3x::tests
