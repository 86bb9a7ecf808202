#include "repair/rescale/rescaled_log.h"

#include <algorithm>
#include <cstring>

#include <fmt/format.h>

#include "gt3x/forms/parameters.h"
#include "gt3x/log/record.h"
#include "repair/triage/still_scan.h"

namespace sixpoint::repair {
namespace {

// Samples with an axis at the limit of their record.
std::uint64_t count_at_limit(std::span<const gt3x::Counts> samples, calib::RecordWidth width) {
  const int low = calib::lowest_count(width);
  const int high = calib::highest_count(width);
  // Nearly no record holds one, and the range of a whole record is found quickly.
  const gt3x::CountRange all = gt3x::range_of(samples);
  if (all.low > low && all.high < high) {
    return 0;
  }
  return static_cast<std::uint64_t>(std::ranges::count_if(samples, [&](const auto& sample) {
    return std::ranges::any_of(sample,
                               [&](std::int16_t count) { return count <= low || count >= high; });
  }));
}

// What a pass over the samples before and after finds; compared as words, because as arrays they
// would be compared by a call of memcmp each.
struct Compared {
  std::uint64_t changed = 0;
  bool zeros = false;  // a sample that is zero on all axes was there before
};
Compared compare(std::span<const gt3x::Counts> before, std::span<const gt3x::Counts> after) {
  const auto word_of = [](const gt3x::Counts& sample) {
    std::uint32_t xy = 0;
    std::memcpy(&xy, sample.data(), sizeof xy);
    return xy | std::uint64_t{static_cast<std::uint16_t>(sample[2])} << 32U;
  };
  Compared found;
  std::uint64_t zeros = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const std::uint64_t was = word_of(before[i]);
    found.changed += was != word_of(after[i]) ? 1U : 0U;
    zeros += was == 0 ? 1U : 0U;
  }
  found.zeros = zeros > 0;
  return found;
}

bool is_zero(const gt3x::Counts& sample) { return (sample[0] | sample[1] | sample[2]) == 0; }

// A unit that charges stores zeros on all axes: no measurement, so they stay zeros. Rescaled they
// would look like rest in a wrong direction. A single zero may be a measurement: only three in a
// row, or zeros up to the record's first or last sample, are taken for charging.
void keep_charging_zeros(std::span<const gt3x::Counts> samples, std::span<gt3x::Counts> fresh) {
  constexpr std::size_t kLeastRun = 3;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    std::size_t end = i;
    while (end < samples.size() && is_zero(samples[end])) {
      ++end;
    }
    if (end - i >= kLeastRun || (end > i && (i == 0 || end == samples.size()))) {
      std::fill(fresh.begin() + static_cast<std::ptrdiff_t>(i),
                fresh.begin() + static_cast<std::ptrdiff_t>(end), gt3x::Counts{});
    }
    i = std::max(i, end);
  }
}

bool is_epoch(const gt3x::Record& record) {
  using enum gt3x::RecordType;
  return record.is(epoch) || record.is(epoch2) || record.is(epoch3) || record.is(epoch4);
}

}  // namespace

RescaledLog::RescaledLog(gt3x::LogReader log, const RescaledLogOptions& options)
    : log_(std::move(log)),
      options_(options),
      still_(options.accel_scale_lsb_per_g),
      accel_scale_lsb_per_g_(options.accel_scale_lsb_per_g) {}

Result<std::unique_ptr<RescaledLog>> RescaledLog::make(gt3x::LogReader log,
                                                       const RescaledLogOptions& options) {
  if (options.mark.size() > gt3x::kMaxPayload) {  // cut, it would be none: repaired once more
    return fail(
        ErrorCode::bad_data,
        fmt::format("the mark of the repair has {} bytes, a record of the log has room for {}",
                    options.mark.size(), gt3x::kMaxPayload),
        {}, "look at the serial number in info.txt, which the mark holds");
  }
  std::unique_ptr<RescaledLog> source(new RescaledLog(std::move(log), options));
  if (options.first_constants.has_value()) {
    SIXPOINT_CHECK(source->set_source(options.first_constants, options.accel_scale_lsb_per_g));
  }
  return source;
}

void RescaledLog::survey_with(LogSurvey& survey) {
  survey_ = &survey;
  survey.on_block([this](std::uint64_t first_sample, int samples) {
    still_.expect({first_sample, samples});
  });
}

void RescaledLog::expect_still(std::span<const StillWindow> windows) {
  for (const StillWindow& window : windows) {
    still_.expect(window);
  }
}

Status RescaledLog::set_source(const std::optional<StoredConstants>& constants,
                               double accel_scale_lsb_per_g) {
  still_.set_scale(accel_scale_lsb_per_g);
  if (!options_.fresh.has_value() || !constants ||
      (map_ && constants_ == constants && accel_scale_lsb_per_g_ == accel_scale_lsb_per_g)) {
    return {};
  }
  const auto known = std::ranges::find_if(maps_, [&](const Map& map) {
    return map.undone == *constants && map.accel_scale_lsb_per_g == accel_scale_lsb_per_g;
  });
  const auto take = [&](std::size_t map) {
    map_ = map;
    constants_ = constants;
    accel_scale_lsb_per_g_ = accel_scale_lsb_per_g;
  };
  if (known != maps_.end()) {
    take(static_cast<std::size_t>(known - maps_.begin()));
    return {};
  }
  if (maps_.size() == kMaxSetsOfConstants) {
    return fail(ErrorCode::bad_data, "the log holds more sets of constants than a recording has",
                {}, "download the recording from the unit again");
  }
  const auto limit =
      options_.beyond_12_bits ? calib::RecordWidth::bits16 : calib::RecordWidth::bits12;
  SIXPOINT_ASSIGN(const auto reversal,
                  calib::Reversal::make(*constants, accel_scale_lsb_per_g, limit));
  calib::Rescale::Options rescale;
  rescale.output = options_.wide ? calib::RecordWidth::bits16 : limit;
  rescale.affine = options_.affine;
  rescale.cross_axis = options_.cross_axis;
  SIXPOINT_ASSIGN(auto map, calib::Rescale::make(reversal, *options_.fresh, rescale));
  maps_.push_back({*constants, accel_scale_lsb_per_g, std::move(map)});
  take(maps_.size() - 1);
  return {};
}

void RescaledLog::put_samples(const gt3x::Record& record) {
  const bool packed = record.is(gt3x::RecordType::activity);
  if (packed) {
    gt3x::unpack_activity(record.payload, samples_);
  } else {
    gt3x::unpack_activity2(record.payload, samples_);
  }
  const auto limit_before =
      options_.beyond_12_bits ? calib::RecordWidth::bits16 : calib::RecordWidth::bits12;
  const auto limit_after = options_.wide ? calib::RecordWidth::bits16 : limit_before;
  fresh_samples_.resize(samples_.size());
  if (options_.undo_rotation || !map_.has_value()) {
    std::ranges::copy(samples_, fresh_samples_.begin());
  }
  if (options_.undo_rotation) {
    undo_rotation(fresh_samples_, limit_before);
  }
  if (map_.has_value()) {
    calib::RescaleTally counts;
    maps_[*map_].rescale.apply(options_.undo_rotation ? fresh_samples_ : samples_, fresh_samples_,
                               counts);
    tally_.affine_counts += counts.affine[0] + counts.affine[1] + counts.affine[2];
  }
  Compared compared = compare(samples_, fresh_samples_);
  if (map_.has_value() && compared.zeros) {
    keep_charging_zeros(samples_, fresh_samples_);
    compared = compare(samples_, fresh_samples_);
  }
  const std::uint64_t clipped = count_at_limit(samples_, limit_before);
  tally_.clipped_before += clipped;
  // A wider record has room for what a clipped count is mapped to; its true value is as unknown.
  tally_.clipped_after += std::max(count_at_limit(fresh_samples_, limit_after), clipped);
  tally_.changed_samples += compared.changed;
  tally_.samples += samples_.size();
  ++tally_.sample_records;
  still_.push(fresh_samples_);

  if (packed && options_.wide) {
    // A long record may hold more samples than one of 16 bits can: they go on in another one.
    for (std::span<const gt3x::Counts> left = fresh_samples_; !left.empty();) {
      const auto part = left.first(std::min(left.size(), kMaxWideSamples));
      payload_.clear();
      gt3x::append_activity2(payload_, part);
      gt3x::append_record(pending_, gt3x::RecordType::activity2, record.unix_time, payload_);
      left = left.subspan(part.size());
    }
    return;
  }
  payload_.clear();
  if (packed) {
    gt3x::append_activity(payload_, fresh_samples_);
    // The unused nibble behind an odd number of values, and bytes that make no whole sample, stay.
    if (samples_.size() % 2 == 1 && !payload_.empty()) {
      payload_.back() = static_cast<std::uint8_t>((payload_.back() & 0xF0U) |
                                                  (record.payload[payload_.size() - 1] & 0x0FU));
    }
  } else {
    gt3x::append_activity2(payload_, fresh_samples_);
  }
  if (payload_.size() < record.payload.size()) {
    const auto rest = record.payload.subspan(payload_.size());
    payload_.insert(payload_.end(), rest.begin(), rest.end());
  }
  gt3x::append_record(pending_, static_cast<gt3x::RecordType>(record.type), record.unix_time,
                      payload_);
}

std::optional<std::uint64_t> RescaledLog::size() const {
  if (!options_.size || options_.mark.empty()) {
    return options_.size;
  }
  return *options_.size + options_.mark.size() + gt3x::kRecordOverhead;
}

void RescaledLog::put_mark(std::uint32_t unix_time) {
  if (!options_.mark.empty()) {
    gt3x::append_record(pending_, gt3x::RecordType::metadata, unix_time, as_bytes(options_.mark));
  }
  marked_ = true;
}

Result<bool> RescaledLog::pull() {
  pending_.clear();
  taken_ = 0;
  SIXPOINT_ASSIGN(const auto item, log_.next());
  const bool good = item && item->kind == gt3x::LogItem::Kind::record && item->record.checksum_ok;
  if (!marked_ && (good || !item)) {
    put_mark(good ? item->record.unix_time : 0);
  }
  if (!item.has_value()) {
    return !pending_.empty();
  }
  if (survey_ != nullptr) {
    SIXPOINT_CHECK(survey_->take(*item));
  }
  const gt3x::Record& record = item->record;
  if (item->kind == gt3x::LogItem::Kind::record && record.checksum_ok) {
    const bool activity =
        record.is(gt3x::RecordType::activity) || record.is(gt3x::RecordType::activity2);
    if (activity && record.payload.size() > 1) {
      put_samples(record);
      return true;
    }
    if (is_epoch(record)) {
      ++tally_.epoch_records;
    } else if (record.is(gt3x::RecordType::parameters)) {
      const auto parameters = gt3x::parse_parameters(record.payload);
      if (parameters) {
        SIXPOINT_CHECK(
            set_source(parameters->constants ? parameters->constants : constants_,
                       parameters->accel_scale_lsb_per_g.value_or(options_.accel_scale_lsb_per_g)));
      }
    }
  } else if (options_.leave_out_damage && item->kind != gt3x::LogItem::Kind::stray) {
    return true;
  }
  pending_.insert(pending_.end(), item->raw.begin(), item->raw.end());
  return true;
}

Result<std::size_t> RescaledLog::read(std::span<std::uint8_t> out) {
  std::size_t done = 0;
  while (done < out.size()) {
    if (taken_ == pending_.size()) {
      SIXPOINT_ASSIGN(const bool more, pull());
      if (!more) {
        break;
      }
      continue;
    }
    const std::size_t count = std::min(out.size() - done, pending_.size() - taken_);
    std::copy_n(pending_.begin() + static_cast<std::ptrdiff_t>(taken_), count,
                out.begin() + static_cast<std::ptrdiff_t>(done));
    taken_ += count;
    done += count;
  }
  return done;
}

}  // namespace sixpoint::repair
