// Server-sent events: what changed, as it happens.
#include "station/page/api_answers.h"
#include "station/page/quality_control.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::chrono::seconds kHeartbeat{5};
// A job's event lists its files: half a megabyte of a large one, which has many files a second.
constexpr std::chrono::seconds kBetweenJobEvents{1};

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
  add_changes(text);
  if (!std::exchange(started_, true)) {
    text.clear();  // the state has all of it
    add_event(text, "state", api_.state());
  }
  add_live(text);
  const auto now = api_.parts_.env.clock.elapsed();
  if (text.empty() && now - last_sent_ > kHeartbeat) {
    text = ": still here\n\n";
  }
  if (!text.empty()) {
    last_sent_ = now;
  }
  return text;
}

void EventStream::add_changes(std::string& text) {
  const ApiParts& parts = api_.parts_;
  const auto has_changed = [](std::uint64_t& seen, std::uint64_t changes) {
    return std::exchange(seen, changes) != changes;
  };
  for (std::size_t i = 0; i < seen_changes_.size(); ++i) {
    if (has_changed(seen_changes_[i], parts.lanes.changes(i + 1))) {
      add_event(text, "lane", parts.lanes.to_json(i + 1));
    }
  }
  const auto now = parts.env.clock.elapsed();
  if (now - last_job_event_ >= kBetweenJobEvents &&
      has_changed(seen_job_, parts.repairs.changes())) {
    last_job_event_ = now;
    add_event(text, "job", parts.repairs.to_json());
  }
  if (parts.printer != nullptr && has_changed(seen_printer_, parts.printer->changes())) {
    add_event(text, "printer", parts.printer->to_json());
  }
  if (parts.quality != nullptr && has_changed(seen_lock_, parts.quality->changes())) {
    add_event(text, "lock", parts.quality->lock());
  }
}

// The readings since the last call, where there are any, and the queue.
void EventStream::add_live(std::string& text) {
  const Lanes& lanes = api_.parts_.lanes;
  Json live;
  live["lanes"] = Json::array();
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    const LaneTrace trace = lanes.trace(i + 1, next_reading_[i]);
    if (trace.force_mg.empty()) {
      continue;
    }
    next_reading_[i] = trace.first + trace.force_mg.size();
    Json flat = Json::array();
    for (const auto& force_mg : trace.force_mg) {
      for (const std::int16_t mg : force_mg) {
        flat.push_back(mg);
      }
    }
    live["lanes"].push_back({{"lane", i + 1},
                             {"first", trace.first},
                             {"host_ms", trace.host_ms},
                             {"mg", std::move(flat)},
                             {"live", lanes.live(i + 1)}});
  }
  auto queue = lanes.queue();
  if (!live["lanes"].empty() || queue != seen_queue_) {
    live["queue"] = queue;
    seen_queue_ = std::move(queue);
    add_event(text, "live", live);
  }
}

}  // namespace sixpoint::station
