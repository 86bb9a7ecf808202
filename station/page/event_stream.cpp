// What the page is told as it happens.
#include "station/api_answers.h"
#include "station/station_desk.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::chrono::seconds kHeartbeat{5};

void add_event(std::string& text, std::string_view name, const Json& data) {
  text += "event: ";
  text += name;
  text += "\ndata: ";
  text += dump(data);  // one line: JSON escapes line ends
  text += "\n\n";
}

}  // namespace

std::unique_ptr<EventStream> Api::open_events() {
  if (++streams_ > options_.most_streams) {
    --streams_;
    return nullptr;
  }
  return std::unique_ptr<EventStream>(new EventStream(*this));
}

EventStream::EventStream(Api& api)
    : api_(api), seen_changes_(api.parts_.lanes.size()), next_reading_(api.parts_.lanes.size()) {}
EventStream::~EventStream() { --api_.streams_; }

std::string EventStream::next() {
  std::string text;
  Lanes& lanes = api_.parts_.lanes;
  const auto now = api_.parts_.env.clock.elapsed();
  if (!greeted_) {
    greeted_ = true;
    for (std::size_t i = 0; i < lanes.size(); ++i) {
      seen_changes_[i] = lanes.changes(i + 1);
    }
    seen_job_ = api_.parts_.repairs.changes();
    seen_lock_ = api_.parts_.desk != nullptr ? api_.parts_.desk->changes() : 0;
    add_event(text, "state", api_.state());
  }
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    const std::uint64_t changes = lanes.changes(i + 1);
    if (changes != seen_changes_[i]) {
      seen_changes_[i] = changes;
      add_event(text, "lane", lanes.to_json(i + 1));
    }
  }
  Json live;
  live["lanes"] = Json::array();
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    const LaneTrace trace = lanes.trace(i + 1, next_reading_[i]);
    if (trace.force_mg.empty()) {
      continue;
    }
    next_reading_[i] = trace.first + trace.force_mg.size();
    Json lane;
    lane["lane"] = i + 1;
    lane["first"] = trace.first;
    lane["host_ms"] = trace.host_ms;
    Json& flat = lane["mg"] = Json::array();
    for (const auto& force_mg : trace.force_mg) {
      for (const std::int16_t mg : force_mg) {
        flat.push_back(mg);
      }
    }
    lane["live"] = lanes.live(i + 1);
    live["lanes"].push_back(std::move(lane));
  }
  auto queue = lanes.queue();
  if (!live["lanes"].empty() || queue != seen_queue_) {
    live["queue"] = queue;
    seen_queue_ = std::move(queue);
    add_event(text, "live", live);
  }
  if (const std::uint64_t job = api_.parts_.repairs.changes(); job != seen_job_) {
    seen_job_ = job;
    add_event(text, "job", api_.parts_.repairs.to_json());
  }
  if (const StationDesk* desk = api_.parts_.desk;
      desk != nullptr && desk->changes() != seen_lock_) {
    seen_lock_ = desk->changes();
    add_event(text, "lock", desk->lock());
  }
  if (text.empty() && now - last_word_ > kHeartbeat) {
    text = ": still here\n\n";
  }
  if (!text.empty()) {
    last_word_ = now;
  }
  return text;
}

}  // namespace sixpoint::station
