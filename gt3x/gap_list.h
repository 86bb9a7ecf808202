// The gaps of a recording, as they come by while its samples are read.
//
//   SampleReader samples(recording);
//   GapList gaps;
//   for (;;) {
//     SIXPOINT_ASSIGN(const auto item, samples.next());
//     if (!item) break;
//     if (item->kind != SampleItem::Kind::recorded) gaps.add(*item);
//   }
//   gaps.seconds();
//
// A one-byte record (USB) and the missing seconds behind it are one stretch of charging.
#pragma once

#include <cstdint>
#include <vector>

#include "gt3x/sample_reader.h"

namespace sixpoint::gt3x {

struct Gap {
  std::uint32_t start = 0;  // Unix time
  std::uint64_t seconds = 0;
  GapKind kind = GapKind::unexplained;
  bool filled = true;  // fills_gap(); what is not filled may have been recorded later in the file
};

class GapList {
 public:
  static constexpr std::size_t kMostListed = 10'000;  // the counts are of all

  // An item that is not `recorded`.
  void add(const SampleItem& item);

  const std::vector<Gap>& listed() const { return listed_; }
  std::uint64_t count() const { return count_; }
  std::uint64_t seconds() const { return seconds_; }

 private:
  std::vector<Gap> listed_;
  std::uint64_t count_ = 0;
  std::uint64_t seconds_ = 0;
};

// The gaps of what the reader has not read yet; reads it to its end. Errors as SampleReader::next().
Result<GapList> gaps_of(SampleReader& reader);

}  // namespace sixpoint::gt3x
