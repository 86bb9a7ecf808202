#include "gt3x/rows/samples_npy.h"

#include <bit>
#include <cstring>

#include <fmt/format.h>

#include "gt3x/rows/sample_rows.h"

namespace sixpoint::gt3x {
namespace {

static_assert(std::endian::native == std::endian::little, "values are written as they lie");

// How many rows there are.
class RowCount final : public RowWriter {
 public:
  Status begin(std::uint32_t, bool) override { return {}; }
  void set_meaning(const AgdcCalibration*, double) override {}
  void at(std::uint32_t) override {}
  Status rows(std::span<const Counts> samples) override {
    rows_ += samples.size();
    return {};
  }
  Status repeat(const Counts&, std::uint64_t times, bool) override {
    rows_ += times;
    return {};
  }
  Status end() override { return {}; }

  std::uint64_t count() const { return rows_; }

 private:
  std::uint64_t rows_ = 0;
};

// Magic, version, length and a dictionary, filled up to a multiple of 64 bytes (the format's
// description: numpy.lib.format).
std::string npy_header(std::uint64_t rows, bool raw_lsb) {
  constexpr std::size_t kBefore = 10;
  constexpr std::size_t kAlign = 64;
  std::string dictionary =
      fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}, 3), }}",
                  raw_lsb ? "<i2" : "<f4", rows);
  const std::size_t whole = (kBefore + dictionary.size() + 1 + kAlign - 1) / kAlign * kAlign;
  dictionary.resize(whole - kBefore - 1, ' ');
  dictionary += '\n';
  std::string text = "\x93NUMPY";
  text += '\x01';
  text += '\x00';
  text += static_cast<char>(dictionary.size() & 0xFFU);
  text += static_cast<char>(dictionary.size() >> 8U);
  return text + dictionary;
}

class NpyWriter final : public RowWriter {
 public:
  NpyWriter(std::uint64_t rows, bool raw_lsb, const TextSink& sink)
      : rows_(rows), raw_lsb_(raw_lsb), sink_(sink) {}

  Status begin(std::uint32_t, bool) override { return sink_(npy_header(rows_, raw_lsb_)); }
  void set_meaning(const AgdcCalibration* agdc, double scale_lsb_per_g) override {
    agdc_ = agdc;
    scale_lsb_per_g_ = scale_lsb_per_g;
  }
  void at(std::uint32_t) override {}

  Status rows(std::span<const Counts> samples) override {
    for (const Counts& sample : samples) {
      SIXPOINT_CHECK(put(sample, false));
    }
    return {};
  }

  Status repeat(const Counts& sample, std::uint64_t times, bool zeros) override {
    for (std::uint64_t i = 0; i < times; ++i) {
      SIXPOINT_CHECK(put(sample, zeros));
    }
    return {};
  }

  Status end() override {
    SIXPOINT_CHECK(flush());
    if (written_ != rows_) {
      return fail(ErrorCode::io, "the recording changed while it was read", {},
                  "export it again when nothing writes it");
    }
    return {};
  }

 private:
  Status put(const Counts& sample, bool zeros) {
    ++written_;
    if (raw_lsb_) {
      append(zeros ? Counts{} : sample);
    } else {
      PerAxis<float> g{};
      if (!zeros && agdc_ != nullptr) {
        const PerAxis<double> exact_g = agdc_->apply(sample);
        for (std::size_t axis = 0; axis < kAxes; ++axis) {
          g[axis] = static_cast<float>(exact_g[axis]);
        }
      } else if (!zeros) {
        for (std::size_t axis = 0; axis < kAxes; ++axis) {
          g[axis] = static_cast<float>(sample[axis] / scale_lsb_per_g_);
        }
      }
      append(g);
    }
    constexpr std::size_t kWrittenAtOnce = std::size_t{64} * 1024;
    return bytes_.size() < kWrittenAtOnce ? Status{} : flush();
  }

  template <class Row>
  void append(const Row& row) {
    const std::size_t at = bytes_.size();
    bytes_.resize(at + sizeof row);
    std::memcpy(bytes_.data() + at, row.data(), sizeof row);
  }

  Status flush() {
    Status done = sink_(bytes_);
    bytes_.clear();
    return done;
  }

  std::uint64_t rows_;
  bool raw_lsb_;
  const TextSink& sink_;
  const AgdcCalibration* agdc_ = nullptr;
  double scale_lsb_per_g_ = 1;
  std::uint64_t written_ = 0;
  std::string bytes_;
};

}  // namespace

Result<RawCsvTally> write_samples_npy(Recording& recording, const RawCsvOptions& options,
                                      const TextSink& sink) {
  RowCount rows;
  SIXPOINT_CHECK(write_rows(recording, options, rows));
  NpyWriter out(rows.count(), options.raw_lsb, sink);
  return write_rows(recording, options, out);
}

}  // namespace sixpoint::gt3x
