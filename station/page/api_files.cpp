// Files below the station's folder: listed, checked, repaired.
#include <algorithm>
#include <optional>

#include "base/env.h"
#include "calib/solve.h"
#include "repair/triage/file_tree.h"
#include "station/capture/calibration_file.h"
#include "station/page/api_answers.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostListed = 2000;  // files of one folder

// A path of a body, as long as list_files() offers them: inside() says which are permitted. Empty
// where it is missing, nothing where it is no text.
std::optional<std::string> path_text(const Json& body, const char* key) {
  if (!body.contains(key) || body[key].is_null()) {
    return std::string();
  }
  return body[key].is_string() ? std::optional(body[key].get<std::string>()) : std::nullopt;
}

}  // namespace

// The path that a request names, below the one folder that the station may read and write.
Result<std::string> Api::inside(const std::string& relative) const {
  const bool plain = relative.size() < 1000 && !relative.starts_with('/') &&
                     std::none_of(relative.begin(), relative.end(), [](char c) {
                       return static_cast<unsigned char>(c) < 0x20 || c == '\\';
                     });
  const bool up = ("/" + relative + "/").find("/../") != std::string::npos;
  if (!plain || up) {
    return fail(ErrorCode::permission, "this path leads out of the station's folder",
                printable(relative, 100), "choose a folder below it (--files)");
  }
  return relative.empty() ? options_.files_folder : options_.files_folder + "/" + relative;
}

ApiAnswer Api::list_files(const std::string& relative) const {
  const auto folder = inside(relative);
  if (!folder) {
    return refusal(folder.error());
  }
  const auto names = parts_.env.files.list(*folder);
  if (!names) {
    return refusal(404, "no_input", "there is no such folder");
  }
  Json json;
  json["path"] = printable(relative);
  json["folders"] = Json::array();
  json["files"] = Json::array();
  json["cut"] = names->size() > kMostListed;
  for (std::size_t i = 0; i < std::min(names->size(), kMostListed); ++i) {
    const std::string& name = (*names)[i];
    const auto info = parts_.env.files.info(*folder + "/" + name);
    if (!info || name.starts_with('.')) {
      continue;
    }
    if (info->is_folder) {
      json["folders"].push_back(name);
    } else if (repair::has_ending(name, ".gt3x")) {
      json["files"].push_back({{"name", name}, {"bytes", info->size}});
    }
  }
  return answer(200, json);
}

ApiAnswer Api::check_file(const Json& body) {
  const auto name = path_text(body, "file");
  if (!name || name->empty()) {
    return bad_field("file", "a file below the station's folder");
  }
  const auto path = inside(*name);
  if (!path) {
    return refusal(path.error());
  }
  const auto check = check_calibration_file(parts_.env, *path);
  if (!check) {
    return refusal(check.error());
  }
  Json json;
  json["file"] = *name;
  json["serial"] = printable(check->serial, 40);
  json["firmware"] = printable(check->firmware, 40);
  json["usable"] = check->usable();
  json["refusal"] = check->refusal;
  json["reasons"] =
      check->solved ? check->solved->verification.reasons : std::vector<std::string>{};
  json["repeat_sides"] =
      check->solved ? Json(check->solved->verification.missing_directions) : Json::array();
  json["solved"] = check->solved ? calib::to_json(*check->solved) : Json(nullptr);
  json["constants_file"] = nullptr;
  json["stored_id"] = nullptr;
  if (check->usable() && body.value("save", Json(false)) == Json(true)) {
    CaptureReport report;
    report.serial = check->serial;
    report.firmware = check->firmware;
    report.file = *path;
    report.file_sha256 = check->sha256;
    report.solved = check->solved;
    const auto stored = parts_.store_constants(report);
    if (!stored) {
      return refusal(stored.error());
    }
    json["stored_id"] = stored->id;
    if (stored->file_problem) {
      json["problem"] = stored->file_problem->brief();
    } else {
      json["constants_file"] = *name + ".constants.json";
    }
  }
  return answer(200, json);
}

ApiAnswer Api::start_repair(const Json& body) {
  const auto folder = path_text(body, "folder");
  const auto output = path_text(body, "output");
  const auto calibration = path_text(body, "calibration_file");
  if (!folder || !output || !calibration || output->empty()) {
    return bad_field("folder, output", "folders below the station's folder");
  }
  const auto from = inside(*folder);
  const auto into = inside(*output);
  const auto file = inside(*calibration);
  for (const auto* path : {&from, &into, &file}) {
    if (!*path) {
      return refusal(path->error());
    }
  }
  const RepairOrder order = {*from, *into, calibration->empty() ? "" : *file};
  if (const Status started = parts_.repairs.start(order); !started) {
    return started.error().code == ErrorCode::usage
               ? refusal(409, "conflict", started.error().what, started.error().hint)
               : refusal(started.error());
  }
  return answer(202, parts_.repairs.to_json());
}

}  // namespace sixpoint::station
