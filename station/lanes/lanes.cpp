#include "station/lanes/lanes.h"

#include <algorithm>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "station/lanes/lane.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostUnmatched = 256;  // clients with a scan that no lane matched

}  // namespace

Lanes::Lanes() = default;
// All lanes at once: sixteen ends one after the other would add up.
Lanes::~Lanes() {
  for (const auto& lane : lanes_) {
    lane->request_stop();
  }
}

Result<std::unique_ptr<Lanes>> Lanes::open(Env& env, const device::TransportRegistry& devices,
                                           LanesOptions options, StoreRun store_run,
                                           StoreConstants store_constants) {
  if (options.devices.empty() || options.devices.size() > kMostLanes) {
    return fail(
        ErrorCode::usage,
        fmt::format("a station has 1 to {} lanes, not {}", kMostLanes, options.devices.size()), {},
        "name each unit's device with --device");
  }
  SIXPOINT_CHECK(make_synced_folders(env.files, options.state_folder));
  std::unique_ptr<Lanes> lanes(new Lanes);
  lanes->shared_.reset(new Shared{
      env, devices, std::move(options), std::move(store_run), std::move(store_constants), {}, {}});
  for (const std::string& device : lanes->shared_->options.devices) {
    lanes->lanes_.push_back(
        std::make_unique<Lane>(*lanes->shared_, lanes->lanes_.size() + 1, device));
  }
  return lanes;
}

std::size_t Lanes::size() const { return lanes_.size(); }
const std::string& Lanes::device(std::size_t number) const {
  return lanes_.at(number - 1)->device();
}

LaneAnswer<Lanes::Lane*> Lanes::lane(std::size_t number) const {
  if (number < 1 || number > lanes_.size()) {
    return tl::unexpected<LaneRefusal>(
        {LaneRefusal::Kind::no_such_lane, fmt::format("there is no lane {}", number),
         fmt::format("lanes are numbered from 1 to {}", lanes_.size())});
  }
  return lanes_[number - 1].get();
}

LaneAnswer<Lanes::Lane*> Lanes::lane_to_start(std::size_t number, const std::string& client) {
  return lane(number).and_then([&](Lane* chosen) -> LaneAnswer<Lane*> {
    const std::lock_guard lock(mutex_);
    const auto unmatched = std::find_if(unmatched_.begin(), unmatched_.end(),
                                        [&](const auto& each) { return each.client == client; });
    if (unmatched == unmatched_.end()) {
      return chosen;
    }
    if (!chosen->holds(unmatched->serial)) {
      return lane_conflict(fmt::format("the label of {} was scanned, and this is another unit",
                                       printable(unmatched->serial, 40)),
                           "plug in the unit that was scanned, or scan the label of this one");
    }
    unmatched_.erase(unmatched);
    return chosen;
  });
}

LaneAnswer<void> Lanes::start(std::size_t number, const StartOrder& order) {
  return lane_to_start(number, order.client).and_then([&](Lane* chosen) {
    return chosen->start(order, false);
  });
}

LaneAnswer<void> Lanes::start_capture(std::size_t number, const StartOrder& order) {
  return lane_to_start(number, order.client).and_then([&](Lane* chosen) {
    return chosen->start(order, true);
  });
}

LaneAnswer<void> Lanes::command(std::size_t number, const std::string& client,
                                OperatorCommand command) {
  return lane(number).and_then([&](Lane* chosen) { return chosen->command(client, command); });
}

LaneAnswer<void> Lanes::confirm_side(std::size_t number, const std::string& client) {
  return lane(number).and_then([&](Lane* chosen) { return chosen->confirm_side(client); });
}

LaneAnswer<void> Lanes::release_jig(std::size_t number, const std::string& client,
                                    const std::string& name) {
  return lane(number).and_then([&](Lane* chosen) { return chosen->release_jig(client, name); });
}

void Lanes::forget_scan(const std::string& client) {
  std::erase_if(unmatched_, [&](const auto& each) { return each.client == client; });
}

void Lanes::dismiss_scan(const std::string& client) {
  const std::lock_guard lock(mutex_);
  forget_scan(client);
}

LaneAnswer<std::size_t> Lanes::scan(std::size_t number, const std::string& serial,
                                    const std::string& client) {
  dismiss_scan(client);
  if (number == 0) {
    const auto found = std::find_if(lanes_.begin(), lanes_.end(),
                                    [&](const auto& each) { return each->holds(serial); });
    if (found == lanes_.end()) {
      const std::lock_guard lock(mutex_);
      forget_scan(client);
      if (unmatched_.size() == kMostUnmatched) {  // browsers that were left long ago
        unmatched_.pop_front();
      }
      unmatched_.push_back({client, serial});
      return lane_conflict(fmt::format("no lane holds a unit {}", printable(serial, 40)),
                           "plug the unit in, or check that its label is its own");
    }
    number = static_cast<std::size_t>(found - lanes_.begin()) + 1;
  }
  return lane(number).and_then([&](Lane* chosen) { return chosen->scan(serial); }).map([&] {
    return number;
  });
}

LaneAnswer<void> Lanes::take_over(std::size_t number, const std::string& client,
                                  const std::string& operator_name) {
  return lane(number).and_then(
      [&](Lane* chosen) { return chosen->take_over(client, operator_name); });
}

std::uint64_t Lanes::changes() const { return shared_->changes; }
std::uint64_t Lanes::changes(std::size_t number) const { return lanes_.at(number - 1)->changes(); }
LaneState Lanes::state(std::size_t number) const { return lanes_.at(number - 1)->state(); }
Json Lanes::to_json(std::size_t number) const { return lanes_.at(number - 1)->to_json(); }
LaneTrace Lanes::trace(std::size_t number, std::uint64_t first) const {
  return lanes_.at(number - 1)->trace(first);
}
Json Lanes::live(std::size_t number) const { return lanes_.at(number - 1)->live(); }

std::vector<std::size_t> Lanes::queue() const {
  std::vector<std::pair<Lane::Wait, std::size_t>> waiting;
  for (std::size_t i = 0; i < lanes_.size(); ++i) {
    const Lane::Wait wait = lanes_[i]->wait();
    if (wait.waits) {
      waiting.emplace_back(wait, i + 1);
    }
  }
  std::stable_sort(waiting.begin(), waiting.end(), [](const auto& a, const auto& b) {
    return a.first.is_moved != b.first.is_moved ? a.first.is_moved
                                                : a.first.since_ms < b.first.since_ms;
  });
  std::vector<std::size_t> numbers;
  numbers.reserve(waiting.size());
  for (const auto& [wait, number] : waiting) {
    numbers.push_back(number);
  }
  return numbers;
}

}  // namespace sixpoint::station
