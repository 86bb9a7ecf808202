#include "calib/scaling.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

namespace sixpoint::calib {

namespace {

constexpr int kRawLow = -32768;  // any sensor with counts of up to 16 bits
constexpr int kRawHigh = 32767;

// 2 scale (m - zero) / (positive - negative). Both products are exact in a double (accel_scale has
// at most 24 significant bits), so the one division decides every half-way case correctly.
double firmware_value(double twice_scale, int zero, int span, int raw) {
  return twice_scale * (raw - zero) / span;
}

std::size_t table_size(RecordWidth width) { return width == RecordWidth::bits12 ? 4096 : 65536; }

// The raw counts whose value lies within the record's range, and one count more on either side:
// no other can lead to a stored count, half-way cases included.
struct RawRange {
  int low = 0;
  int high = 0;
};
RawRange raw_range(double twice_scale, int zero, int span, RecordWidth width) {
  const double one = zero + (lowest_count(width) - 1.0) * span / twice_scale;
  const double other = zero + (highest_count(width) + 1.0) * span / twice_scale;
  const auto inside = [](double raw) {
    return static_cast<int>(std::clamp(raw, double{kRawLow}, double{kRawHigh}));
  };
  return {inside(std::floor(std::min(one, other)) - 1),
          inside(std::ceil(std::max(one, other)) + 1)};
}

Status check_scale(double accel_scale) {
  if (!(accel_scale >= 1 && accel_scale <= 32768)) {
    return fail(ErrorCode::bad_data,
                fmt::format("an acceleration scale of {} LSB/g is impossible", accel_scale),
                "scaling", "the recording's info.txt or PARAMETERS record is damaged");
  }
  return {};
}

// How many counts 16 bits can say; the count 0 stands in the middle.
constexpr int kAnyCount = 65536;

// One loop over all counts, which the compiler makes one over many at a time.
bool none_clipped(const Reversal& reversal, std::span<const StoredCounts> samples) {
  if (samples.empty()) {
    return true;
  }
  const std::int16_t* const counts = samples.front().data();
  std::int16_t low = 0;
  std::int16_t high = 0;
  for (std::size_t i = 0; i < kAxes * samples.size(); ++i) {
    low = std::min(low, counts[i]);
    high = std::max(high, counts[i]);
  }
  return !reversal.clipped(low) && !reversal.clipped(high);
}

}  // namespace

int round_half_away(double value) {
  constexpr double kLimit = 1 << 30;
  if (std::isnan(value)) {
    return 0;
  }
  return static_cast<int>(std::round(std::clamp(value, -kLimit, kLimit)));
}

Result<Reversal> Reversal::make(const StoredConstants& stored, double accel_scale_lsb_per_g,
                                RecordWidth width) {
  SIXPOINT_CHECK(check_scale(accel_scale_lsb_per_g));
  Reversal reversal;
  SIXPOINT_ASSIGN(reversal.calibration_, calibration_from(stored));
  reversal.accel_scale_ = accel_scale_lsb_per_g;
  reversal.width_ = width;
  const int low = lowest_count(width);
  const int high = highest_count(width);
  for (std::size_t a = 0; a < kAxes; ++a) {
    auto& first = reversal.first_[a];
    auto& number = reversal.number_[a];
    auto& tie = reversal.tie_[a];
    first.assign(table_size(width), 0);
    number.assign(table_size(width), 0);
    tie.assign(table_size(width), 0);
    const int span = stored.positive_lsb[a] - stored.negative_lsb[a];
    const double twice_scale = 2 * accel_scale_lsb_per_g;
    const auto value_of = [&](int raw) {
      return firmware_value(twice_scale, stored.zero_lsb[a], span, raw);
    };
    const RawRange range = raw_range(twice_scale, stored.zero_lsb[a], span, width);
    const auto slot = [&](int count) { return static_cast<std::size_t>(count - low); };
    for (int raw = range.low; raw <= range.high; ++raw) {
      const int count = round_half_away(value_of(raw));
      if (count < low || count > high) {
        continue;
      }
      const std::size_t i = slot(count);
      if (number[i] == 0) {
        first[i] = static_cast<std::int16_t>(raw);
      }
      ++number[i];
    }
    // A firmware that computes in single precision may send an exact half to the other side. That
    // counts as an explanation only where there is no better one.
    for (int raw = range.low; raw <= range.high; ++raw) {
      const double value = value_of(raw);
      if (std::abs(value - std::trunc(value)) != 0.5) {
        continue;
      }
      const int other = static_cast<int>(std::clamp(std::trunc(value), -1e6, 1e6));
      if (other < low || other > high || number[slot(other)] != 0) {
        continue;
      }
      first[slot(other)] = static_cast<std::int16_t>(raw);
      number[slot(other)] = 1;
      tie[slot(other)] = 1;
    }
    auto& raw_table = reversal.raw_[a];
    raw_table.resize(table_size(width));
    for (int count = low; count <= high; ++count) {
      const std::size_t i = slot(count);
      raw_table[i] =
          number[i] > 0 ? first[i] + 0.5 * (number[i] - 1) : reversal.affine_raw_lsb(a, count);
    }
  }
  reversal.sort_counts();
  return reversal;
}

Result<Reversal> Reversal::of_raw_counts(double accel_scale_lsb_per_g, RecordWidth width) {
  SIXPOINT_CHECK(check_scale(accel_scale_lsb_per_g));
  Reversal reversal;
  reversal.accel_scale_ = accel_scale_lsb_per_g;
  reversal.width_ = width;
  reversal.raw_counts_ = true;
  for (std::size_t a = 0; a < kAxes; ++a) {
    reversal.calibration_.sensitivity_g_per_lsb[a] = 1.0 / accel_scale_lsb_per_g;
    reversal.calibration_.zero_lsb[a] = 0;
    reversal.number_[a].assign(table_size(width), 1);
    reversal.tie_[a].assign(table_size(width), 0);
    for (int count = lowest_count(width); count <= highest_count(width); ++count) {
      reversal.first_[a].push_back(static_cast<std::int16_t>(count));
      reversal.raw_[a].push_back(count);
    }
  }
  reversal.sort_counts();
  return reversal;
}

RawCandidates Reversal::candidates(std::size_t axis, int stored_count) const {
  const std::size_t i = index(stored_count);
  return {first_[axis][i], number_[axis][i], tie_[axis][i] != 0, raw_[axis][i]};
}

// Runs over every count of every recording, so without a branch.
void tally(const Reversal& reversal, std::span<const StoredCounts> samples,
           PlausibilityTally& counts) {
  // Where positive - negative is 2 accel_scale and more no count is left out, and few samples are
  // at the limit.
  if (!reversal.some_impossible_ && none_clipped(reversal, samples)) {
    counts.counts += kAxes * samples.size();
    return;
  }
  // Of the count 0.
  const PerAxis<const std::uint8_t*> kind = {reversal.kind_[0].data() + kAnyCount / 2,
                                             reversal.kind_[1].data() + kAnyCount / 2,
                                             reversal.kind_[2].data() + kAnyCount / 2};
  std::size_t clipped = 0;
  std::size_t sum = 0;
  for (const StoredCounts& sample : samples) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      const std::size_t here = kind[a][sample[a]];
      clipped += here & Reversal::kClipped;
      sum += here;
    }
  }
  const std::size_t impossible = (sum - clipped) / Reversal::kImpossible;
  counts.counts += kAxes * samples.size() - clipped;
  counts.impossible += impossible;
}

void Reversal::sort_counts() {
  for (std::size_t a = 0; a < kAxes; ++a) {
    // Of every count that 16 bits can say: what lies beyond the width is at its limit.
    kind_[a].assign(kAnyCount, kClipped);
    const auto first = kind_[a].begin() + kAnyCount / 2 + lowest_count(width_);
    std::transform(
        number_[a].begin() + 1, number_[a].end() - 1, first + 1,
        [](std::uint16_t number) { return number == 0 ? kImpossible : std::uint8_t{0}; });
    some_impossible_ = some_impossible_ || std::ranges::count(kind_[a], kImpossible) > 0;
  }
}

Result<Rescale> Rescale::make(const Reversal& reversal, const Calibration& fresh,
                              const Options& options) {
  SIXPOINT_CHECK(validate(fresh));
  Rescale rescale;
  rescale.input_ = reversal.width();
  rescale.output_ = options.output;
  rescale.cross_axis_ = options.cross_axis;
  rescale.has_terms_ = options.cross_axis != PerAxis<double>{};
  const bool is_identity = fresh == reversal.calibration() && !rescale.has_terms_;
  if (!all_finite(options.cross_axis)) {
    return fail(ErrorCode::bad_data, "a cross-axis term is not finite", "scaling",
                "take the constants from the store or from another recording");
  }
  const int low = lowest_count(reversal.width());
  const int high = highest_count(reversal.width());
  const int out_low = lowest_count(options.output);
  const int out_high = highest_count(options.output);
  const bool widens = out_high > high;
  for (std::size_t a = 0; a < kAxes; ++a) {
    auto& entries = rescale.entries_[a];
    entries.reserve(table_size(reversal.width()));
    const double scale = fresh.sensitivity_g_per_lsb[a] * reversal.accel_scale_lsb_per_g();
    for (int count = low; count <= high; ++count) {
      const RawCandidates candidates = reversal.candidates(a, count);
      const bool affine = options.affine || candidates.number == 0;
      const double raw = affine ? reversal.affine_raw_lsb(a, count) : candidates.middle;
      const bool at_limit = count == low || count == high;
      const double level = scale * (raw - fresh.zero_lsb[a]);
      int fresh_count = round_half_away(level);
      if (rescale.has_terms_) {
        rescale.level_[a].push_back(level);
      }
      if (is_identity) {
        fresh_count = count;
      } else if (at_limit && !widens) {
        fresh_count = count == low ? out_low : out_high;
      }
      std::uint8_t flag = 0;
      if (at_limit) {
        flag |= kClippedBefore;
      } else if (fresh_count < out_low || fresh_count > out_high) {
        flag |= kClippedAfter;
      }
      if (affine && !at_limit) {
        flag |= kAffine;
      }
      entries.push_back(entry_of(std::clamp(fresh_count, out_low, out_high), flag));
    }
  }
  return rescale;
}

StoredCounts Rescale::with_terms(const StoredCounts& in, PerAxis<std::uint8_t>& flags) const {
  PerAxis<double> u{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    const std::size_t slot = index(in[a]);
    u[a] = level_[a][slot];
    flags[a] = flags_of(entries_[a][slot]) & (kClippedBefore | kAffine);
  }
  const auto& [xy, xz, yz] = cross_axis_;
  const PerAxis<double> q = {u[0] + xy * u[1] + xz * u[2], u[1] + xy * u[0] + yz * u[2],
                             u[2] + xz * u[0] + yz * u[1]};
  const int low = lowest_count(output_);
  const int high = highest_count(output_);
  const bool widens = high > highest_count(input_);
  StoredCounts out{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    const bool at_limit = (flags[a] & kClippedBefore) != 0;
    if (at_limit && !widens) {
      out[a] = count_of(entry(a, in[a]));
      continue;
    }
    const int count = round_half_away(q[a]);
    if (!at_limit && (count < low || count > high)) {
      flags[a] |= kClippedAfter;
    }
    out[a] = static_cast<std::int16_t>(std::clamp(count, low, high));
  }
  return out;
}

void Rescale::apply(std::span<const StoredCounts> in, std::span<StoredCounts> out,
                    RescaleTally& counts) const {
  const std::size_t size = std::min(in.size(), out.size());
  counts.samples += size;
  const auto count = [&](const PerAxis<std::uint8_t>& flags) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      counts.clipped_before[a] += (flags[a] & kClippedBefore) != 0 ? 1U : 0U;
      counts.clipped_after[a] += (flags[a] & kClippedAfter) != 0 ? 1U : 0U;
      counts.affine[a] += (flags[a] & kAffine) != 0 ? 1U : 0U;
    }
  };
  if (has_terms_) {
    for (std::size_t i = 0; i < size; ++i) {
      PerAxis<std::uint8_t> flags{};
      out[i] = with_terms(in[i], flags);
      count(flags);
    }
    return;
  }
  // Every count of a recording is looked up here, so without a branch. Few chunks hold a count with
  // a flag. `in` may be `out`: a chunk is written when its flags were counted.
  constexpr std::size_t kChunk = 256;
  std::array<StoredCounts, kChunk> fresh;
  const auto low = static_cast<std::int16_t>(lowest_count(input_));
  const auto high = static_cast<std::int16_t>(highest_count(input_));
  // Of the count 0.
  const PerAxis<const Entry*> tables = {&entries_[0][index(0)], &entries_[1][index(0)],
                                        &entries_[2][index(0)]};
  for (std::size_t begin = 0; begin < size; begin += kChunk) {
    const auto chunk = in.subspan(begin, std::min(kChunk, size - begin));
    // On its own, because it is done for many counts at once.
    const std::int16_t* const counts_in = chunk.front().data();
    std::int16_t* const inside = fresh.front().data();
    for (std::size_t i = 0; i < kAxes * chunk.size(); ++i) {
      inside[i] = std::clamp(counts_in[i], low, high);
    }
    Entry any = 0;
    for (std::size_t i = 0; i < chunk.size(); ++i) {
      for (std::size_t a = 0; a < kAxes; ++a) {
        const Entry found = tables[a][fresh[i][a]];
        fresh[i][a] = count_of(found);
        any |= found;
      }
    }
    if (flags_of(any) != 0) {
      for (const StoredCounts& sample : chunk) {
        count({flags_of(entry(0, sample[0])), flags_of(entry(1, sample[1])),
               flags_of(entry(2, sample[2]))});
      }
    }
    std::copy_n(fresh.begin(), chunk.size(), out.begin() + static_cast<std::ptrdiff_t>(begin));
  }
}

}  // namespace sixpoint::calib
