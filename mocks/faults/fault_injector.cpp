#include "mocks/faults/fault_injector.h"

#include <algorithm>

#include "base/crc_ccitt.h"
#include "base/time.h"

namespace sixpoint::mocks {

namespace {

FaultSubject subject_of(std::span<const std::uint8_t> report) {
  return report.size() > 1 && report[1] == static_cast<std::uint8_t>(device::ReportKind::samples)
             ? FaultSubject::samples
             : FaultSubject::replies;
}

void renew_crc(Bytes& report) {
  if (report.size() == device::kReportBytes) {
    const std::uint16_t crc = crc_ccitt(std::span(report).first(device::kReportBytes - 2));
    report[device::kReportBytes - 2] = static_cast<std::uint8_t>(crc & 0xFFU);
    report[device::kReportBytes - 1] = static_cast<std::uint8_t>(crc >> 8U);
  }
}

}  // namespace

FaultInjector::FaultInjector(FaultPlan plan, nanoseconds start)
    : random_(plan.seed, 0x6661756C74), start_(start) {
  for (Fault& fault : plan.faults) {
    State state;
    state.fault = std::move(fault);
    states_.push_back(std::move(state));
  }
}

bool FaultInjector::strikes(State& state, std::size_t size, nanoseconds now) {
  const Fault& fault = state.fault;
  const std::uint64_t number = ++state.transfers;
  const std::uint64_t begin = state.bytes;
  state.bytes += size;
  if (!state.first) {
    const bool begins =
        (fault.at.report && number == *fault.at.report) ||
        (fault.at.byte && begin <= *fault.at.byte && *fault.at.byte < state.bytes) ||
        (fault.at.time_s && now >= start_ + from_seconds(*fault.at.time_s));
    if (!begins) {
      return false;
    }
    state.first = number;
  }
  const std::uint64_t since = number - *state.first;
  const std::uint64_t place = fault.every ? since % *fault.every : since;
  return fault.count == 0 || place < fault.count;
}

void FaultInjector::spoil(const State& state, Bytes& bytes, FaultChannel channel) {
  if (bytes.empty()) {
    return;
  }
  const Fault& fault = state.fault;
  switch (fault.kind) {
    case FaultKind::short_packet:
      bytes.resize(std::min<std::size_t>(bytes.size(), fault.bytes));
      break;
    case FaultKind::garbage:
      for (std::uint8_t& byte : bytes) {
        byte = static_cast<std::uint8_t>(random_.below(256));
      }
      break;
    case FaultKind::bit_flip: {
      const std::size_t before = state.bytes - bytes.size();
      const std::size_t at = fault.byte      ? *fault.byte
                             : fault.at.byte ? (*fault.at.byte - std::min(*fault.at.byte, before))
                                             : random_.below(bytes.size());
      bytes[std::min(at, bytes.size() - 1)] ^= static_cast<std::uint8_t>(1U << fault.bit);
      break;
    }
    case FaultKind::bad_crc:
      bytes.back() ^= 0xA5;
      break;
    case FaultKind::wrong_sequence:
      if (channel == FaultChannel::reports && bytes.size() == device::kReportBytes) {
        bytes[2] ^= 0x55;
        renew_crc(bytes);
      } else if (bytes.size() > device::kBulkHeaderBytes) {
        // A block's sequence is its offset; the CRC is made to fit by encoding it anew.
        if (const auto block = device::decode_bulk(bytes)) {
          device::BulkBlock other = *block;
          other.offset += device::kBulkContentBytes;
          bytes = device::encode_bulk(other);
        }
      }
      break;
    default:
      break;
  }
}

void FaultInjector::pass(VirtualUnit& unit, FaultChannel channel, FaultDirection direction,
                         Bytes bytes, nanoseconds now, Queue& queue) {
  const FaultSubject subject = subject_of(bytes);
  nanoseconds due = queue.empty() ? now : std::max(now, queue.back().due);
  int copies = 1;
  bool stalled = false;
  std::vector<const Fault*> of_unit;
  for (State& state : states_) {
    const Fault& fault = state.fault;
    const bool time_only = !is_of_transfer(fault.kind) && fault.at.time_s.has_value();
    if (time_only || fault.channel != channel || fault.direction != direction ||
        (channel == FaultChannel::reports && fault.subject != FaultSubject::any &&
         fault.subject != subject)) {
      continue;
    }
    if (!strikes(state, bytes.size(), now)) {
      continue;
    }
    switch (fault.kind) {
      case FaultKind::stall:
        stalled = true;
        copies = fault.count == 0 ? 0 : copies;  // the endpoint never recovers
        break;
      case FaultKind::delay:
        due += from_seconds(*fault.seconds);
        break;
      case FaultKind::duplicate:
        copies *= 2;
        break;
      case FaultKind::lost:
        copies = 0;
        break;
      default:
        if (is_of_transfer(fault.kind)) {
          spoil(state, bytes, channel);
        } else {
          of_unit.push_back(&fault);
        }
        break;
    }
  }
  if (stalled) {
    queue.push_back({due, true, {}});
  }
  // A stall towards the unit refuses the data; from the unit it leaves them for the next read.
  if (!stalled || direction == FaultDirection::from_unit) {
    for (int copy = 0; copy < std::min(copies, 16); ++copy) {
      queue.push_back({due, false, bytes});
    }
  }
  for (const Fault* fault : of_unit) {
    strike_unit(*fault, unit, now);
    advance(unit, now);
  }
}

void FaultInjector::come_back(VirtualUnit& unit, nanoseconds now) {
  back_at_.reset();
  if (other_unit_) {
    unit = VirtualUnit(std::move(*other_unit_), now);
    other_unit_.reset();
  } else if (!unit.is_powered()) {
    unit.restore_power(now);
  }
  plugged_ = true;
  ++enumeration_;
}

void FaultInjector::leave_bus(VirtualUnit& unit, std::optional<double> seconds, nanoseconds now) {
  unit.lose_cable();
  drop_queues();
  plugged_ = false;
  back_at_ = seconds ? std::optional(now + from_seconds(*seconds)) : std::nullopt;
}

void FaultInjector::drop_queues() {
  reports_.clear();
  blocks_.clear();
}

void FaultInjector::strike_unit(const Fault& fault, VirtualUnit& unit, nanoseconds now) {
  switch (fault.kind) {
    case FaultKind::reset:
      unit.cut_power(now);
      unit.restore_power(now);
      drop_queues();
      break;
    case FaultKind::reenumerate:
      leave_bus(unit, 0, now);
      break;
    case FaultKind::unplug:
      leave_bus(unit, fault.seconds, now);
      break;
    case FaultKind::swap: {
      leave_bus(unit, fault.seconds.value_or(0), now);
      VirtualUnitOptions other;
      sim::GivenProperties given;
      given.serial = fault.serial;
      other.seed = random_.bits();
      other.truth = sim::draw_unit(other.seed, given);
      other_unit_ = std::move(other);
      break;
    }
    case FaultKind::full_flash:
      unit.fill_flash(now);
      break;
    case FaultKind::battery_low:
      unit.set_battery_mv(fault.battery_mv);
      break;
    case FaultKind::frozen_sensor:
      unit.freeze_sensor({true, true, true}, now);
      break;
    case FaultKind::axis_stuck: {
      PerAxis<bool> axes{};
      axes[fault.axis] = true;
      unit.freeze_sensor(axes, now);
      break;
    }
    case FaultKind::bad_page:
      unit.spoil_page();
      break;
    case FaultKind::clock_jump:
      unit.jump_clock(from_seconds(fault.seconds.value_or(0)), now);
      break;
    case FaultKind::power_loss:
      unit.memory().cut_power_after(fault.bytes);
      power_back_after_ = from_seconds(fault.seconds.value_or(1));
      break;
    default:
      break;
  }
}

void FaultInjector::advance(VirtualUnit& unit, nanoseconds now) {
  if (power_back_after_ && !unit.is_powered()) {
    plugged_ = false;
    drop_queues();
    back_at_ = now + *std::exchange(power_back_after_, std::nullopt);
  }
  // In the order of their times, each at its own time: the last call may be long ago.
  for (;;) {
    State* next = nullptr;
    nanoseconds next_at = back_at_.value_or(nanoseconds::max());
    for (State& state : states_) {
      const Fault& fault = state.fault;
      if (!is_of_transfer(fault.kind) && fault.at.time_s && !state.done &&
          start_ + from_seconds(*fault.at.time_s) < next_at) {
        next = &state;
        next_at = start_ + from_seconds(*fault.at.time_s);
      }
    }
    if (next_at > now) {
      return;
    }
    if (next != nullptr) {
      next->done = true;
      strike_unit(next->fault, unit, next_at);
    } else {
      come_back(unit, next_at);
    }
  }
}

CableEvent FaultInjector::take(Queue& queue, nanoseconds now) {
  if (queue.empty() || queue.front().due > now) {
    return {};
  }
  Held held = std::move(queue.front());
  queue.pop_front();
  return {held.stalled ? CableEvent::Kind::stalled : CableEvent::Kind::data, std::move(held.bytes)};
}

CableEvent FaultInjector::write_report(VirtualUnit& unit, std::span<const std::uint8_t> report,
                                       nanoseconds now) {
  advance(unit, now);
  if (!plugged_) {
    return {CableEvent::Kind::gone, {}};
  }
  Queue arriving;
  pass(unit, FaultChannel::reports, FaultDirection::to_unit, Bytes(report.begin(), report.end()),
       now, arriving);
  CableEvent event{CableEvent::Kind::data, {}};
  for (const Held& held : arriving) {
    if (held.stalled) {
      event.kind = CableEvent::Kind::stalled;
    } else if (plugged_) {
      // A delay towards the unit also makes a late answer: the unit gets the report at once, and
      // its reply waits.
      unit.take_report(held.bytes, now);
      if (held.due > now) {
        reports_.push_back({held.due, false, {}});
      }
    }
  }
  advance(unit, now);
  if (!plugged_) {
    event.kind = CableEvent::Kind::gone;
  }
  return event;
}

CableEvent FaultInjector::read_report(VirtualUnit& unit, nanoseconds now) {
  advance(unit, now);
  // A transfer may be lost: then take the next one.
  while (plugged_ && reports_.empty()) {
    const auto report = unit.next_report(now);
    if (!report) {
      break;
    }
    pass(unit, FaultChannel::reports, FaultDirection::from_unit,
         Bytes(report->begin(), report->end()), now, reports_);
  }
  if (!plugged_) {
    return {CableEvent::Kind::gone, {}};
  }
  for (;;) {
    CableEvent event = take(reports_, now);
    // The mark of a delay towards the unit is no transfer.
    if (event.kind != CableEvent::Kind::data || !event.bytes.empty()) {
      return event;
    }
  }
}

CableEvent FaultInjector::read_bulk(VirtualUnit& unit, nanoseconds now) {
  advance(unit, now);
  while (plugged_ && blocks_.empty()) {
    auto block = unit.next_bulk(now);
    if (!block) {
      break;
    }
    pass(unit, FaultChannel::bulk, FaultDirection::from_unit, std::move(*block), now, blocks_);
  }
  if (!plugged_) {
    return {CableEvent::Kind::gone, {}};
  }
  return take(blocks_, now);
}

std::optional<nanoseconds> FaultInjector::next_due(const VirtualUnit& unit) const {
  // Reports that wait here come before the unit's next one.
  std::optional<nanoseconds> due = reports_.empty() ? unit.next_due() : std::nullopt;
  const auto earlier = [&due](nanoseconds time) { due = due ? std::min(*due, time) : time; };
  if (!reports_.empty()) {
    earlier(reports_.front().due);
  }
  if (!blocks_.empty()) {
    earlier(blocks_.front().due);
  }
  if (back_at_) {
    earlier(*back_at_);
  }
  for (const State& state : states_) {
    if (!is_of_transfer(state.fault.kind) && state.fault.at.time_s && !state.done) {
      earlier(start_ + from_seconds(*state.fault.at.time_s));
    }
  }
  return due;
}

}  // namespace sixpoint::mocks
