#include "station/run_folder.h"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "station/jig_progress.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kSamples = "samples-";
constexpr const char* kCapture = "/capture.json";
constexpr std::uint64_t kMostState_bytes = 4U << 20U;
// Eight hours of a sixteenth lane: more is no run.
constexpr std::uint64_t kMostSamples_bytes = 256ULL << 20U;

Json page_json(const std::optional<device::CalibrationPage>& page) {
  if (!page) {
    return nullptr;
  }
  Json json = calib::to_json(page->constants);
  json["calibrated"] = to_iso8601(page->calibrated);
  return json;
}

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

Result<UnfinishedRun> parse_run(const Json& json) {
  UnfinishedRun run;
  run.device = json.at("device").get<std::string>();
  run.serial = json.at("serial").get<std::string>();
  run.firmware = json.at("firmware").get<std::string>();
  run.operator_name = json.at("operator").get<std::string>();
  run.station = json.at("station").get<std::string>();
  run.client = json.at("client").get<std::string>();
  run.write = json.at("write").get<bool>();
  SIXPOINT_ASSIGN(run.filter,
                  calib::parse_filter_configuration(json.at("filter").get<std::string>()));
  SIXPOINT_ASSIGN(run.resume.started, parse_iso8601(json.at("started").get<std::string>()));
  SIXPOINT_ASSIGN(run.resume.as_found, parse_page(json.at("as_found")));
  SIXPOINT_ASSIGN(run.resume.written, parse_page(json.at("written")));
  SIXPOINT_ASSIGN(run.resume.progress, parse_jig_progress(json.at("progress")));
  return run;
}

Result<UnfinishedCapture> parse_capture(const Json& json) {
  UnfinishedCapture capture;
  capture.serial = json.at("serial").get<std::string>();
  capture.operator_name = json.at("operator").get<std::string>();
  capture.client = json.at("client").get<std::string>();
  capture.output = json.at("output").get<std::string>();
  SIXPOINT_ASSIGN(capture.resume.started, parse_iso8601(json.at("started").get<std::string>()));
  for (const Json& side : json.at("done")) {
    const auto pose = device::parse_pose(side.at("pose").get<std::string>());
    if (!pose) {
      return fail(ErrorCode::bad_data, "no pose");
    }
    capture.resume.done.push_back({*pose, side.at("recording").get<std::uint16_t>()});
  }
  return capture;
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

Result<std::vector<std::string>> RunFolder::names() const {
  if (!env_.files.info(folder_)) {
    return std::vector<std::string>{};
  }
  return env_.files.list(folder_);
}

Result<std::optional<UnfinishedRun>> RunFolder::load() {
  const std::string path = folder_ + "/run.json";
  if (!env_.files.info(path)) {
    return std::nullopt;
  }
  SIXPOINT_ASSIGN(const Bytes bytes, read_file(env_.files, path, kMostState_bytes));
  const Json json = Json::parse(bytes, nullptr, false);
  UnfinishedRun run;
  try {
    SIXPOINT_ASSIGN(run, parse_run(json));
  } catch (const std::exception&) {
    return fail(ErrorCode::bad_data, "this is no state of a run", path,
                "look at it, then remove the folder");
  }
  SIXPOINT_ASSIGN(const auto list, names());
  std::vector<int> numbers;
  for (const std::string& name : list) {
    if (number_of(name) > 0) {
      numbers.push_back(number_of(name));
    }
  }
  std::sort(numbers.begin(), numbers.end());
  for (const int number : numbers) {
    SIXPOINT_ASSIGN(const Bytes rows,
                    read_file(env_.files, fmt::format("{}/{}{}.csv", folder_, kSamples, number),
                              kMostSamples_bytes));
    // A power cut may have torn the last row.
    const auto end = std::find(rows.rbegin(), rows.rend(), std::uint8_t{'\n'}).base();
    run.resume.raw_csv.append(rows.begin(), end);
  }
  return run;
}

Status RunFolder::save(const UnfinishedRun& run) {
  Json json;
  json["schema"] = "sixpoint/unfinished-run/1";
  json["device"] = run.device;
  json["serial"] = run.serial;
  json["firmware"] = run.firmware;
  json["operator"] = run.operator_name;
  json["station"] = run.station;
  json["client"] = run.client;
  json["write"] = run.write;
  json["filter"] = calib::to_string(run.filter);
  json["started"] = to_iso8601(run.resume.started);
  json["as_found"] = page_json(run.resume.as_found);
  json["written"] = page_json(run.resume.written);
  json["progress"] = to_json(run.resume.progress);
  SIXPOINT_CHECK(env_.files.make_folders(folder_));
  return write_file(env_.files, folder_ + "/run.json",
                    json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

Status RunFolder::append(std::string_view rows) {
  if (!file_) {
    SIXPOINT_CHECK(env_.files.make_folders(folder_));
    SIXPOINT_ASSIGN(const auto list, names());
    int last = 0;
    for (const std::string& name : list) {
      last = std::max(last, number_of(name));
    }
    SIXPOINT_ASSIGN(file_,
                    env_.files.create(fmt::format("{}/{}{}.csv", folder_, kSamples, last + 1)));
    SIXPOINT_CHECK(env_.files.sync_folder(folder_));
    size_ = 0;
  }
  SIXPOINT_CHECK(file_->write_at(
      size_, std::span(reinterpret_cast<const std::uint8_t*>(rows.data()), rows.size())));
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
  SIXPOINT_CHECK(close());
  SIXPOINT_ASSIGN(const auto list, names());
  // The state goes first: samples without it are no run.
  for (const bool state : {true, false}) {
    for (const std::string& name : list) {
      if (state ? name == "run.json" : number_of(name) > 0) {
        SIXPOINT_CHECK(env_.files.remove(folder_ + "/" + name));
      }
    }
  }
  return env_.files.info(folder_) ? env_.files.sync_folder(folder_) : Status{};
}

Result<std::optional<UnfinishedCapture>> RunFolder::load_capture() {
  const std::string path = folder_ + kCapture;
  if (!env_.files.info(path)) {
    return std::nullopt;
  }
  SIXPOINT_ASSIGN(const Bytes bytes, read_file(env_.files, path, kMostState_bytes));
  try {
    SIXPOINT_ASSIGN(const UnfinishedCapture capture,
                    parse_capture(Json::parse(bytes, nullptr, false)));
    return capture;
  } catch (const std::exception&) {
    return fail(ErrorCode::bad_data, "this is no state of a capture", path,
                "look at it, then remove the folder");
  }
}

Status RunFolder::save_capture(const UnfinishedCapture& capture) {
  Json json;
  json["schema"] = "sixpoint/unfinished-capture/1";
  json["serial"] = capture.serial;
  json["operator"] = capture.operator_name;
  json["client"] = capture.client;
  json["output"] = capture.output;
  json["started"] = to_iso8601(capture.resume.started);
  json["done"] = Json::array();
  for (const CaptureResume::Side& side : capture.resume.done) {
    json["done"].push_back({{"pose", device::to_string(side.pose)}, {"recording", side.recording}});
  }
  SIXPOINT_CHECK(env_.files.make_folders(folder_));
  return write_file(env_.files, folder_ + kCapture,
                    json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

Status RunFolder::clear_capture() {
  if (!env_.files.info(folder_ + kCapture)) {
    return {};
  }
  SIXPOINT_CHECK(env_.files.remove(folder_ + kCapture));
  return env_.files.sync_folder(folder_);
}

Status RunFolder::set_aside() {
  SIXPOINT_ASSIGN(const auto list, names());
  const std::string mark = fmt::format("{}.bad", to_unix_seconds(env_.clock.now()));
  for (const std::string& name : list) {
    if (name == "run.json" || name == "capture.json" || number_of(name) > 0) {
      SIXPOINT_CHECK(
          env_.files.rename(folder_ + "/" + name, fmt::format("{}/{}.{}", folder_, name, mark)));
    }
  }
  return {};
}

}  // namespace sixpoint::station
