#include "gt3x/rows/raw_csv.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "gt3x/rows/csv_header.h"
#include "gt3x/rows/sample_rows.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::size_t kPiece = std::size_t{64} * 1024;

// 1008 -> "1.008", 20 -> "0.02", -1000 -> "-1", 0 -> "0"; returns the length.
std::size_t print_mg(std::int64_t mg, char* out) {
  char* at = out;
  if (mg < 0) {
    *at++ = '-';
    mg = -mg;
  }
  at = std::to_chars(at, at + 20, mg / 1000).ptr;
  if (const std::int64_t decimals = mg % 1000; decimals != 0) {
    *at++ = '.';
    for (std::int64_t unit = 100, rest = decimals; rest != 0; rest %= unit, unit /= 10) {
      *at++ = static_cast<char>('0' + rest / unit);
    }
  }
  return static_cast<std::size_t>(at - out);
}

// The times of lines.
class TimeColumn {
 public:
  // Room that one time takes, at most.
  static constexpr std::size_t kLongest = 40;

  TimeColumn(RawCsvOptions::Time form, double rate_hz) : form_(form), rate_hz_(rate_hz) {}

  const char* name() const {
    switch (form_) {
      case RawCsvOptions::Time::none:
        return "";
      case RawCsvOptions::Time::iso:
        return "Timestamp,";
      case RawCsvOptions::Time::seconds:
        return "Seconds,";
      case RawCsvOptions::Time::unix_seconds:
        return "Unix Timestamp,";
    }
    return "";
  }

  void begin(std::uint32_t first, bool utc) {
    first_ = first;
    utc_ = utc;
  }

  // The next lines belong to this second, from its first on.
  void at(std::uint32_t unix_time) {
    second_ = unix_time;
    line_ = 0;
    shown_.clear();
  }

  // Writes the next line's time and comma to `out`; returns behind it.
  char* put(char* out) {
    if (form_ == RawCsvOptions::Time::none) {
      return out;
    }
    const double after_s = static_cast<double>(line_++) / rate_hz_;
    const auto whole_s = static_cast<std::uint64_t>(after_s);
    if (shown_.empty() || whole_s != shown_s_) {
      shown_s_ = whole_s;
      shown_ = text_of(second_ + static_cast<std::int64_t>(whole_s));
    }
    std::memcpy(out, shown_.data(), shown_.size());
    out += shown_.size();
    // A thousandth that is one but for the division's rounding is one.
    constexpr double kRounding = 1e-6;
    auto thousandths =
        static_cast<unsigned>((after_s - static_cast<double>(whole_s)) * 1000 + kRounding);
    thousandths = std::min(thousandths, 999U);
    *out++ = '.';
    *out++ = static_cast<char>('0' + thousandths / 100);
    *out++ = static_cast<char>('0' + thousandths / 10 % 10);
    *out++ = static_cast<char>('0' + thousandths % 10);
    if (utc_ && form_ == RawCsvOptions::Time::iso) {
      *out++ = 'Z';
    }
    *out++ = ',';
    return out;
  }

 private:
  std::string text_of(std::int64_t unix_time) const {
    switch (form_) {
      case RawCsvOptions::Time::iso: {
        std::string text = to_iso8601(from_unix_seconds(unix_time));
        text.resize(19);  // without the Z
        return text;
      }
      case RawCsvOptions::Time::seconds:
        return std::to_string(unix_time - static_cast<std::int64_t>(first_));
      default:
        return std::to_string(unix_time);
    }
  }

  RawCsvOptions::Time form_;
  double rate_hz_;
  std::uint32_t first_ = 0;
  bool utc_ = false;
  std::int64_t second_ = 0;
  std::uint64_t line_ = 0;
  std::string shown_;  // of second_ + shown_s_
  std::uint64_t shown_s_ = 0;
};

class CsvWriter final : public RowWriter {
 public:
  CsvWriter(const Recording& recording, const RawCsvOptions& options, const TextSink& sink,
            double rate_hz)
      : info_(recording.info()),
        options_(options),
        sink_(sink),
        rate_hz_(rate_hz),
        time_(options.time, rate_hz),
        text_(kPiece + kLongestLine) {}

  Status begin(std::uint32_t start_time, bool utc) override {
    time_.begin(start_time, utc);
    const std::string created_by = options_.created_by.empty()
                                       ? std::string("ActiGraph GT3X+ ActiLife v6.13.3")
                                       : printable(options_.created_by, 60);
    return sink_(csv_header(info_,
                            fmt::format("Created By {} Firmware v{} date format M/d/yyyy at {} Hz  "
                                        "Filter Normal ",
                                        created_by, printable(info_.firmware(), 40), rate_hz_),
                            start_time) +
                 time_.name() + "Accelerometer X,Accelerometer Y,Accelerometer Z\r\n");
  }

  void set_meaning(const AgdcCalibration* agdc, double scale_lsb_per_g) override {
    agdc_ = agdc;
    if (agdc == nullptr && scale_ != scale_lsb_per_g) {
      scale_ = scale_lsb_per_g;
      for (std::size_t i = 0; i < cells_.size(); ++i) {
        Cell& cell = cells_[i];
        std::size_t size =
            print_mg(round_to_mg(static_cast<int>(i) + kMin12, scale_), cell.text.data());
        cell.text[size++] = ',';
        cell.size = static_cast<std::uint8_t>(size);
      }
    }
  }

  void at(std::uint32_t unix_time) override { time_.at(unix_time); }

  Status rows(std::span<const Counts> samples) override {
    for (const Counts& sample : samples) {
      SIXPOINT_CHECK(line(sample));
    }
    return {};
  }

  Status repeat(const Counts& sample, std::uint64_t times, bool zeros) override {
    if (zeros) {
      return zero_lines(times);
    }
    for (std::uint64_t i = 0; i < times; ++i) {
      SIXPOINT_CHECK(line(sample));
    }
    return {};
  }

  Status end() override { return flush(); }

 private:
  // A value and its comma: "-1365.333," is the longest.
  struct Cell {
    std::array<char, 15> text{};
    std::uint8_t size = 0;
  };
  static_assert(sizeof(Cell) == 16);
  static constexpr std::size_t kLongestLine = TimeColumn::kLongest + 96;

  Status zero_lines(std::uint64_t times) {
    constexpr std::string_view kZeros = "0,0,0\r\n";
    for (std::uint64_t i = 0; i < times; ++i) {
      char* out = time_.put(text_.data() + size_);
      std::memcpy(out, kZeros.data(), kZeros.size());
      SIXPOINT_CHECK(end_line(out + kZeros.size()));
    }
    return {};
  }

  Status line(const Counts& sample) {
    char* out = time_.put(text_.data() + size_);
    if (!options_.raw_lsb && agdc_ == nullptr) {
      for (const int count : sample) {
        if (count >= kMin12 && count <= kMax12) [[likely]] {
          const Cell& cell = cells_[static_cast<std::size_t>(count - kMin12)];
          std::memcpy(out, &cell, sizeof cell);
          out += cell.size;
        } else {
          out += print_mg(round_to_mg(count, scale_), out);
          *out++ = ',';
        }
      }
    } else {
      PerAxis<double> agdc_g{};
      if (!options_.raw_lsb) {
        agdc_g = agdc_->apply(sample);
      }
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        if (options_.raw_lsb) {
          out = std::to_chars(out, out + 8, sample[axis]).ptr;
        } else {
          // Real numbers: no half-way case is exact here.
          out += print_mg(std::llround(std::clamp(agdc_g[axis], -1e6, 1e6) * kMgPerG), out);
        }
        *out++ = ',';
      }
    }
    out[-1] = '\r';
    *out++ = '\n';
    return end_line(out);
  }

  Status end_line(const char* end) {
    size_ = static_cast<std::size_t>(end - text_.data());
    return size_ < kPiece ? Status{} : flush();
  }

  Status flush() {
    const std::string_view text(text_.data(), std::exchange(size_, 0));
    return sink_(text);
  }

  const Info& info_;
  const RawCsvOptions& options_;
  const TextSink& sink_;
  double rate_hz_;
  TimeColumn time_;
  std::vector<char> text_;  // a line more than kPiece
  std::size_t size_ = 0;    // of it, filled
  const AgdcCalibration* agdc_ = nullptr;
  double scale_ = 0;
  std::vector<Cell> cells_ = std::vector<Cell>(kMax12 - kMin12 + 1);
};

}  // namespace

std::int64_t round_to_mg(int count, double scale_lsb_per_g) {
  // Scales come with 24 significant bits (parameters.h) or a few decimals; in units of 2^-23 they
  // are integers, so that a half-way case is one exactly when it is.
  constexpr std::int64_t kUnits = 1 << 23;
  const auto scale = static_cast<std::int64_t>(std::llround(scale_lsb_per_g * kUnits));
  const std::int64_t magnitude = std::abs(static_cast<std::int64_t>(count));
  const std::int64_t mg = (std::int64_t{2000} * kUnits * magnitude + scale) / (2 * scale);
  return count < 0 ? -mg : mg;
}

Result<RawCsvTally> write_raw_csv(Recording& recording, const RawCsvOptions& options,
                                  const TextSink& sink) {
  CsvWriter out(recording, options, sink, recording.info().sample_rate_hz().value_or(0));
  return write_rows(recording, options, out);
}

}  // namespace sixpoint::gt3x
