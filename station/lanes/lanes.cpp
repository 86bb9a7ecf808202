#include "station/lanes.h"

#include <algorithm>

#include <fmt/format.h>

#include "station/lane.h"

namespace sixpoint::station {

using Json = nlohmann::ordered_json;

Lanes::Lanes() = default;
Lanes::~Lanes() = default;

Result<std::unique_ptr<Lanes>> Lanes::open(Env& env, const device::TransportRegistry& devices,
                                           LanesOptions options, RunKeeper keep_run,
                                           CaptureKeeper keep_capture) {
  if (options.devices.empty() || options.devices.size() > kMostLanes) {
    return fail(
        ErrorCode::usage,
        fmt::format("a station has 1 to {} lanes, not {}", kMostLanes, options.devices.size()), {},
        "name each unit's device with --device");
  }
  SIXPOINT_CHECK(env.files.make_folders(options.state_folder));
  std::unique_ptr<Lanes> lanes(new Lanes);
  lanes->shared_ = std::make_unique<Shared>(env, devices, std::move(options), std::move(keep_run),
                                            std::move(keep_capture));
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

LaneAnswer<void> Lanes::start(std::size_t number, const StartOrder& order) {
  const auto chosen = lane(number);
  return chosen ? (*chosen)->start(order, false) : LaneAnswer<void>(tl::unexpected(chosen.error()));
}

LaneAnswer<void> Lanes::start_capture(std::size_t number, const StartOrder& order) {
  const auto chosen = lane(number);
  return chosen ? (*chosen)->start(order, true) : LaneAnswer<void>(tl::unexpected(chosen.error()));
}

LaneAnswer<void> Lanes::say(std::size_t number, const std::string& client, OperatorWord word) {
  const auto chosen = lane(number);
  return chosen ? (*chosen)->say(client, word) : LaneAnswer<void>(tl::unexpected(chosen.error()));
}

LaneAnswer<void> Lanes::side_is_placed(std::size_t number, const std::string& client) {
  const auto chosen = lane(number);
  return chosen ? (*chosen)->side_is_placed(client)
                : LaneAnswer<void>(tl::unexpected(chosen.error()));
}

LaneAnswer<std::size_t> Lanes::scan(std::size_t number, const std::string& serial) {
  if (number == 0) {
    for (const auto& each : lanes_) {
      if (each->holds(serial)) {
        number = static_cast<std::size_t>(&each - lanes_.data()) + 1;
      }
    }
    if (number == 0) {
      return lane_conflict(fmt::format("no lane holds a unit {}", printable(serial, 40)),
                           "plug the unit in, or look whether its label is its own");
    }
  }
  const auto chosen = lane(number);
  if (!chosen) {
    return tl::unexpected(chosen.error());
  }
  if (const auto scanned = (*chosen)->scan(serial); !scanned) {
    return tl::unexpected(scanned.error());
  }
  return number;
}

LaneAnswer<void> Lanes::take_over(std::size_t number, const std::string& client,
                                  const std::string& operator_name) {
  const auto chosen = lane(number);
  return chosen ? (*chosen)->take_over(client, operator_name)
                : LaneAnswer<void>(tl::unexpected(chosen.error()));
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
    return a.first.in_hand != b.first.in_hand ? a.first.in_hand
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
