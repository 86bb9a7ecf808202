#include "gt3x/sample_reader.h"

#include <cmath>
#include <cstdlib>
#include <limits>

#include "gt3x/forms/model.h"
#include "gt3x/forms/sample_rate.h"

namespace sixpoint::gt3x {

std::optional<double> accel_scale_lsb_per_g(const Info& info, const Parameters* parameters) {
  if (parameters != nullptr && parameters->accel_scale_lsb_per_g) {
    return parameters->accel_scale_lsb_per_g;
  }
  if (const auto scale = info.accel_scale_lsb_per_g()) {
    return scale;
  }
  return default_accel_scale_lsb_per_g(info.serial());
}

struct SampleReader::State {
  State(const Recording& opened, ReadOrder wanted, std::uint64_t limit_s)
      : recording(opened),
        form(opened.form()),
        info(opened.info()),
        by_clock(wanted == ReadOrder::of_the_clock),
        fill_limit_s(limit_s),
        order(whole_second(), limit_s) {
    clock.take_info(info);
    clock.old_form = form == RecordingForm::activity;
    if (form == RecordingForm::log) {
      auto reader = recording.open_log();
      if (reader) {
        log.emplace(*std::move(reader));
      } else {
        failure = std::move(reader).error();
      }
    } else {
      auto source = recording.open_entry("activity.bin");
      if (source) {
        activity = *std::move(source);
      } else {
        failure = std::move(source).error();
      }
    }
    if (const auto last = info.last_sample()) {
      const std::int64_t end = to_unix_seconds(*last);
      if (end >= 0 && end <= std::numeric_limits<std::uint32_t>::max()) {
        last_sample_time = static_cast<std::uint32_t>(end);
      }
    }
  }

  // Samples in one record; 0 where none is told short or long (activity.bin has no records).
  std::size_t whole_second() const {
    return form == RecordingForm::log
               ? static_cast<std::size_t>(std::llround(info.sample_rate_hz().value_or(0)))
               : 0;
  }

  Result<std::optional<SampleItem>> next() {
    if (failure) {
      return fail(*failure);
    }
    spare = std::move(current.counts);
    while (true) {
      if (auto ordered = order.next()) {
        return by_clock_item(*std::move(ordered));
      }
      if (ended) {
        return final_gap();
      }
      SIXPOINT_ASSIGN(auto second, form == RecordingForm::log ? next_of_log() : next_of_activity());
      if (!second) {
        ended = true;
        order.end();
      } else if (by_clock) {
        order.push(*std::move(second));
      } else {
        const bool broke = last_time && second->unix_time <= *last_time;
        return item_of(*std::move(second), broke);
      }
    }
  }

  SampleItem by_clock_item(OrderedSecond&& ordered) {
    if (ordered.missing > 0) {
      SampleItem gap;
      gap.kind = SampleItem::Kind::gap;
      gap.unix_time = ordered.unix_time;
      gap.seconds = ordered.missing;
      gap.gap = ordered.gap;
      gap.filled = ordered.filled;
      gap.broke_order = ordered.leapt;
      return gap;
    }
    return item_of(std::move(ordered.second), ordered.leapt);
  }

  SampleItem item_of(Second&& second, bool broke_order) {
    current = std::move(second);
    last_time = current.unix_time;
    latest_time = std::max(latest_time, current.unix_time);
    SampleItem item;
    item.kind = current.counts.empty() ? SampleItem::Kind::usb : SampleItem::Kind::recorded;
    item.unix_time = current.unix_time;
    item.counts = current.counts;
    item.type = current.type;
    item.limit_min = current.limit_min;
    item.limit_max = current.limit_max;
    item.parameters = current.parameters ? &current.parameters->parameters : nullptr;
    item.broke_order = broke_order;
    return item;
  }

  GapKind reason() const {
    if (after_usb) {
      return GapKind::usb;
    }
    if (asleep) {
      return GapKind::idle_sleep;
    }
    return damaged ? GapKind::damaged : GapKind::unexplained;
  }

  // Of the next sample record. Where it has samples, its counts are still those of another one, for
  // the caller to write over: unpacking into memory that was emptied would set it to zero first.
  Second begin_second(std::uint32_t unix_time, bool usb) {
    Second second;
    second.unix_time = unix_time;
    second.missing_before = reason();
    second.parameters = parameters;
    second.counts = std::move(spare);
    if (usb) {
      second.counts.clear();
    }
    asleep = false;
    damaged = false;
    after_usb = usb;
    return second;
  }

  Result<std::optional<Second>> next_of_log() {
    for (;;) {
      SIXPOINT_ASSIGN(const auto entry, log->next());
      if (!entry) {
        return std::nullopt;
      }
      if (entry->kind == LogItem::Kind::damaged) {
        damaged = true;
        continue;
      }
      if (entry->kind != LogItem::Kind::record) {
        continue;
      }
      const Record& record = entry->record;
      if (!record.checksum_ok) {
        damaged = true;
        continue;
      }
      switch (static_cast<RecordType>(record.type)) {
        case RecordType::activity:
        case RecordType::activity2:
        case RecordType::activity3:
          if (auto second = second_of(record)) {
            return second;
          }
          break;  // a payload too short for a sample says nothing at all
        case RecordType::event:
          if (record.payload.size() == 1 && record.payload[0] == kEventEnterIdleSleep) {
            asleep = true;
          }
          break;
        case RecordType::parameters:
          take_parameters(record);
          break;
        case RecordType::metadata:
          if (++metadata_read <= kMostMetadata) {
            clock.take_metadata(record.payload);
          }
          break;
        default:
          break;
      }
    }
  }

  std::optional<Second> second_of(const Record& record) {
    const auto type = static_cast<RecordType>(record.type);
    const bool usb = record.payload.size() == 1;
    constexpr std::size_t kLeastPacked = 5;  // bytes of one sample
    constexpr std::size_t kLeastWide = 6;
    if (!usb &&
        record.payload.size() < (type == RecordType::activity2 ? kLeastWide : kLeastPacked)) {
      return std::nullopt;
    }
    Second second = begin_second(record.unix_time, usb);
    second.offset = record.offset;
    second.type = type;
    if (usb) {
      return second;
    }
    if (type == RecordType::activity) {
      unpack_activity(record.payload, second.counts);
    } else if (type == RecordType::activity3) {
      unpack_activity3(record.payload, second.counts);
      clock.raw_counts = true;
    } else {
      unpack_activity2(record.payload, second.counts);
      set_wide_limits(second);
    }
    ++seconds_read;
    return second;
  }

  // ACTIVITY2 has room for more than the sensor gives; what the sensor gives ends where info.txt
  // says (-8 g and 8 g, which are -2048 and 2048, the latter cut to 2047).
  void set_wide_limits(Second& second) const {
    const auto scale =
        accel_scale_lsb_per_g(info, second.parameters ? &second.parameters->parameters : nullptr);
    const auto low = info.accel_min_g();
    const auto high = info.accel_max_g();
    second.limit_min = std::numeric_limits<std::int16_t>::min();
    second.limit_max = std::numeric_limits<std::int16_t>::max();
    if (scale && low && high) {
      const double least = std::round(*low * *scale);
      const double most = std::round(*high * *scale) - 1;
      if (least > second.limit_min && most < second.limit_max && least < most) {
        second.limit_min = static_cast<std::int16_t>(least);
        second.limit_max = static_cast<std::int16_t>(most);
      }
    }
  }

  void take_parameters(const Record& record) {
    auto parsed = parse_parameters(record.payload);
    if (!parsed) {
      ++unreadable_parameters;
      return;
    }
    if (parameters && parameters->parameters.values == parsed->values) {
      return;
    }
    if (parameters && seconds_read > 0 && parameters->parameters.constants != parsed->constants) {
      constants_changed = true;
    }
    if (const auto offset = parsed->values.find(kParameterUtcOffset);
        offset != parsed->values.end() && offset->second != 0) {
      const auto offset_s = static_cast<std::int32_t>(offset->second);
      constexpr std::int32_t kFarthest_s = 14 * 3600;
      if (std::abs(std::int64_t{offset_s}) <= kFarthest_s) {
        clock.unit_offset_minutes = offset_s / 60;
      }
    }
    parameters =
        std::make_shared<const ParameterSet>(ParameterSet{record.unix_time, *std::move(parsed)});
    if (sets.size() < kMaxParameterSets) {
      sets.push_back(parameters);
    } else {
      sets.back() = parameters;
    }
  }

  Result<std::optional<SampleItem>> final_gap() {
    // Behind what was lost of a log no one knows what the unit did, and a clock that was set back is
    // another than that of the Last Sample Time: these are no gaps to be filled.
    if (!by_clock || final_gap_given || !last_time || !last_sample_time ||
        *last_time < latest_time ||
        recording.is_damaged(form == RecordingForm::log ? "log.bin" : "activity.bin") ||
        *last_sample_time <= *last_time + std::uint64_t{1}) {
      return std::nullopt;
    }
    final_gap_given = true;
    SampleItem gap;
    gap.kind = SampleItem::Kind::gap;
    gap.unix_time = *last_time + 1;
    gap.seconds = *last_sample_time - gap.unix_time;
    gap.gap = reason();
    gap.filled = fills_gap(gap.gap, gap.seconds, fill_limit_s);
    return gap;
  }

  // activity.bin knows no seconds: they are counted from Start Date at the rate of info.txt.
  Result<std::optional<Second>> next_of_activity() {
    SIXPOINT_ASSIGN(const double rate_hz, usable_sample_rate_hz(info, {}));
    const auto wanted = static_cast<std::size_t>(rate_hz);
    while (pending.size() < wanted && !activity_ended) {
      // 9 bytes are two samples; a whole number of them leaves no half sample between pieces.
      Bytes piece(std::size_t{9} * 512);
      std::size_t filled = 0;
      while (filled < piece.size()) {
        SIXPOINT_ASSIGN(const std::size_t count, activity->read(std::span(piece).subspan(filled)));
        if (count == 0) {
          activity_ended = true;
          break;
        }
        filled += count;
      }
      std::vector<Counts> unpacked;
      unpack_activity(std::span(piece).first(filled), unpacked);
      pending.insert(pending.end(), unpacked.begin(), unpacked.end());
    }
    if (pending.empty()) {
      return std::nullopt;
    }
    if (!activity_second) {
      const auto start = info.start();
      activity_second = start ? static_cast<std::uint32_t>(to_unix_seconds(*start)) : 0;
    }
    Second second = begin_second((*activity_second)++, false);
    const std::size_t count = std::min(wanted, pending.size());
    const auto end = pending.begin() + static_cast<std::ptrdiff_t>(count);
    second.counts.assign(pending.begin(), end);
    pending.erase(pending.begin(), end);
    return second;
  }

  Recording recording;  // stays open
  RecordingForm form;
  Info info;
  bool by_clock;
  std::uint64_t fill_limit_s;
  SecondOrder order;
  std::optional<Error> failure;
  std::optional<LogReader> log;
  std::unique_ptr<ByteSource> activity;
  bool activity_ended = false;
  std::optional<std::uint32_t> activity_second;
  std::vector<Counts> pending;
  Second current;             // of the item that was given last
  std::vector<Counts> spare;  // its counts, to be used again
  bool ended = false;
  bool final_gap_given = false;
  std::optional<std::uint32_t> last_time;
  std::uint32_t latest_time = 0;
  std::optional<std::uint32_t> last_sample_time;
  bool asleep = false;
  bool damaged = false;
  bool after_usb = false;
  std::uint64_t seconds_read = 0;
  ClockEvidence clock;
  static constexpr std::uint64_t kMostMetadata = 100;  // a unit writes a handful
  std::uint64_t metadata_read = 0;
  std::vector<std::shared_ptr<const ParameterSet>> sets;
  std::shared_ptr<const ParameterSet> parameters;  // in force
  bool constants_changed = false;
  std::uint64_t unreadable_parameters = 0;
  LogStatistics none;
};

SampleReader::SampleReader(Recording& recording, ReadOrder order, std::uint64_t fill_limit_s)
    : state_(std::make_unique<State>(recording, order, fill_limit_s)) {}
SampleReader::SampleReader(SampleReader&&) noexcept = default;
SampleReader& SampleReader::operator=(SampleReader&&) noexcept = default;
SampleReader::~SampleReader() = default;

Result<std::optional<SampleItem>> SampleReader::next() { return state_->next(); }
const LogStatistics& SampleReader::statistics() const {
  return state_->log ? state_->log->statistics() : state_->none;
}
Clock SampleReader::clock() const { return which_clock(state_->clock); }
const Irregular& SampleReader::irregular() const { return state_->order.irregular(); }
const std::vector<std::shared_ptr<const ParameterSet>>& SampleReader::parameter_sets() const {
  return state_->sets;
}
bool SampleReader::constants_changed() const { return state_->constants_changed; }
std::uint64_t SampleReader::unreadable_parameters() const { return state_->unreadable_parameters; }

}  // namespace sixpoint::gt3x
