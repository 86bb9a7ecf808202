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

bool holds(const std::map<std::uint32_t, std::uint32_t>& ranges, std::uint32_t time) {
  const auto behind = ranges.upper_bound(time);
  return behind != ranges.begin() && std::prev(behind)->second >= time;
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

bool SecondOrder::written(std::uint32_t unix_time) const { return holds(written_, unix_time); }
bool SecondOrder::was_missing(std::uint32_t unix_time) const { return holds(missing_, unix_time); }

// Mostly the latest range grows by one second.
void SecondOrder::mark_written(std::uint32_t from, std::uint32_t to) {
  auto range = written_.upper_bound(from);
  if (range != written_.begin() && std::uint64_t{std::prev(range)->second} + 1 >= from) {
    --range;
    range->second = std::max(range->second, to);
  } else {
    range = written_.emplace(from, to).first;
  }
  for (auto behind = std::next(range);
       behind != written_.end() && behind->first <= std::uint64_t{range->second} + 1;
       behind = written_.erase(behind)) {
    range->second = std::max(range->second, behind->second);
  }
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
  const std::int64_t time = second.unix_time;
  const std::optional<std::uint32_t> newest =
      waiting_.empty() ? last_ : std::optional(waiting_.back().unix_time);
  if (!newest) {
    return false;
  }
  const std::int64_t missing = time - std::int64_t{*newest} - 1;
  if (missing > 0) {
    return !explained(second.missing_before) &&
           static_cast<std::uint64_t>(missing) > std::max(kLeap_s, fill_limit_s_);
  }
  // Within the run the caller finds a place for it.
  const std::int64_t first = run_begins_ ? std::int64_t{waiting_.front().unix_time} : *last_;
  return time < first - static_cast<std::int64_t>(kLeap_s);
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
    if (last_ && second.unix_time > *last_) {
      OrderedSecond gap;
      gap.unix_time = *last_ + 1;
      gap.missing = second.unix_time - gap.unix_time;
      gap.gap = second.missing_before;
      gap.filled = false;
      ready_.push_back(std::move(gap));
    }
    jumped_back_ = last_ && second.unix_time <= *last_;
    last_.reset();
    run_begins_ = true;
  } else if (!run_begins_ && second.unix_time <= *last_) {
    say(IrregularKind::late, second);
    return;
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
      if (!all && !full) {
        return;
      }
      OrderedSecond gap;
      gap.unix_time = *last_ + 1;
      gap.missing = first.unix_time - gap.unix_time;
      gap.gap = first.missing_before;
      gap.filled = fills_gap(gap.gap, gap.missing, fill_limit_s_);
      // What is left out is done with as well.
      mark_written(gap.unix_time, first.unix_time - 1);
      missing_.emplace(gap.unix_time, first.unix_time - 1);
      if (missing_.size() > kMostMissing) {
        missing_.erase(missing_.begin());
      }
      ready_.push_back(std::move(gap));
    }
    waiting_samples_ -= first.counts.size();
    give(std::move(waiting_.front()));
    waiting_.pop_front();
  }
}

void SecondOrder::give(Second second) {
  mark_written(second.unix_time, second.unix_time);
  last_ = second.unix_time;
  run_begins_ = false;
  OrderedSecond& ordered = ready_.emplace_back();
  ordered.unix_time = second.unix_time;
  ordered.jumped_back = std::exchange(jumped_back_, false);
  ordered.second = std::move(second);
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
