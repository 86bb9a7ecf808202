// The samples of a recording, second by second, as stored counts; and what lies between them.
//
//   SampleReader samples(recording);
//   for (;;) {
//     SIXPOINT_ASSIGN(const auto item, samples.next());
//     if (!item) break;
//     if (item->kind == SampleItem::Kind::recorded) seconds.push_back(item->counts.front());
//   }
//
// Items come in the order of the recording's clock, each second once, by the rule of
// second_order.h; irregular() says what did not fit. As ReadOrder::of_the_file they come as they
// were recorded, and no gaps between them. A record whose checksum fails gives no samples: its
// second is missing (kind gap, `damaged`). Memory is bounded.
//
// Where the second is not contiguous with the one before, a gap stands between them, or broke_order
// is set; so who wants runs of unbroken data starts a new run at everything that is not `recorded`,
// and where `broke_order` is set.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "gt3x/forms/clock.h"
#include "gt3x/forms/parameters.h"
#include "gt3x/log/samples.h"
#include "gt3x/recording.h"
#include "gt3x/second_order.h"

namespace sixpoint::gt3x {

struct SampleItem {
  enum class Kind {
    recorded,  // `counts`: one second
    usb,       // a one-byte record: a second without data
    gap,       // `seconds` seconds without any record, from unix_time on
  };
  Kind kind = Kind::recorded;
  std::uint32_t unix_time = 0;
  std::uint32_t seconds = 1;
  GapKind gap = GapKind::unexplained;
  bool filled = true;  // of gaps: fills_gap()
  // It does not begin where the item before ended; in the order of the file, it is not later.
  bool broke_order = false;

  // Of `recorded` only. Counts and parameters stay until the next call of next(). Counts are in the
  // units of the record: LSB at the file's scale, or raw sensor counts for ACTIVITY3.
  std::span<const Counts> counts;
  RecordType type = RecordType::activity;
  std::int16_t limit_min = kMin12;  // a value at one of these was clipped, or may have been
  std::int16_t limit_max = kMax12;
  const Parameters* parameters = nullptr;  // in force; nullptr where none came before

  // Whether any axis of a sample is at a limit of its record.
  bool clipped(const Counts& sample) const {
    for (const std::int16_t value : sample) {
      if (value == limit_min || value == limit_max) {
        return true;
      }
    }
    return false;
  }
};

enum class ReadOrder { of_the_clock, of_the_file };

class SampleReader {
 public:
  // The reader keeps open what it needs: `recording` may end before it.
  explicit SampleReader(Recording& recording, ReadOrder order = ReadOrder::of_the_clock,
                        std::uint64_t fill_limit_s = kUsualFillLimit_s);
  SampleReader(SampleReader&&) noexcept;
  SampleReader& operator=(SampleReader&&) noexcept;
  ~SampleReader();

  // The next item; nothing at the end. Errors as of LogReader::next(). Behind the last record, a
  // gap up to the file's Last Sample Time is handed out, where info.txt names one and the clock was
  // not set back.
  Result<std::optional<SampleItem>> next();

  // Of the records read so far (empty for the old form).
  const LogStatistics& statistics() const;
  const Irregular& irregular() const;
  // By what was read so far; complete at the first sample of a file as units write it.
  Clock clock() const;

  // Every PARAMETERS record met so far, but one that repeats the set before it; of more than
  // kMaxParameterSets the later ones are in force all the same, and the last is kept.
  static constexpr std::size_t kMaxParameterSets = 100;
  const std::vector<std::shared_ptr<const ParameterSet>>& parameter_sets() const;
  // True once samples were recorded under different constants: a file that says two things.
  bool constants_changed() const;
  std::uint64_t unreadable_parameters() const;  // PARAMETERS records that make no sense

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// The scale of stored counts: ACCEL_SCALE of the parameters in force, else "Acceleration Scale" of
// info.txt, else what the serial number's family uses; nothing where none of them says. For .agdc
// files this is not a scale but 1: they hold raw counts (agdc.h).
std::optional<double> accel_scale_lsb_per_g(const Info& info, const Parameters* parameters);

}  // namespace sixpoint::gt3x
