// A recording of the old form (activity.bin, eeprom.bin), made by code of its own from the vendor's
// public description.
#pragma once

#include "repair/made_recording.h"

namespace sixpoint::tests {

struct OldRecording {
  std::string serial = "NEO1B34100019";
  StoredConstants constants = kStored;
  std::vector<PerAxis<int>> raw;  // the sensor's counts, one entry per sample
  std::size_t zeros = 0;          // samples of a unit that charges, behind them

  // CRC-CCITT, from all ones: the remainder bit by bit, as a division is written out by hand.
  static unsigned remainder(const Bytes& bytes, std::size_t from, std::size_t to) {
    unsigned left = 0xFFFF;
    for (std::size_t i = from; i < to; ++i) {
      for (unsigned bit = 0x80; bit != 0; bit >>= 1U) {
        const bool out = ((left >> 15U) & 1U) != ((bytes[i] & bit) != 0 ? 1U : 0U);
        left = (left << 1U) & 0xFFFFU;
        left = out ? left ^ 0x1021U : left;
      }
    }
    return left;
  }

  Bytes eeprom() const {
    Bytes bytes(2048, 0xFF);
    std::fill_n(bytes.begin(), 16, std::uint8_t{0});
    std::copy_n(serial.begin(), std::min<std::size_t>(serial.size(), 16), bytes.begin());
    const std::string tune = "TUNE";
    std::copy(tune.begin(), tune.end(), bytes.begin() + 256);
    std::size_t at = 260;
    for (const PerAxis<int>* axes :
         {&constants.zero_lsb, &constants.positive_lsb, &constants.negative_lsb}) {
      for (const int value : *axes) {
        const auto bits = static_cast<std::uint16_t>(value);
        bytes[at++] = static_cast<std::uint8_t>(bits & 0xFFU);
        bytes[at++] = static_cast<std::uint8_t>(bits >> 8U);
      }
    }
    // 21 October 2010, 11:23:47; firmware 1.4.0.
    for (const unsigned byte : {10U, 21U, 10U, 11U, 23U, 47U}) {
      bytes[at++] = static_cast<std::uint8_t>(byte);
    }
    bytes[349] = 0;
    bytes[350] = 0;
    bytes[351] = 4;
    bytes[352] = 1;
    const unsigned crc = remainder(bytes, 256, 510);
    bytes[510] = static_cast<std::uint8_t>(crc >> 8U);
    bytes[511] = static_cast<std::uint8_t>(crc & 0xFFU);
    return bytes;
  }

  Status write(FileSystem& files, const std::string& path) const {
    return write(files, path, eeprom());
  }

  // An empty `eeprom_bytes`: without one.
  Status write(FileSystem& files, const std::string& path, const Bytes& eeprom_bytes) const {
    std::vector<gt3x::Counts> stored;
    for (const PerAxis<int>& m : raw) {
      gt3x::Counts counts{};
      for (std::size_t a = 0; a < 3; ++a) {
        const double g = 2.0 * (m[a] - constants.zero_lsb[a]) /
                         (constants.positive_lsb[a] - constants.negative_lsb[a]);
        counts[a] =
            static_cast<std::int16_t>(std::fmax(-2048, std::fmin(2047, std::round(g * 341))));
      }
      stored.push_back(counts);
    }
    stored.resize(stored.size() + zeros);
    Bytes activity;
    gt3x::append_activity(activity, stored);
    gt3x::Info info;
    info.set("Serial Number", serial);
    info.set("Firmware", "1.4.0");
    info.set("Sample Rate", "30");
    info.set("Start Date", "634236966000000000");
    SIXPOINT_ASSIGN(auto writer, gt3x::RecordingWriter::create(files, path));
    SIXPOINT_CHECK(writer.add("activity.bin", activity));
    if (!eeprom_bytes.empty()) {
      SIXPOINT_CHECK(writer.add("eeprom.bin", eeprom_bytes));
    }
    SIXPOINT_CHECK(writer.add("info.txt", info.serialise()));
    return writer.commit();
  }
};

}  // namespace sixpoint::tests
