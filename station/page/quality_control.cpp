#include "station/station_desk.h"

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <set>
#include <thread>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "station/station_records.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

// Signatures from elsewhere come seldom, and a chart of every check unit is computed for each look.
constexpr std::chrono::seconds kBetweenLooks{15};

Result<std::optional<UtcTime>> day(const std::string& text, const char* key) {
  if (text.empty()) {
    return std::nullopt;
  }
  const auto time = parse_iso8601(text);
  if (!time) {
    return fail(ErrorCode::usage, time.error().what, key, "write it as 2027-03-31");
  }
  return *time;
}

Json title_of(const QuantityInfo& info) {
  return {{"name", info.name}, {"title", info.title}, {"unit", info.unit}};
}

// "zero_offset_mg x" -> the quantity's title and unit.
Json titles_for(const std::vector<std::string>& names) {
  Json titles = Json::object();
  for (const std::string& name : names) {
    const std::size_t blank = name.find(' ');
    if (const QuantityInfo* info = find_quantity(name.substr(0, blank))) {
      titles[name] = title_of(*info);
      titles[name]["axis"] = blank == std::string::npos ? "" : name.substr(blank + 1);
    }
  }
  return titles;
}

}  // namespace

struct StationDesk::Impl {
  Impl(Env& its_env, StoreOpener opener, std::string its_station, Limits its_limits)
      : env(its_env),
        open_store(std::move(opener)),
        station(std::move(its_station)),
        limits(std::move(its_limits)) {
    seen = {{"locked", false},
            {"reasons", Json::array()},
            {"check_units", Json::array()},
            {"signature", nullptr},
            {"problem", ""}};
    thread = std::jthread([this](const std::stop_token& stop) { watch(stop); });
  }

  Result<StationState> state() {
    SIXPOINT_ASSIGN(auto store, open_store());
    return station_state(store, station, limits.check_unit);
  }

  void watch(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      look();
      std::unique_lock lock(mutex);
      wake.wait_for(lock, stop, kBetweenLooks, [&] { return asked; });
      asked = false;
    }
  }

  void look() {
    const auto found = state();
    const std::lock_guard lock(mutex);
    Json now = seen;
    if (found) {
      now = found->to_json();
      now.erase("charts");
      now.erase("station");
      now["problem"] = "";
    } else {
      // What was known stays: a store that is away neither locks a station nor opens it.
      now["problem"] = found.error().brief();
    }
    if (now != seen) {
      seen = std::move(now);
      ++changes;
    }
  }

  Env& env;
  const StoreOpener open_store;
  const std::string station;
  const Limits limits;

  mutable std::mutex mutex;  // guards what follows
  std::condition_variable_any wake;
  bool asked = false;
  Json seen;
  std::atomic<std::uint64_t> changes{0};
  std::jthread thread;  // last: it uses all of the above
};

StationDesk::StationDesk(Env& env, StoreOpener open_store, std::string station, Limits limits)
    : impl_(std::make_unique<Impl>(env, std::move(open_store), std::move(station),
                                   std::move(limits))) {}
StationDesk::~StationDesk() = default;

Json StationDesk::lock() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->seen;
}

std::uint64_t StationDesk::changes() const { return impl_->changes; }

void StationDesk::look_soon() {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->asked = true;
  }
  impl_->wake.notify_all();
}

Result<Json> StationDesk::check_units() {
  SIXPOINT_ASSIGN(const StationState state, impl_->state());
  Json json = state.to_json();
  std::vector<std::string> names;
  for (const CheckUnitChart& chart : state.charts) {
    names.push_back(chart.chart.name);
  }
  json["titles"] = titles_for(names);
  json["baseline_runs"] = impl_->limits.check_unit.baseline_runs;
  json["locking_rules"] = impl_->limits.check_unit.locking_rules;
  return json;
}

Result<std::string> StationDesk::decide(const Decision& decision) {
  const auto is_blank = [](const std::string& text) {
    return text.find_first_not_of(" \t") == std::string::npos;
  };
  if (is_blank(decision.operator_name) || is_blank(decision.reason)) {
    return fail(ErrorCode::usage, "a decision needs a name and a reason", {},
                "both are kept with it");
  }
  SIXPOINT_ASSIGN(auto store, impl_->open_store());
  db::StationEvent event;
  event.station = impl_->station;
  event.serial = decision.serial;
  event.action = decision.action;
  event.operator_name = decision.operator_name;
  event.reason = decision.reason;
  SIXPOINT_ASSIGN(const std::string id, store.add_station_event(event));
  impl_->look();
  return id;
}

Result<Json> StationDesk::statistics(const StatisticsQuestion& question) {
  db::RunFilter filter;
  SIXPOINT_ASSIGN(filter.from, day(question.from, "from"));
  SIXPOINT_ASSIGN(filter.to, day(question.to, "to"));
  SIXPOINT_ASSIGN(auto store, impl_->open_store());
  SIXPOINT_ASSIGN(const auto runs, summaries(store, filter));
  SIXPOINT_ASSIGN(const StatisticsReport report, station::statistics(runs, question.by));
  Json json = report.to_json();
  json["codes"] = Json::object();
  for (const auto& [code, count] : report.all.failure_codes) {
    if (const FailureCode* known = find_failure_code(code)) {
      json["codes"][code] = {{"meaning", known->meaning},
                             {"cause", known->cause},
                             {"next_action", known->next_action}};
    }
  }
  std::vector<std::string> names;
  for (const auto& [name, capability] : report.capabilities) {
    names.push_back(name);
  }
  json["titles"] = titles_for(names);
  return json;
}

Result<Json> StationDesk::studies() {
  SIXPOINT_ASSIGN(auto store, impl_->open_store());
  std::set<std::string> names;
  std::map<std::string, std::set<std::string>> axes;
  db::RunFilter filter;
  filter.kind = kStudyKind;
  SIXPOINT_CHECK(store.for_each_run(filter, [&](const db::RunRecord& run) -> Status {
    const Json json = Json::parse(run.document, nullptr, false);
    if (json.is_object() && json.contains("study") && json["study"].is_string()) {
      names.insert(json["study"].get<std::string>());
      for (const JudgedQuantity& quantity : summary_of(run).quantities) {
        axes[quantity.name].insert(quantity.axis);
      }
    }
    return {};
  }));
  Json json;
  json["studies"] = names;
  json["quantities"] = Json::array();
  for (const QuantityInfo& info : quantities()) {
    const auto found = axes.find(std::string(info.name));
    if (found != axes.end()) {
      json["quantities"].push_back(title_of(info));
      json["quantities"].back()["axes"] = found->second;
    }
  }
  return json;
}

Result<Json> StationDesk::gage_study(const GageQuestion& question) {
  SIXPOINT_ASSIGN(auto store, impl_->open_store());
  SIXPOINT_ASSIGN(const auto readings,
                  gage_readings(store, question.study, question.quantity, question.axis));
  GageOptions options;
  if (question.tolerance > 0) {
    options.tolerance = question.tolerance;
  }
  SIXPOINT_ASSIGN(const GageReport report, gage_rr(readings, options));
  Json json;
  json["study"] = question.study;
  json["quantity"] = question.quantity;
  json["axis"] = question.axis;
  json.update(report.to_json());
  return json;
}

}  // namespace sixpoint::station
