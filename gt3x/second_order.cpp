#include "gt3x/second_order.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace sixpoint::gt3x {
namespace {

// A leap that nothing explains begins here.
constexpr std::uint64_t kLeap_s = 3600;
// Missing stretches that are remembered: what comes later than so many is called repeated.
constexpr std::size_t kMostMissing = 10'000;

bool explained(GapKind kind) { return kind == GapKind::idle_sleep || kind == GapKind::usb; }

using Ranges = std::map<std::uint32_t, std::uint32_t>;  // from, to; apart from each other

// Whether all of `from` to `to` are there; of no seconds, they are.
bool holds(const Ranges& ranges, std::uint64_t from, std::uint64_t to) {
  if (from > to) {
    return true;
  }
  const auto behind = ranges.upper_bound(static_cast<std::uint32_t>(from));
  return behind != ranges.begin() && std::prev(behind)->second >= to;
}

// Mostly the latest range grows by one second.
void mark(Ranges& ranges, std::uint32_t from, std::uint32_t to) {
  auto range = ranges.upper_bound(from);
  if (range != ranges.begin() && std::uint64_t{std::prev(range)->second} + 1 >= from) {
    --range;
    range->second = std::max(range->second, to);
  } else {
    range = ranges.emplace(from, to).first;
  }
  for (auto behind = std::next(range);
       behind != ranges.end() && behind->first <= std::uint64_t{range->second} + 1;
       behind = ranges.erase(behind)) {
    range->second = std::max(range->second, behind->second);
  }
}

// Hands on what the ranges do not hold of `from` to `to`, as from, to.
template <class Take>
void for_each_hole(const Ranges& ranges, std::uint64_t from, std::uint64_t to, Take take) {
  auto range = ranges.upper_bound(static_cast<std::uint32_t>(from));
  if (range != ranges.begin()) {
    from = std::max(from, std::uint64_t{std::prev(range)->second} + 1);
  }
  for (; from <= to; ++range) {
    const std::uint64_t hole_end = range == ranges.end() ? to + 1 : range->first;
    if (from < std::min(hole_end, to + 1)) {
      take(static_cast<std::uint32_t>(from),
           static_cast<std::uint32_t>(std::min(hole_end - 1, to)));
    }
    if (range == ranges.end()) {
      return;
    }
    from = std::uint64_t{range->second} + 1;
  }
}

}  // namespace

std::string_view to_string(GapKind kind) {
  constexpr std::array<std::string_view, 4> kNames = {"idle_sleep", "usb", "damaged",
                                                      "unexplained"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::string_view to_string(IrregularKind kind) {
  constexpr std::array<std::string_view, Irregular::kKinds> kNames = {
      "repeated", "repeated_otherwise", "usb_and_samples", "out_of_order", "late", "odd_size",
      "jump"};
  return kNames[static_cast<std::size_t>(kind)];
}

bool fills_gap(GapKind kind, std::uint64_t seconds, std::uint64_t limit_s) {
  return explained(kind) || seconds <= limit_s;
}

bool Irregular::any() const {
  std::uint64_t all = 0;
  for (const std::uint64_t each : counts) {
    all += each;
  }
  return all > count(IrregularKind::usb_and_samples);
}

SecondOrder::SecondOrder(std::size_t rate, std::uint64_t fill_limit_s)
    : rate_(rate), fill_limit_s_(fill_limit_s) {}

void SecondOrder::say(IrregularKind kind, const Second& second, std::int64_t value) {
  const std::uint64_t number = ++irregular_.counts[static_cast<std::size_t>(kind)];
  if (number <= Irregular::kMostListed) {
    irregular_.places.push_back({kind, second.unix_time, second.offset, value});
  }
}

bool SecondOrder::written(std::uint32_t unix_time) const {
  return holds(written_, unix_time, unix_time);
}
bool SecondOrder::was_missing(std::uint32_t unix_time) const {
  return holds(missing_, unix_time, unix_time);
}

// Whether the second is there already; the better of the two stays.
bool SecondOrder::take_repetition(Second& second) {
  const auto there = std::ranges::lower_bound(waiting_, second.unix_time, {}, &Second::unix_time);
  if (there == waiting_.end() || there->unix_time != second.unix_time) {
    if (!written(second.unix_time)) {
      return false;
    }
    say(was_missing(second.unix_time) ? IrregularKind::late : IrregularKind::repeated, second);
    return true;
  }
  if (there->counts.empty() != second.counts.empty()) {
    say(IrregularKind::usb_and_samples, second);
  } else {
    say(there->counts == second.counts ? IrregularKind::repeated
                                       : IrregularKind::repeated_otherwise,
        second);
  }
  if (second.counts.size() > there->counts.size()) {
    // What lies before the second was said by the record that came first.
    second.missing_before = there->missing_before;
    waiting_samples_ += second.counts.size() - there->counts.size();
    *there = std::move(second);
  }
  return true;
}

// Whether the time leaps to this second from the others of the run.
bool SecondOrder::begins_run(const Second& second) const {
  const std::optional<std::uint32_t> newest =
      waiting_.empty() ? last_ : std::optional(waiting_.back().unix_time);
  if (!newest) {
    return false;
  }
  const std::int64_t time = second.unix_time;
  if (time > *newest) {
    if (explained(second.missing_before)) {
      return false;
    }
    std::uint64_t missing = 0;
    if (written_.size() >= kMostRuns) {  // no clock does this, and counting costs time
      missing = static_cast<std::uint64_t>(time - *newest - 1);
    } else {
      for_each_hole(written_, std::uint64_t{*newest} + 1, second.unix_time - std::uint64_t{1},
                    [&](std::uint32_t from, std::uint32_t to) { missing += to - from + 1; });
    }
    return missing > std::max(kLeap_s, fill_limit_s_);
  }
  if (!run_begins_) {
    return time < *last_;  // of the seconds since the first all are written, or missing
  }
  return time < std::int64_t{waiting_.front().unix_time} - static_cast<std::int64_t>(kLeap_s);
}

void SecondOrder::put(Second second) {
  const auto place = std::ranges::upper_bound(waiting_, second.unix_time, {}, &Second::unix_time);
  if (place != waiting_.end()) {
    say(IrregularKind::out_of_order, second);
  }
  waiting_samples_ += second.counts.size();
  waiting_.insert(place, std::move(second));
}

void SecondOrder::push(Second second) {
  if (rate_ > 0 && !second.counts.empty() && second.counts.size() != rate_) {
    say(IrregularKind::odd_size, second, static_cast<std::int64_t>(second.counts.size()));
  }
  const std::optional<std::uint32_t> before = newest_;
  newest_ = second.unix_time;
  if (take_repetition(second)) {
    release(false);
    return;
  }
  if (begins_run(second)) {
    say(IrregularKind::jump, second,
        std::int64_t{second.unix_time} - std::int64_t{before.value_or(second.unix_time)});
    if (written_.size() >= kMostRuns) {
      return;  // no clock does this; each run costs memory
    }
    release(true);
    if (second.unix_time > *last_) {
      give_missing(second, true);
    }
    last_.reset();
    run_begins_ = true;
  }
  put(std::move(second));
  release(false);
}

void SecondOrder::end() { release(true); }

// Hands on what nothing can come before any more; `all`: everything.
void SecondOrder::release(bool all) {
  while (!waiting_.empty()) {
    const Second& first = waiting_.front();
    if (!all && first.unix_time == newest_) {
      return;  // the next record may be of the same second
    }
    const bool full = waiting_.size() > kMostWaiting_s || waiting_samples_ > kMostWaitingSamples;
    if (!run_begins_ && first.unix_time > *last_ + std::uint64_t{1}) {
      if (!all && !full &&
          !holds(written_, *last_ + std::uint64_t{1}, first.unix_time - std::uint64_t{1})) {
        return;  // for what is missing
      }
      give_missing(first, false);
    }
    waiting_samples_ -= first.counts.size();
    OrderedSecond ordered;
    ordered.unix_time = first.unix_time;
    ordered.second = std::move(waiting_.front());
    waiting_.pop_front();
    last_ = ordered.unix_time;
    run_begins_ = false;
    mark(written_, ordered.unix_time, ordered.unix_time);
    give(std::move(ordered));
  }
}

// The seconds between what was given last and `second` that are not there. Those that a jump leaves
// out may still come.
void SecondOrder::give_missing(const Second& second, bool jump) {
  const std::uint64_t first = std::uint64_t{*last_} + 1;
  for_each_hole(written_, first, second.unix_time - std::uint64_t{1},
                [&](std::uint32_t from, std::uint32_t to) {
                  OrderedSecond gap;
                  gap.unix_time = from;
                  gap.missing = to - from + 1;
                  gap.gap = second.missing_before;
                  gap.filled = !jump && fills_gap(gap.gap, gap.missing, fill_limit_s_);
                  give(std::move(gap));
                  if (!jump) {
                    missing_.emplace(from, to);
                  }
                  if (missing_.size() > kMostMissing) {
                    missing_.erase(missing_.begin());
                  }
                });
  if (!jump && first < second.unix_time) {  // what is left out is done with as well
    mark(written_, static_cast<std::uint32_t>(first), second.unix_time - 1);
  }
}

void SecondOrder::give(OrderedSecond ordered) {
  ordered.leapt = end_ && ordered.unix_time != *end_;
  end_ = std::uint64_t{ordered.unix_time} + std::max(ordered.missing, 1U);
  ready_.push_back(std::move(ordered));
}

std::optional<OrderedSecond> SecondOrder::next() {
  std::optional<OrderedSecond> ordered;
  if (!ready_.empty()) {
    ordered = std::move(ready_.front());
    ready_.pop_front();
  }
  return ordered;
}

}  // namespace sixpoint::gt3x
