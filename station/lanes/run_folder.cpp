#include "station/lanes/run_folder.h"

#include <algorithm>
#include <charconv>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "base/text/json_text.h"
#include "station/lanes/continue_rule.h"
#include "station/run/jig_progress.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kSamples = "samples-";
constexpr const char* kRun = "/run.json";
constexpr const char* kCapture = "/capture.json";
constexpr std::uint64_t kMostState_bytes = 4U << 20U;
// Eight hours: more than any run.
constexpr std::uint64_t kMostSamples_bytes = 256ULL << 20U;

Result<std::optional<device::CalibrationPage>> parse_page(const Json& json) {
  if (json.is_null()) {
    return std::nullopt;
  }
  device::CalibrationPage page;
  page.constants.positive_lsb = json.at("positive_lsb").get<PerAxis<int>>();
  page.constants.negative_lsb = json.at("negative_lsb").get<PerAxis<int>>();
  page.constants.zero_lsb = json.at("zero_lsb").get<PerAxis<int>>();
  SIXPOINT_ASSIGN(const UtcTime time, parse_iso8601(json.at("calibrated").get<std::string>()));
  page.calibrated = std::chrono::floor<std::chrono::seconds>(time);
  return page;
}

// What the states of a run and of a capture have in common.
template <class Unfinished>
Status parse_common(const Json& json, Unfinished& work) {
  json.at("serial").get_to(work.serial);
  json.at("operator").get_to(work.operator_name);
  json.at("client").get_to(work.client);
  SIXPOINT_ASSIGN(work.resume.started, parse_iso8601(json.at("started").get<std::string>()));
  return {};
}

Json retest_to_json(const std::optional<RetestState>& state) {
  return state ? Json{{"failures_in_row", state->failures_in_row},
                      {"passes_needed", state->passes_needed},
                      {"failures_left",
                       state->failures_left ? Json(*state->failures_left) : Json(nullptr)},
                      {"retest_of", state->retest_of}}
               : Json(nullptr);
}

std::optional<RetestState> parse_retest(const Json& json) {
  if (json.is_null()) {
    return std::nullopt;
  }
  RetestState state;  // of a run that was begun: it may start
  json.at("failures_in_row").get_to(state.failures_in_row);
  json.at("passes_needed").get_to(state.passes_needed);
  json.at("retest_of").get_to(state.retest_of);
  if (const Json left = json.value("failures_left", Json(nullptr)); !left.is_null()) {
    state.failures_left = left.get<int>();  // not in a run that 0.1.0 left
  }
  return state;
}

Json stream_to_json(const device::StreamStatistics& stream) {
  Json json;
  device::for_each_count([&](const char* name, auto member) { json[name] = stream.*member; });
  return json;
}

device::StreamStatistics parse_stream(const Json& json) {
  device::StreamStatistics stream;
  device::for_each_count(
      [&](const char* name, auto member) { json.at(name).get_to(stream.*member); });
  return stream;
}

Result<UnfinishedRun> parse_run(const Json& json) {
  UnfinishedRun run;
  SIXPOINT_CHECK(parse_common(json, run));
  json.at("device").get_to(run.device);
  json.at("firmware").get_to(run.firmware);
  json.at("station").get_to(run.station);
  json.at("write").get_to(run.write);
  run.is_authenticated = json.value("operator_authenticated", false);
  SIXPOINT_ASSIGN(run.filter,
                  calib::parse_filter_configuration(json.at("filter").get<std::string>()));
  SIXPOINT_ASSIGN(run.resume.as_found, parse_page(json.at("as_found")));
  SIXPOINT_ASSIGN(run.resume.written, parse_page(json.at("written")));
  // Folders of earlier versions do not have these.
  run.jig = json.value("jig", run.jig);
  SIXPOINT_ASSIGN(run.protocol, parse_jig_protocol(json.value("protocol", "production")));
  if (json.contains("jig_id") && !json["jig_id"].is_null()) {
    run.jig_id = json["jig_id"].get<std::string>();
  }
  if (json.contains("gravity_m_per_s2") && !json["gravity_m_per_s2"].is_null()) {
    run.gravity_m_per_s2 = json["gravity_m_per_s2"].get<double>();
  }
  run.kind = json.value("kind", run.kind);
  run.constants_id = json.value("constants_id", run.constants_id);
  run.retest = parse_retest(json.value("retest", Json(nullptr)));
  run.rows_bytes = json.value("rows_bytes", run.rows_bytes);
  run.rows_sha256 = json.value("rows_sha256", run.rows_sha256);
  run.resume.write_begun = json.value("write_begun", false);
  if (json.contains("stream")) {
    run.resume.stream = parse_stream(json["stream"]);
  }
  SIXPOINT_ASSIGN(run.resume.progress, parse_jig_progress(json.at("progress")));
  return run;
}

Result<UnfinishedCapture> parse_capture(const Json& json) {
  UnfinishedCapture capture;
  SIXPOINT_CHECK(parse_common(json, capture));
  json.at("output").get_to(capture.output);
  // Not in earlier versions, or whether it was.
  const Json asked_again = json.value("asked_again", Json(0));
  capture.resume.asked_again =
      asked_again.is_boolean() ? int{asked_again.get<bool>()} : asked_again.get<int>();
  for (const Json& side : json.at("done")) {
    SIXPOINT_ASSIGN(const auto pose, device::parse_pose(side.at("pose").get<std::string>()));
    capture.resume.done.push_back({pose, side.at("recording").get<std::uint16_t>()});
  }
  return capture;
}

// Nothing where the file is not there.
template <class Unfinished>
Result<std::optional<Unfinished>> read_state(FileSystem& files, const std::string& path,
                                             Result<Unfinished> (*parse)(const Json&)) {
  if (!files.info(path)) {
    return std::nullopt;
  }
  SIXPOINT_ASSIGN(const Bytes bytes, read_file(files, path, kMostState_bytes));
  try {
    SIXPOINT_ASSIGN(Unfinished work, parse(parse_json(as_text(bytes))));
    return work;
  } catch (const std::exception&) {
    return fail(ErrorCode::bad_data, "this is not the state of a run or capture", path,
                "check the file, then remove the folder");
  }
}

Status write_state(FileSystem& files, const std::string& folder, const char* name,
                   const Json& json) {
  SIXPOINT_CHECK(make_synced_folders(files, folder));
  return write_file(files, folder + name,
                    json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

// samples-12.csv -> 12; 0 for other names.
int number_of(std::string_view name) {
  constexpr std::string_view kEnding = ".csv";
  int number = 0;
  if (name.starts_with(kSamples) && name.ends_with(kEnding)) {
    const std::string_view digits =
        name.substr(kSamples.size(), name.size() - kSamples.size() - kEnding.size());
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    if (error != std::errc() || end != digits.data() + digits.size()) {
      return 0;
    }
  }
  return number;
}

}  // namespace

Result<std::vector<std::string>> RunFolder::sample_files() const {
  std::vector<std::string> found;
  if (env_.files.info(folder_)) {
    SIXPOINT_ASSIGN(found, env_.files.list(folder_));
    std::erase_if(found, [](const std::string& name) { return number_of(name) == 0; });
    std::sort(found.begin(), found.end(), [](const std::string& a, const std::string& b) {
      return number_of(a) < number_of(b);
    });
  }
  return found;
}

Result<std::optional<UnfinishedRun>> RunFolder::load() {
  SIXPOINT_ASSIGN(auto run, read_state(env_.files, folder_ + kRun, parse_run));
  if (!run) {
    return run;
  }
  SIXPOINT_ASSIGN(const auto names, sample_files());
  for (const std::string& name : names) {
    SIXPOINT_ASSIGN(const Bytes rows,
                    read_file(env_.files, folder_ + "/" + name, kMostSamples_bytes));
    // The last row may be incomplete after a power cut.
    const auto end = std::find(rows.rbegin(), rows.rend(), std::uint8_t{'\n'}).base();
    run->resume.raw_csv.append(rows.begin(), end);
  }
  const std::string_view rows = run->resume.raw_csv;
  if (!run->rows_sha256.empty() &&
      text_sha256(rows.substr(0, run->rows_bytes)) != run->rows_sha256) {
    return fail(
        ErrorCode::bad_data,
        "the samples of this run are not as they were measured: some are missing or damaged",
        folder_, "measure the unit again");
  }
  return run;
}

Status RunFolder::save(const UnfinishedRun& run) {
  if (file_) {
    SIXPOINT_CHECK(file_->sync());  // the rows that the state is about come first
  } else {
    SIXPOINT_CHECK(remove_samples_of_no_run());
  }
  const Json json = {
      {"schema", "sixpoint/unfinished-run/1"},
      {"device", run.device},
      {"serial", run.serial},
      {"firmware", run.firmware},
      {"operator", run.operator_name},
      {"operator_authenticated", run.is_authenticated},
      {"station", run.station},
      {"client", run.client},
      {"write", run.write},
      {"kind", run.kind},
      {"constants_id", run.constants_id},
      {"retest", retest_to_json(run.retest)},
      {"rows_bytes", run.rows_bytes},
      {"rows_sha256", run.rows_sha256},
      {"filter", calib::to_string(run.filter)},
      {"protocol", to_string(run.protocol)},
      {"jig", run.jig},
      {"jig_id", run.jig_id ? Json(*run.jig_id) : Json(nullptr)},
      {"gravity_m_per_s2", run.gravity_m_per_s2 ? Json(*run.gravity_m_per_s2) : Json(nullptr)},
      {"started", to_iso8601(run.resume.started)},
      {"as_found", page_to_json(run.resume.as_found)},
      {"written", page_to_json(run.resume.written)},
      {"write_begun", run.resume.write_begun},
      {"stream", stream_to_json(run.resume.stream)},
      {"progress", to_json(run.resume.progress)}};
  return write_state(env_.files, folder_, kRun, json);
}

Status RunFolder::append(std::string_view rows) {
  if (!file_) {
    SIXPOINT_CHECK(make_synced_folders(env_.files, folder_));
    SIXPOINT_CHECK(remove_samples_of_no_run());
    SIXPOINT_ASSIGN(const auto names, sample_files());
    const int next = names.empty() ? 1 : number_of(names.back()) + 1;
    SIXPOINT_ASSIGN(file_, env_.files.create(fmt::format("{}/{}{}.csv", folder_, kSamples, next)));
    SIXPOINT_CHECK(env_.files.sync_folder(folder_));
    size_ = 0;
  }
  SIXPOINT_CHECK(file_->write_at(size_, as_bytes(rows)));
  size_ += rows.size();
  if (env_.clock.elapsed() - synced_ > std::chrono::seconds(1)) {
    synced_ = env_.clock.elapsed();
    return file_->sync();
  }
  return {};
}

Status RunFolder::close() {
  if (!file_) {
    return {};
  }
  const auto file = std::move(file_);
  SIXPOINT_CHECK(file->sync());
  return file->close();
}

Status RunFolder::clear() {
  ended_report_.clear();
  SIXPOINT_CHECK(close());
  if (!env_.files.info(folder_)) {
    return {};
  }
  // The state goes first: without it, the samples belong to no run.
  if (env_.files.info(folder_ + kRun)) {
    SIXPOINT_CHECK(env_.files.remove(folder_ + kRun));
  }
  SIXPOINT_CHECK(remove_samples_of_no_run());
  return env_.files.sync_folder(folder_);
}

Status RunFolder::remove_samples_of_no_run() {
  if (env_.files.info(folder_ + kRun)) {
    return {};
  }
  SIXPOINT_ASSIGN(const auto names, sample_files());
  for (const std::string& name : names) {
    SIXPOINT_CHECK(env_.files.remove(folder_ + "/" + name));
  }
  return {};
}

Result<std::optional<UnfinishedCapture>> RunFolder::load_capture() {
  return read_state(env_.files, folder_ + kCapture, parse_capture);
}

Status RunFolder::save_capture(const UnfinishedCapture& capture) {
  Json json = {{"schema", "sixpoint/unfinished-capture/1"},
               {"serial", capture.serial},
               {"operator", capture.operator_name},
               {"client", capture.client},
               {"output", capture.output},
               {"asked_again", capture.resume.asked_again},
               {"started", to_iso8601(capture.resume.started)}};
  json["done"] = Json::array();
  for (const CaptureResume::Side& side : capture.resume.done) {
    // The station asks for the six sides alone.
    json["done"].push_back({{"pose", device::to_string(std::get<device::Pose>(side.pose))},
                            {"recording", side.recording}});
  }
  return write_state(env_.files, folder_, kCapture, json);
}

Status RunFolder::clear_capture() {
  if (!env_.files.info(folder_ + kCapture)) {
    return {};
  }
  SIXPOINT_CHECK(env_.files.remove(folder_ + kCapture));
  return env_.files.sync_folder(folder_);
}

Status RunFolder::set_aside_run() {
  SIXPOINT_ASSIGN(auto names, sample_files());
  names.emplace_back(kRun + 1);
  return set_aside(names);
}

Result<std::string> RunFolder::set_aside_ended_run(std::string_view report) {
  SIXPOINT_CHECK(close());
  SIXPOINT_CHECK(make_synced_folders(env_.files, folder_));
  if (ended_report_.empty()) {
    ended_report_ =
        fmt::format("{}/report.json.{}.bad", folder_, to_unix_seconds(env_.clock.now()));
  }
  SIXPOINT_CHECK(write_file(env_.files, ended_report_, report));
  SIXPOINT_CHECK(set_aside_run());
  SIXPOINT_CHECK(env_.files.sync_folder(folder_));
  return std::exchange(ended_report_, {});
}

Status RunFolder::set_aside_capture() { return set_aside({kCapture + 1}); }

Status RunFolder::set_aside(const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    const std::string path = folder_ + "/" + name;
    if (env_.files.info(path)) {
      SIXPOINT_CHECK(env_.files.rename(
          path, fmt::format("{}.{}.bad", path, to_unix_seconds(env_.clock.now()))));
    }
  }
  return {};
}

void RunSaver::check(const Status& status) {
  if (!status && !std::exchange(has_failed_, true)) {
    warn_("this run would not survive a restart: " + status.error().brief());
  }
}

Result<std::optional<JigResume>> RunSaver::take_left_over(bool begin_again) {
  auto left = folder_.load();
  if (!left) {
    warn_(left.error().brief() + "; it is set aside");
    check(folder_.set_aside_run());
    return std::nullopt;
  }
  if (!*left) {
    return std::nullopt;
  }
  bool goes_on = false;
  if (!begin_again) {
    SIXPOINT_ASSIGN(goes_on, run_goes_on(**left, state_));
  }
  if (!goes_on) {
    check(folder_.clear());
    return std::nullopt;
  }
  state_.operator_name = both_names((*left)->operator_name, state_.operator_name);
  state_.is_authenticated = state_.is_authenticated && (*left)->is_authenticated;
  return std::move((*left)->resume);
}

Status RunSaver::save_now(const JigReport& report, const JigRun& run) {
  state_.rows_bytes = report.raw_csv.size();
  state_.rows_sha256 = report.raw_sha256();
  state_.resume.started = report.started;
  state_.resume.as_found = report.as_found;
  state_.resume.written = report.written ? report.as_left : std::nullopt;
  state_.resume.write_begun = report.write_begun;
  state_.resume.stream = report.stream;
  state_.resume.progress = run.progress();
  return folder_.save(state_);
}

void RunSaver::save(const JigReport& report, const JigRun& run) {
  if (run.phase() != JigPhase::finished) {
    check(save_now(report, run));
  }
}

}  // namespace sixpoint::station
