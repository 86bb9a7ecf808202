#include "gt3x/raw_csv.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "gt3x/csv_header.h"
#include "gt3x/forms/agdc.h"
#include "gt3x/sample_reader.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::uint64_t kLongestFill_s = 400ULL * 86'400;
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

  void begin(std::uint32_t first) { first_ = first; }

  // The next lines belong to this second, counted from `line`.
  void at(std::uint32_t unix_time, std::uint64_t line) {
    second_ = unix_time;
    line_ = line;
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
    *out++ = ',';
    return out;
  }

 private:
  std::string text_of(std::int64_t unix_time) const {
    switch (form_) {
      case RawCsvOptions::Time::iso: {
        std::string text = to_iso8601(from_unix_seconds(unix_time));
        text.resize(19);  // the file's clock may show local time: no Z
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
  std::int64_t second_ = 0;
  std::uint64_t line_ = 0;
  std::string shown_;  // of second_ + shown_s_
  std::uint64_t shown_s_ = 0;
};

class Writer {
 public:
  Writer(const Recording& recording, const RawCsvOptions& options, const TextSink& sink,
         double rate_hz)
      : info_(recording.info()),
        options_(options),
        sink_(sink),
        time_(options.time, rate_hz),
        text_(kPiece + kLongestLine) {}

  Status header(std::uint32_t start_time, double rate_hz) {
    time_.begin(start_time);
    const std::string created_by = options_.created_by.empty()
                                       ? std::string("ActiGraph GT3X+ ActiLife v6.13.3")
                                       : printable(options_.created_by, 60);
    return sink_(csv_header(info_,
                            fmt::format("Created By {} Firmware v{} date format M/d/yyyy at {} Hz  "
                                        "Filter Normal ",
                                        created_by, printable(info_.firmware(), 40), rate_hz),
                            start_time) +
                 time_.name() + "Accelerometer X,Accelerometer Y,Accelerometer Z\r\n");
  }

  // What the counts of these samples mean.
  Status set_scale(const SampleItem& item, const std::optional<AgdcCalibration>& agdc) {
    agdc_ = item.type == RecordType::activity3 && agdc && !agdc->already_applied ? &*agdc : nullptr;
    if (options_.raw_lsb || agdc_ != nullptr) {
      return {};
    }
    const auto scale = accel_scale_lsb_per_g(info_, item.parameters);
    // 12 bits at 16 LSB/g would be 128 g: what an .agdc says of raw counts (1) is no scale.
    constexpr double kLeastOfCalibrated_lsb_per_g = 16;
    const bool no_scale =
        item.type == RecordType::activity3 && scale && *scale < kLeastOfCalibrated_lsb_per_g;
    if (!scale || *scale < 1 || *scale > 65536 || no_scale) {
      return fail(ErrorCode::bad_data, "the recording does not say how many LSB make one g", {},
                  "export the stored counts with --raw");
    }
    if (item.type == RecordType::activity3 && !agdc) {
      return fail(ErrorCode::bad_data,
                  "the recording holds raw counts and no calibration.json that turns them into g",
                  {}, "export the raw counts with --raw");
    }
    if (scale_ != *scale) {
      scale_ = *scale;
      for (std::size_t i = 0; i < cells_.size(); ++i) {
        Cell& cell = cells_[i];
        std::size_t size =
            print_mg(round_to_mg(static_cast<int>(i) + kMin12, scale_), cell.text.data());
        cell.text[size++] = ',';
        cell.size = static_cast<std::uint8_t>(size);
      }
    }
    return {};
  }

  // The lines that come next are those of this second, from its line number `line` on.
  void at(std::uint32_t unix_time, std::uint64_t line) { time_.at(unix_time, line); }

  Status lines(std::span<const Counts> samples) {
    for (const Counts& sample : samples) {
      SIXPOINT_CHECK(line(sample));
    }
    return {};
  }

  // The same line many times: what a repeated sample or a second without data becomes.
  Status repeat(const Counts& sample, std::uint64_t times) {
    for (std::uint64_t i = 0; i < times; ++i) {
      SIXPOINT_CHECK(line(sample));
    }
    return {};
  }

  Status zeros(std::uint64_t times) {
    constexpr std::string_view kZeros = "0,0,0\r\n";
    for (std::uint64_t i = 0; i < times; ++i) {
      char* out = time_.put(text_.data() + size_);
      std::memcpy(out, kZeros.data(), kZeros.size());
      SIXPOINT_CHECK(end_line(out + kZeros.size()));
    }
    return {};
  }
  Status finish() { return flush(); }

 private:
  // A value and its comma: "-1365.333," is the longest.
  struct Cell {
    std::array<char, 15> text{};
    std::uint8_t size = 0;
  };
  static_assert(sizeof(Cell) == 16);
  static constexpr std::size_t kLongestLine = TimeColumn::kLongest + 96;

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
  TimeColumn time_;
  std::vector<char> text_;  // a line more than kPiece
  std::size_t size_ = 0;    // of it, filled
  const AgdcCalibration* agdc_ = nullptr;
  double scale_ = 0;
  std::vector<Cell> cells_ = std::vector<Cell>(kMax12 - kMin12 + 1);
};

Result<std::optional<AgdcCalibration>> agdc_calibration_of(Recording& recording, double rate_hz) {
  if (!recording.has_entry("calibration.json")) {
    return std::nullopt;
  }
  SIXPOINT_ASSIGN(const auto source, recording.open_entry("calibration.json"));
  SIXPOINT_ASSIGN(const Bytes bytes, read_all(*source, 1 << 20));
  const auto parsed = parse_agdc_calibration(as_text(bytes), static_cast<int>(rate_hz));
  // Not every calibration.json is one of these; who needs it will say that it is missing.
  return parsed ? std::optional(*parsed) : std::nullopt;
}

// Lines for the seconds of a recording, one after the other.
class Export {
 public:
  Export(const Recording& recording, const RawCsvOptions& options, const TextSink& sink,
         double rate_hz, const std::optional<AgdcCalibration>& agdc)
      : options_(options),
        rate_hz_(rate_hz),
        rate_(static_cast<std::uint64_t>(std::llround(rate_hz))),
        agdc_(agdc),
        out_(recording, options, sink, rate_hz) {}

  Status take(const SampleItem& item) {
    if (!started_) {
      SIXPOINT_CHECK(out_.header(item.unix_time, rate_hz_));
      started_ = true;
    }
    if (options_.fill && short_by_ > 0) {
      SIXPOINT_CHECK(fill(std::exchange(short_by_, 0)));  // goes on in the second before
    }
    out_.at(item.unix_time, 0);
    return item.kind == SampleItem::Kind::recorded ? take_samples(item) : take_gap(item);
  }

  Result<RawCsvTally> finish(const std::string& path) {
    if (tally_.samples == 0) {
      return fail(ErrorCode::bad_data, "the recording holds no samples", path,
                  "check that the unit was started; download the recording again");
    }
    SIXPOINT_CHECK(out_.finish());
    return tally_;
  }

 private:
  Status take_samples(const SampleItem& item) {
    SIXPOINT_CHECK(out_.set_scale(item, agdc_));
    SIXPOINT_CHECK(out_.lines(item.counts));
    last_ = item.counts.back();
    zeros_ = false;
    tally_.samples += item.counts.size();
    tally_.out_of_step_seconds += item.broke_order || item.counts.size() > rate_ ? 1 : 0;
    short_by_ = item.counts.size() < rate_ ? rate_ - item.counts.size() : 0;
    return {};
  }

  Status take_gap(const SampleItem& item) {
    zeros_ = zeros_ || item.kind == SampleItem::Kind::usb;
    if (!options_.fill) {
      return {};
    }
    filled_s_ += item.seconds;
    if (filled_s_ > kLongestFill_s) {
      return fail(
          ErrorCode::bad_data,
          fmt::format("more than {} days are missing at {}; a time stamp must be wrong",
                      kLongestFill_s / 86'400, to_iso8601(from_unix_seconds(item.unix_time))),
          {}, "export what was recorded with --no-fill");
    }
    return fill(item.seconds * rate_);
  }

  Status fill(std::uint64_t lines) {
    tally_.filled += lines;
    return zeros_ ? out_.zeros(lines) : out_.repeat(last_, lines);
  }

  const RawCsvOptions& options_;
  double rate_hz_;
  std::uint64_t rate_;
  const std::optional<AgdcCalibration>& agdc_;
  Writer out_;
  RawCsvTally tally_;
  Counts last_{};
  bool zeros_ = false;  // since a USB record
  std::uint64_t filled_s_ = 0;
  std::uint64_t short_by_ = 0;  // lines that the second before lacks; the last of all may be short
  bool started_ = false;
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
  const double rate_hz = recording.info().sample_rate_hz().value_or(0);
  if (!(rate_hz >= 1)) {
    return fail(ErrorCode::bad_data, "the recording has a sample rate of 0 or none at all",
                recording.path(), "download the recording from the unit again");
  }
  SIXPOINT_ASSIGN(const auto agdc, agdc_calibration_of(recording, rate_hz));
  Export out(recording, options, sink, rate_hz, agdc);
  SampleReader reader(recording);
  for (;;) {
    auto next = reader.next();
    Status status = next ? Status() : Status(fail(next.error()));
    if (next && *next) {
      status = out.take(**next);
    }
    if (!status) {
      Error error = std::move(status).error();
      error.where = error.where.empty() ? recording.path() : error.where;
      return fail(std::move(error));
    }
    if (!*next) {
      break;
    }
  }
  SIXPOINT_ASSIGN(RawCsvTally tally, out.finish(recording.path()));
  tally.checksum_failures = reader.statistics().checksum_failures;
  tally.damaged_stretches = reader.statistics().damaged_stretches;
  return tally;
}

}  // namespace sixpoint::gt3x
