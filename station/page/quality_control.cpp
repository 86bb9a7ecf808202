#include "station/page/quality_control.h"

#include <algorithm>
#include <deque>
#include <exception>
#include <map>
#include <set>

#include "base/text/json_text.h"
#include "station/certificate/certificate.h"
#include "station/records/run_records.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

// Signatures from elsewhere are rare, and each refresh computes the charts of all check units.
constexpr std::chrono::seconds kBetweenRefreshes{15};

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

QualityControl::QualityControl(StoreOpener open_store, std::string station, Limits limits,
                               Clock& clock)
    : open_store_(std::move(open_store)),
      station_(std::move(station)),
      limits_(std::move(limits)),
      clock_(clock),
      lock_({{"locked", false},
             {"reasons", Json::array()},
             {"check_units", Json::array()},
             {"signature", nullptr},
             {"problem", ""}}) {
  thread_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

Result<StationState> QualityControl::read_state() {
  SIXPOINT_ASSIGN(auto store, open_store_());
  return station_state(store, station_, limits_.check_unit, clock_.now());
}

void QualityControl::watch(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    // As Lane::work(): an exception is a defect. The next refresh may succeed.
    try {
      refresh();
    } catch (const std::exception& defect) {
      show_problem("a defect of the program ended the look into the store: " +
                   printable(defect.what()));
    }
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, stop, kBetweenRefreshes, [&] { return refresh_asked_; });
    refresh_asked_ = false;
  }
}

void QualityControl::refresh() {
  const auto state = read_state();
  if (!state) {
    return show_problem(state.error().brief());
  }
  Json now = state->to_json();
  now.erase("charts");
  now.erase("station");
  now["problem"] = "";
  const std::lock_guard lock(mutex_);
  show(std::move(now));
}

// The last state stays: a store that does not answer neither locks a station nor opens it.
void QualityControl::show_problem(const std::string& problem) {
  const std::lock_guard lock(mutex_);
  Json now = lock_;
  now["problem"] = problem;
  show(std::move(now));
}

void QualityControl::show(Json now) {
  if (now != lock_) {
    lock_ = std::move(now);
    ++changes_;
  }
}

Json QualityControl::lock() const {
  const std::lock_guard lock(mutex_);
  return lock_;
}

std::uint64_t QualityControl::changes() const { return changes_; }

void QualityControl::refresh_soon() {
  {
    const std::lock_guard lock(mutex_);
    refresh_asked_ = true;
  }
  wake_.notify_all();
}

Result<Json> QualityControl::check_units() {
  SIXPOINT_ASSIGN(const StationState state, read_state());
  Json json = state.to_json();
  std::vector<std::string> names;
  for (const CheckUnitChart& chart : state.charts) {
    names.push_back(chart.chart.name);
  }
  json["titles"] = titles_for(names);
  json["baseline_runs"] = limits_.check_unit.baseline_runs;
  json["locking_rules"] = limits_.check_unit.locking_rules;
  return json;
}

Result<std::string> QualityControl::decide(db::StationEvent decision) {
  decision.station = station_;
  SIXPOINT_ASSIGN(auto store, open_store_());
  SIXPOINT_ASSIGN(const std::string id, add_decision(store, decision));
  refresh();
  return id;
}

Result<Json> QualityControl::statistics(const StatisticsQuery& query) {
  SIXPOINT_ASSIGN(const auto filter, runs_between(query.from, query.to, ""));
  SIXPOINT_ASSIGN(auto store, open_store_());
  SIXPOINT_ASSIGN(const auto runs, summaries(store, filter));
  SIXPOINT_ASSIGN(const StatisticsReport report, station::statistics(runs, query.by));
  Json json = report.to_json();
  json["codes"] = Json::object();
  for (const auto& [code, count] : report.all.failure_codes) {
    if (const FailureCode* known = find_failure_code(code)) {
      json["codes"][code] = {{"meaning", known->meaning},
                             {"cause", known->cause},
                             {"next_action", known->next_action}};
    }
  }
  std::vector<std::string> names = report.limits_differ;
  for (const auto& [name, capability] : report.capabilities) {
    names.push_back(name);
  }
  json["titles"] = titles_for(names);
  return json;
}

Result<Json> QualityControl::runs(const std::string& from, const std::string& serial) {
  constexpr std::size_t kMostRuns = 200;
  db::RunFilter filter;
  filter.serial = serial;
  if (serial.empty()) {
    filter.station = station_;
    SIXPOINT_ASSIGN(filter.from, parse_iso8601(from));
  }
  SIXPOINT_ASSIGN(auto store, open_store_());
  std::deque<Json> newest;
  for (const char* kind : {"jig", kWriteKind}) {
    filter.kind = kind;
    SIXPOINT_CHECK(store.for_each_run(filter, [&](const db::RunRecord& run) -> Status {
      const Json document = parse_json(run.document);
      const bool written = document.is_object() &&
                           document.value("/as_left/written"_json_pointer, Json(false)) == true;
      newest.push_front({{"run", run.id},
                         {"serial", run.serial},
                         {"started", to_iso8601(run.started)},
                         {"ended", to_iso8601(run.ended)},
                         {"verdict", run.verdict},
                         {"operator", run.operator_name},
                         {"written", written},
                         {"documents", documents_of(run)}});
      return {};
    }));
  }
  std::stable_sort(newest.begin(), newest.end(), [](const Json& a, const Json& b) {
    return a["ended"].get_ref<const std::string&>() > b["ended"].get_ref<const std::string&>();
  });
  newest.resize(std::min(newest.size(), kMostRuns));
  return Json{{"runs", newest}};
}

Result<Json> QualityControl::studies() {
  SIXPOINT_ASSIGN(auto store, open_store_());
  std::set<std::string> names;
  std::map<std::string, std::set<std::string>> axes;
  db::RunFilter filter;
  filter.kind = kStudyKind;
  SIXPOINT_CHECK(store.for_each_run(filter, [&](const db::RunRecord& run) -> Status {
    const Json json = parse_json(run.document);
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

Result<Json> QualityControl::gage_study(const GageQuery& query) {
  SIXPOINT_ASSIGN(auto store, open_store_());
  SIXPOINT_ASSIGN(const auto readings,
                  gage_readings(store, query.study, query.quantity, query.axis));
  GageOptions options;
  if (query.tolerance > 0) {
    options.tolerance = query.tolerance;
  }
  SIXPOINT_ASSIGN(const GageReport report, gage_rr(readings, options));
  Json json;
  json["study"] = query.study;
  json["quantity"] = query.quantity;
  json["axis"] = query.axis;
  json.update(report.to_json());
  return json;
}

}  // namespace sixpoint::station
