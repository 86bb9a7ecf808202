#include "gt3x/sample_reader.h"

#include <array>
#include <cmath>
#include <limits>

#include "gt3x/forms/model.h"

namespace sixpoint::gt3x {

std::string_view to_string(GapKind kind) {
  constexpr std::array<std::string_view, 4> kNames = {"idle_sleep", "usb", "damaged",
                                                      "unexplained"};
  return kNames[static_cast<std::size_t>(kind)];
}

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
  explicit State(Recording& opened) : form(opened.form()), info(opened.info()) {
    if (form == RecordingForm::log) {
      auto reader = opened.open_log();
      if (reader) {
        log.emplace(*std::move(reader));
      } else {
        failure = std::move(reader).error();
      }
    } else {
      auto source = opened.open_entry("activity.bin");
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

  Result<std::optional<SampleItem>> next() {
    if (failure) {
      return fail(*failure);
    }
    if (waiting) {
      SampleItem item = *std::exchange(waiting, std::nullopt);
      return deliver(item);
    }
    return form == RecordingForm::log ? next_of_log() : next_of_activity();
  }

  // The gap before `item`, where there is one; `item` then waits.
  SampleItem deliver(SampleItem& item) {
    if (last_time && item.unix_time > *last_time + std::uint64_t{1}) {
      waiting = item;
      return gap_until(item.unix_time);
    }
    item.broke_order = last_time && item.unix_time <= *last_time;
    last_time = item.unix_time;
    asleep = false;
    damaged = false;
    after_usb = item.kind == SampleItem::Kind::usb;
    if (item.kind == SampleItem::Kind::recorded) {
      item.counts = samples;
      samples_delivered += samples.size();
    }
    return item;
  }

  // The seconds after the last one, up to `end`.
  SampleItem gap_until(std::uint32_t end) {
    SampleItem gap;
    gap.kind = SampleItem::Kind::gap;
    gap.unix_time = *last_time + 1;
    gap.seconds = end - gap.unix_time;
    gap.gap = reason();
    last_time = end - 1;
    return gap;
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

  Result<std::optional<SampleItem>> next_of_log() {
    for (;;) {
      SIXPOINT_ASSIGN(const auto entry, log->next());
      if (!entry) {
        return final_gap();
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
        case RecordType::activity3: {
          SampleItem item = item_of(record);
          if (item.kind == SampleItem::Kind::recorded && samples.empty()) {
            continue;  // an empty payload says nothing at all
          }
          return deliver(item);
        }
        case RecordType::event:
          if (record.payload.size() == 1 && record.payload[0] == kEventEnterIdleSleep) {
            asleep = true;
          }
          break;
        case RecordType::parameters:
          take_parameters(record);
          break;
        default:
          break;
      }
    }
  }

  SampleItem item_of(const Record& record) {
    SampleItem item;
    item.unix_time = record.unix_time;
    item.type = static_cast<RecordType>(record.type);
    item.parameters = parameters;
    if (record.payload.size() == 1) {
      item.kind = SampleItem::Kind::usb;
      return item;
    }
    if (item.type == RecordType::activity) {
      unpack_activity(record.payload, samples);
    } else if (item.type == RecordType::activity3) {
      unpack_activity3(record.payload, samples);
    } else {
      unpack_activity2(record.payload, samples);
      set_wide_limits(item);
    }
    return item;
  }

  // ACTIVITY2 has room for more than the sensor gives; what the sensor gives ends where info.txt
  // says (-8 g and 8 g, which are -2048 and 2048, the latter cut to 2047).
  void set_wide_limits(SampleItem& item) const {
    const auto scale = accel_scale_lsb_per_g(info, parameters);
    const auto low = info.accel_min_g();
    const auto high = info.accel_max_g();
    item.limit_min = std::numeric_limits<std::int16_t>::min();
    item.limit_max = std::numeric_limits<std::int16_t>::max();
    if (scale && low && high) {
      const double least = std::round(*low * *scale);
      const double most = std::round(*high * *scale) - 1;
      if (least > item.limit_min && most < item.limit_max && least < most) {
        item.limit_min = static_cast<std::int16_t>(least);
        item.limit_max = static_cast<std::int16_t>(most);
      }
    }
  }

  void take_parameters(const Record& record) {
    auto parsed = parse_parameters(record.payload);
    if (!parsed) {
      ++unreadable_parameters;
      return;
    }
    if (!sets.empty() && sets.back()->parameters.values == parsed->values) {
      return;
    }
    if (parameters != nullptr && samples_delivered > 0 &&
        parameters->constants != parsed->constants) {
      constants_changed = true;
    }
    auto set = std::make_unique<ParameterSet>(ParameterSet{record.unix_time, *std::move(parsed)});
    if (sets.size() < kMaxParameterSets) {
      sets.push_back(std::move(set));
    } else {
      // Earlier items may still point at the last but one; no caller may hold more than one item.
      std::swap(previous_set, sets.back());
      sets.back() = std::move(set);
    }
    parameters = &sets.back()->parameters;
  }

  Result<std::optional<SampleItem>> final_gap() {
    if (!last_time || !last_sample_time || *last_sample_time <= *last_time + std::uint64_t{1}) {
      return std::nullopt;
    }
    return gap_until(*last_sample_time);
  }

  // activity.bin knows no seconds: they are counted from Start Date at the rate of info.txt.
  Result<std::optional<SampleItem>> next_of_activity() {
    const double rate_hz = info.sample_rate_hz().value_or(0);
    if (!(rate_hz >= 1)) {
      return fail(ErrorCode::bad_data, "info.txt names no sample rate", {},
                  "download the recording from the unit again");
    }
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
    const std::size_t count = std::min(wanted, pending.size());
    const auto end = pending.begin() + static_cast<std::ptrdiff_t>(count);
    samples.assign(pending.begin(), end);
    pending.erase(pending.begin(), end);
    SampleItem item;
    if (!last_time) {
      const auto start = info.start();
      item.unix_time = start ? static_cast<std::uint32_t>(to_unix_seconds(*start)) : 0;
    } else {
      item.unix_time = *last_time + 1;
    }
    return deliver(item);
  }

  RecordingForm form;
  Info info;
  std::optional<Error> failure;
  std::optional<LogReader> log;
  std::unique_ptr<ByteSource> activity;
  bool activity_ended = false;
  std::vector<Counts> pending;
  std::vector<Counts> samples;
  std::optional<SampleItem> waiting;
  std::optional<std::uint32_t> last_time;
  std::optional<std::uint32_t> last_sample_time;
  bool asleep = false;
  bool damaged = false;
  bool after_usb = false;
  std::uint64_t samples_delivered = 0;
  std::vector<std::unique_ptr<ParameterSet>> sets;
  std::unique_ptr<ParameterSet> previous_set;
  const Parameters* parameters = nullptr;
  bool constants_changed = false;
  std::uint64_t unreadable_parameters = 0;
  LogStatistics none;
};

SampleReader::SampleReader(Recording& recording) : state_(std::make_unique<State>(recording)) {}
SampleReader::SampleReader(SampleReader&&) noexcept = default;
SampleReader& SampleReader::operator=(SampleReader&&) noexcept = default;
SampleReader::~SampleReader() = default;

Result<std::optional<SampleItem>> SampleReader::next() { return state_->next(); }
const LogStatistics& SampleReader::statistics() const {
  return state_->log ? state_->log->statistics() : state_->none;
}
const std::vector<std::unique_ptr<SampleReader::ParameterSet>>& SampleReader::parameter_sets()
    const {
  return state_->sets;
}
bool SampleReader::constants_changed() const { return state_->constants_changed; }
std::uint64_t SampleReader::unreadable_parameters() const { return state_->unreadable_parameters; }

}  // namespace sixpoint::gt3x
