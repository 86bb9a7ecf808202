// Carries a fault plan out, between a virtual unit and its carrier.
//
//   SIXPOINT_ASSIGN(FaultPlan plan, read_fault_plan(files, "F.json"));
//   FaultInjector faults(std::move(plan), clock.elapsed());
//   const CableEvent event = faults.read_report(unit, clock.elapsed());
//
// A carrier calls it in place of the unit: write_report() for take_report(), read_report() for
// next_report(), read_bulk() for next_bulk(), next_due() for next_due(). It also checks plugged()
// and enumeration(). With an empty plan everything passes unchanged.
//
// One thread at a time; the unit is the same in all calls (a swap replaces what is in it).
#pragma once

#include <array>
#include <deque>

#include "base/random.h"
#include "mocks/faults/fault_plan.h"
#include "mocks/firmware/virtual_unit.h"

namespace sixpoint::mocks {

struct CableEvent {
  enum class Kind {
    nothing,  // no data (a write that was lost answers `data` all the same)
    data,
    stalled,  // over USB: STALL; the next transfer is clean
    gone,     // the unit is not on the bus
  };
  Kind kind = Kind::nothing;
  Bytes bytes;  // of reads
};

class FaultInjector {
 public:
  FaultInjector() = default;  // no faults
  FaultInjector(FaultPlan plan, nanoseconds start);

  // Carries out the faults that are due by time. The functions below do it too; a carrier without
  // transfers for a long time (hot plug) calls it itself.
  void advance(VirtualUnit& unit, nanoseconds now);
  bool plugged() const { return plugged_; }
  // Rises each time the unit comes back to the bus: handles that were opened before are dead.
  std::uint32_t enumeration() const { return enumeration_; }

  CableEvent write_report(VirtualUnit& unit, std::span<const std::uint8_t> report, nanoseconds now);
  CableEvent read_report(VirtualUnit& unit, nanoseconds now);
  CableEvent read_bulk(VirtualUnit& unit, nanoseconds now);
  // The earlier of the unit's next report and the next thing that the plan does by time.
  std::optional<nanoseconds> next_due(const VirtualUnit& unit) const;

 private:
  struct State {
    Fault fault;
    std::uint64_t transfers = 0;  // of its kind, so far
    std::uint64_t bytes = 0;
    std::optional<std::uint64_t> first;  // the transfer at which it began
    bool done = false;                   // for faults of the unit
  };
  struct Held {
    nanoseconds due{0};
    bool stalled = false;
    Bytes bytes;
  };
  using Queue = std::deque<Held>;

  // Whether the fault strikes this transfer.
  bool strikes(State& state, std::size_t size, nanoseconds now);
  // Appends what becomes of a transfer to `queue`.
  void pass(VirtualUnit& unit, FaultChannel channel, FaultDirection direction, Bytes bytes,
            nanoseconds now, Queue& queue);
  void strike_unit(const Fault& fault, VirtualUnit& unit, nanoseconds now);
  // For good without `seconds`.
  void leave_bus(VirtualUnit& unit, std::optional<double> seconds, nanoseconds now);
  void come_back(VirtualUnit& unit, nanoseconds now);
  void drop_queues();
  CableEvent take(Queue& queue, nanoseconds now);
  void spoil(const State& state, Bytes& bytes, FaultChannel channel);

  std::vector<State> states_;
  Random random_{1};
  nanoseconds start_{0};
  bool plugged_ = true;
  std::uint32_t enumeration_ = 0;
  std::optional<nanoseconds> back_at_;
  std::optional<nanoseconds> power_back_after_;  // set while a loss of power is armed
  std::optional<VirtualUnitOptions> other_unit_;
  Queue reports_;
  Queue blocks_;
};

}  // namespace sixpoint::mocks
