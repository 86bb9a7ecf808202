// The seconds of a recording in the order of its own clock, each once.
//
//   SecondOrder order(30);  // samples a second
//   Second second;
//   second.unix_time = 1'428'588'240;
//   second.counts.assign(30, Counts{0, 0, 256});
//   order.push(std::move(second));
//   order.end();
//   while (const auto ordered = order.next()) {
//     std::cout << ordered->unix_time << '\n';
//   }
//
// A unit writes one sample record per second, in order. Real and copied files also hold a second
// twice (a one-byte USB record and samples), records that changed places, and times that leap. The
// rule, for a record's second against those before it in the file:
//
//     the record's second                            what becomes of it              said as
//     the first, or the next one                     written                         -
//     later                                          seconds that are not there yet  gap
//                                                    are missing before it
//     later by more than an hour, and nothing in     goes on there                   jump
//       the file explains it (or by more than the
//       fill limit, where that is longer)
//     written just now, or still waiting, with       the record with more samples    repeated, or
//       samples in both                              is written, of equal ones the   repeated_
//                                                    first                           otherwise
//     ... one of the two is a one-byte record        the samples are written         usb_and_samples
//     missing so far, still waiting                  put in its place                out_of_order
//     before the first by at most an hour, and       put in its place                out_of_order
//       the first still waits
//     before the first otherwise                     goes on there                   jump
//     written long ago                               not written                     repeated
//     filled by now, or left out                     not written                     late
//
// The first is that of the run: of the seconds since the last jump. Seconds that follow missing
// ones wait for those, up to kMostWaiting_s of them. Which missing seconds are filled is
// fills_gap()'s to say. No second is called missing that was written before.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "gt3x/forms/parameters.h"
#include "gt3x/log/record.h"
#include "gt3x/log/samples.h"

namespace sixpoint::gt3x {

// Why seconds are missing.
enum class GapKind {
  idle_sleep,   // an EVENT says that the unit went to sleep
  usb,          // a one-byte record came before: the unit hung on USB, charging
  damaged,      // the records of these seconds are damaged
  unexplained,  // nothing in the file says why; seen in real recordings
};
std::string_view to_string(GapKind kind);

// Whether missing seconds are filled, as the vendor's CSV does. `limit_s`: kUsualFillLimit_s unless
// the user says otherwise.
//
//     why they are missing      how many             filled
//     idle_sleep, usb           any number           yes
//     damaged, unexplained      limit_s or fewer     yes
//     damaged, unexplained      more                 no
inline constexpr std::uint64_t kUsualFillLimit_s = 3600;
bool fills_gap(GapKind kind, std::uint64_t seconds, std::uint64_t limit_s);

// What is irregular about the times of sample records, by kind and place.
enum class IrregularKind {
  repeated,            // a second that is there already
  repeated_otherwise,  // ... with other samples
  usb_and_samples,     // a one-byte record and samples in one second; no fault, and no loss
  out_of_order,        // came late and was put in its place
  late,                // came too late for that and was left out
  odd_size,            // holds more or fewer samples than the rate
  jump,                // the time leaps, forward or back
};
std::string_view to_string(IrregularKind kind);

struct Irregular {
  static constexpr std::size_t kKinds = 7;
  static constexpr std::size_t kMostListed = 100;  // of each kind; the counts are of all
  struct Place {
    IrregularKind kind = IrregularKind::repeated;
    std::uint32_t unix_time = 0;
    std::uint64_t offset = 0;  // of the record in log.bin
    std::int64_t value = 0;    // samples (odd_size), seconds from the record before (jump)
  };
  std::array<std::uint64_t, kKinds> counts{};
  std::vector<Place> places;  // in the order of the file

  std::uint64_t count(IrregularKind kind) const { return counts[static_cast<std::size_t>(kind)]; }
  std::uint64_t repeated_seconds() const {
    return count(IrregularKind::repeated) + count(IrregularKind::repeated_otherwise);
  }
  std::uint64_t records_out_of_order() const {
    return count(IrregularKind::out_of_order) + count(IrregularKind::late);
  }
  // Whether anything but usb_and_samples was met.
  bool any() const;
};

struct ParameterSet {
  std::uint32_t unix_time = 0;
  Parameters parameters;
};

// One sample record, read.
struct Second {
  std::uint32_t unix_time = 0;
  std::uint64_t offset = 0;
  std::vector<Counts> counts;  // empty: a one-byte record
  // Why seconds between it and the sample record before it in the file are missing, if any are.
  GapKind missing_before = GapKind::unexplained;
  RecordType type = RecordType::activity;
  std::int16_t limit_min = kMin12;
  std::int16_t limit_max = kMax12;
  std::shared_ptr<const ParameterSet> parameters;  // in force; null where none came before
};

// A second, or seconds that are missing.
struct OrderedSecond {
  std::uint32_t unix_time = 0;
  // Above 0: so many seconds are missing from unix_time on, and `second` is empty.
  std::uint32_t missing = 0;
  GapKind gap = GapKind::unexplained;
  bool filled = true;  // of missing ones
  // It does not begin where the one before ended, and no missing seconds stand between them.
  bool leapt = false;
  Second second;
};

class SecondOrder {
 public:
  static constexpr std::size_t kMostWaiting_s = 3600;
  static constexpr std::size_t kMostWaitingSamples = std::size_t{1} << 20;
  static constexpr std::size_t kMostRuns = 10'000;

  // `rate` samples are a whole second; 0: any number is.
  explicit SecondOrder(std::size_t rate, std::uint64_t fill_limit_s = kUsualFillLimit_s);

  void push(Second second);
  void end();  // no more will be pushed

  // What is certain by now; nothing where more must be pushed, or at the end.
  std::optional<OrderedSecond> next();

  const Irregular& irregular() const { return irregular_; }

 private:
  void say(IrregularKind kind, const Second& second, std::int64_t value = 0);
  bool take_repetition(Second& second);
  bool begins_run(const Second& second) const;
  void put(Second second);
  void release(bool all);
  void give(OrderedSecond ordered);
  void give_missing(const Second& second, bool jump);
  bool written(std::uint32_t unix_time) const;
  bool was_missing(std::uint32_t unix_time) const;

  std::size_t rate_;
  std::uint64_t fill_limit_s_;
  std::deque<Second> waiting_;  // in order of time
  std::size_t waiting_samples_ = 0;
  std::optional<std::uint32_t> newest_;  // of the record pushed last
  std::optional<std::uint32_t> last_;    // given out last in this run
  bool run_begins_ = true;               // nothing of this run was given out
  std::optional<std::uint64_t> end_;     // of what was given out last
  std::deque<OrderedSecond> ready_;
  std::map<std::uint32_t, std::uint32_t> written_;  // from, to: seconds that are done with
  std::map<std::uint32_t, std::uint32_t> missing_;  // the latest of those that were missing
  Irregular irregular_;
};

}  // namespace sixpoint::gt3x
