// A recording's samples as the raw CSV that the vendor's software exports, character for character.
//
//   SIXPOINT_ASSIGN(auto recording, Recording::open(env.files, "unit.gt3x"));
//   std::string csv;
//   const TextSink sink = [&](std::string_view text) {
//     csv += text;
//     return Status{};
//   };
//   SIXPOINT_ASSIGN(const RawCsvTally tally, write_raw_csv(recording, {}, sink));
//
// Ten header lines, one line of column names, then a line per sample, X Y Z. Without a time column,
// as the vendor writes it, the n-th line belongs to start + n / rate. Lines end in CR LF.
//
// A time column stands first. The k-th line of a second has the second's time in the file plus
// k / rate, in thousandths of a second, rounded down; the clock is the file's own (clock.h), as in
// the header lines. Where that is known to be UTC, ISO times end in Z:
//
//     time     column             example
//     none     -                  -0.02,0.996,0.086
//     iso      Timestamp          2015-04-09T14:04:00.033,-0.02,0.996,0.086
//     seconds  Seconds            0.033,-0.02,0.996,0.086      since the first sample
//     unix     Unix Timestamp     1428588240.033,-0.02,0.996,0.086
//
// Rounding: g to three decimals, half-way cases away from zero, then without trailing zeros
// ("0.02", "1", "0"). It is computed in integers (round_to_mg), because half-way cases are common
// at 256 LSB/g (every count of 16 k + 8 is one: 8 / 256 = 0.03125 is not, but 16 / 256 = 0.0625 is)
// and a binary fraction must not decide them. Tested sample for sample against two exports of the
// vendor.
//
// Which seconds are written is second_order.h's to say: each once, by the recording's own clock,
// and as many lines as the rate has samples. A second with more samples ends at the rate.
//
// Missing seconds: the last sample is repeated, as the vendor does for idle sleep. From a one-byte
// record (USB) on it is zeros instead, until the next sample or the file's Last Sample Time. A
// second with too few samples is filled up in the same way, but for the last of all. Gaps that
// fills_gap() does not fill are left out: behind them a line's number no longer tells its time.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "gt3x/recording.h"
#include "gt3x/second_order.h"

namespace sixpoint::gt3x {

struct RawCsvOptions {
  // Stored counts instead of g (of .agdc files: the sensor's raw counts).
  bool raw_lsb = false;
  // Missing seconds filled in, so that the line number is the time. Without: what was recorded, in
  // the order of the file, and nothing else.
  bool fill = true;
  std::uint64_t fill_limit_s = kUsualFillLimit_s;  // fills_gap()
  bool fill_zeros = false;  // fills with zeros, never with the last sample, as other readers do
  enum class Time { none, iso, seconds, unix_seconds };
  Time time = Time::none;
  // Who stands in the first line for who made the data. Empty: the vendor's own words, which are
  // true of samples as the unit stored them, and not of repaired ones.
  std::string created_by;
};

struct RawCsvTally {
  std::uint64_t samples = 0;  // recorded ones
  std::uint64_t filled = 0;   // lines that repeat a sample or are zeros
  std::uint64_t checksum_failures = 0;
  std::uint64_t damaged_stretches = 0;
  std::uint64_t surplus_samples = 0;  // of seconds with more than the rate; not written
  struct Leap {
    std::uint32_t unix_time = 0;  // of the first second behind it
    std::int64_t seconds = 0;     // forward over so many; below 0: so far back the time goes
    bool missing = false;         // they are, and are not filled; else they were written before
  };
  static constexpr std::size_t kMostLeaps = 100;
  std::vector<Leap> leaps;  // where a line's number no longer tells its time; the first ones
  std::uint64_t leap_count = 0;
  Irregular irregular;  // empty without filling
};

// Text for the file, in pieces of some ten thousand characters, in order.
using TextSink = std::function<Status(std::string_view)>;

// bad_data for a recording without samples, without a sample rate or a scale (nothing then says
// what the counts mean), and where filling would take more than 400 days. The sink may have been
// given text before an error is found: a damaged entry shows at its end.
Result<RawCsvTally> write_raw_csv(Recording& recording, const RawCsvOptions& options,
                                  const TextSink& sink);

// round(1000 * count / scale), half away from zero, exactly; |count| < 2^16, scale in [1, 65536].
std::int64_t round_to_mg(int count, double scale_lsb_per_g);

}  // namespace sixpoint::gt3x
