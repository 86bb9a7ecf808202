#include "gt3x/rows/sample_rows.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "gt3x/forms/sample_rate.h"
#include "gt3x/sample_reader.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::uint64_t kLongestFill_s = 400ULL * 86'400;

}  // namespace

// Rows for the seconds of a recording, one after the other.
class RowSource::Rows {
 public:
  Rows(Recording& recording, const RawCsvOptions& options, double rate_hz,
       const std::optional<AgdcCalibration>& agdc)
      : path_(recording.path()),
        info_(recording.info()),
        options_(options),
        rate_(static_cast<std::uint64_t>(std::llround(rate_hz))),
        agdc_(agdc),
        reader_(recording, options.fill ? ReadOrder::of_the_clock : ReadOrder::of_the_file,
                options.fill_limit_s) {}

  Result<bool> step(RowWriter& out) {
    out_ = &out;
    auto next = reader_.next();
    Status status = next ? Status() : Status(fail(next.error()));
    if (next && *next) {
      status = take(**next);
    }
    if (!status) {
      Error error = std::move(status).error();
      error.where = error.where.empty() ? path_ : error.where;
      return fail(std::move(error));
    }
    return next->has_value();
  }

  Result<RawCsvTally> tally() const {
    if (tally_.samples == 0) {
      return fail(ErrorCode::bad_data, "the recording holds no samples", path_,
                  "check that the unit was started; download the recording again");
    }
    RawCsvTally tally = tally_;
    tally.checksum_failures = reader_.statistics().checksum_failures;
    tally.damaged_stretches = reader_.statistics().damaged_stretches;
    tally.irregular = reader_.irregular();
    return tally;
  }

  const SampleReader& reader() const { return reader_; }
  const GapList& gaps() const { return gaps_; }
  std::uint64_t rate_hz() const { return rate_; }

 private:
  Status take(const SampleItem& item) {
    if (!started_) {
      SIXPOINT_CHECK(out_->begin(item.unix_time, reader_.clock().kind == ClockKind::utc));
      started_ = true;
    }
    if (options_.fill && short_by_ > 0) {
      SIXPOINT_CHECK(fill(std::exchange(short_by_, 0)));  // goes on in the second before
    }
    if (options_.fill && item.broke_order) {
      const std::int64_t step = std::int64_t{item.unix_time} - std::int64_t{last_second_};
      note_leap(item.unix_time, step < 0 ? step : step - 1, false);
    }
    out_->at(item.unix_time);
    return item.kind == SampleItem::Kind::recorded ? take_samples(item) : take_gap(item);
  }

  Status take_samples(const SampleItem& item) {
    SIXPOINT_CHECK(set_meaning(item));
    std::span<const Counts> counts = item.counts;
    if (options_.fill && counts.size() > rate_) {
      tally_.surplus_samples += counts.size() - rate_;
      counts = counts.first(static_cast<std::size_t>(rate_));
    }
    last_second_ = item.unix_time;
    SIXPOINT_CHECK(out_->rows(counts));
    last_ = counts.back();
    zeros_ = false;
    tally_.samples += counts.size();
    short_by_ = counts.size() < rate_ ? rate_ - counts.size() : 0;
    return {};
  }

  // What the counts of these samples mean.
  Status set_meaning(const SampleItem& item) {
    if (options_.raw_lsb) {
      return {};
    }
    if (item.type == RecordType::activity3 && agdc_ && !agdc_->already_applied) {
      out_->set_meaning(&*agdc_, 0);
      return {};
    }
    const auto scale = accel_scale_lsb_per_g(info_, item.parameters);
    if (!scale || *scale < 1 || *scale > 65536) {
      return fail(ErrorCode::bad_data, "the recording does not say how many LSB make one g", {},
                  "export the stored counts with --raw");
    }
    if (item.type == RecordType::activity3 && !agdc_) {
      return fail(ErrorCode::bad_data,
                  "the recording holds raw counts and no calibration.json that turns them into g",
                  {}, "export the raw counts with --raw");
    }
    out_->set_meaning(nullptr, *scale);
    return {};
  }

  void note_leap(std::uint32_t unix_time, std::int64_t seconds, bool missing) {
    ++tally_.leap_count;
    if (tally_.leaps.size() < RawCsvTally::kMostLeaps) {
      tally_.leaps.push_back({unix_time, seconds, missing});
    }
  }

  Status take_gap(const SampleItem& item) {
    gaps_.add(item);
    zeros_ = zeros_ || item.kind == SampleItem::Kind::usb || item.gap == GapKind::usb;
    if (!options_.fill) {
      return {};
    }
    last_second_ = item.unix_time + (item.seconds - 1);
    if (!item.filled) {
      note_leap(item.unix_time + item.seconds, item.seconds, true);
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
    return out_->repeat(last_, lines, zeros_ || options_.fill_zeros);
  }

  std::string path_;
  Info info_;
  RawCsvOptions options_;
  std::uint64_t rate_;
  std::optional<AgdcCalibration> agdc_;
  SampleReader reader_;
  GapList gaps_;
  RowWriter* out_ = nullptr;
  RawCsvTally tally_;
  Counts last_{};
  bool zeros_ = false;  // since a USB record
  std::uint32_t last_second_ = 0;
  std::uint64_t filled_s_ = 0;
  std::uint64_t short_by_ = 0;  // lines that the second before lacks; the last of all may be short
  bool started_ = false;
};

Result<RowSource> RowSource::open(Recording& recording, const RawCsvOptions& options) {
  SIXPOINT_ASSIGN(const double rate_hz, usable_sample_rate_hz(recording.info(), recording.path()));
  // Not every calibration.json is one of an .agdc; who needs it says that it is missing.
  const auto found = agdc_calibration(recording, rate_hz);
  const auto agdc = found ? std::optional(*found) : std::nullopt;
  return RowSource(std::make_unique<Rows>(recording, options, rate_hz, agdc));
}

RowSource::RowSource(std::unique_ptr<Rows> rows) : rows_(std::move(rows)) {}
RowSource::RowSource(RowSource&&) noexcept = default;
RowSource& RowSource::operator=(RowSource&&) noexcept = default;
RowSource::~RowSource() = default;

Result<bool> RowSource::step(RowWriter& out) { return rows_->step(out); }
Result<RawCsvTally> RowSource::tally() const { return rows_->tally(); }
const SampleReader& RowSource::reader() const { return rows_->reader(); }
const GapList& RowSource::gaps() const { return rows_->gaps(); }
std::uint64_t RowSource::rate_hz() const { return rows_->rate_hz(); }

Result<RawCsvTally> write_rows(Recording& recording, const RawCsvOptions& options, RowWriter& out) {
  SIXPOINT_ASSIGN(RowSource rows, RowSource::open(recording, options));
  for (;;) {
    SIXPOINT_ASSIGN(const bool more, rows.step(out));
    if (!more) {
      break;
    }
  }
  SIXPOINT_ASSIGN(RawCsvTally tally, rows.tally());
  SIXPOINT_CHECK(out.end());
  return tally;
}

}  // namespace sixpoint::gt3x
