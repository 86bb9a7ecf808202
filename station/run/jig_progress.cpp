#include "station/run/jig_progress.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace sixpoint::station {

namespace {

PoseReading parse_reading(const nlohmann::ordered_json& json) {
  PoseReading reading;
  reading.pose = device::parse_pose(json.at("pose").get<std::string>()).value();
  reading.mean_lsb = json.at("mean_lsb").get<PerAxis<double>>();
  reading.sd_lsb = json.at("sd_lsb").get<PerAxis<double>>();
  reading.samples = json.at("samples").get<int>();
  reading.temperature_c = json.at("temperature_c").get<double>();
  reading.tilt_deg = json.at("tilt_deg").get<double>();
  if (!json.at("from").is_null()) {
    reading.from = device::parse_pose(json.at("from").get<std::string>()).value();
  }
  if (json.contains("turned_deg")) {
    reading.turned_deg = json.at("turned_deg").get<int>();
  }
  return reading;
}

}  // namespace

nlohmann::ordered_json to_json(const PoseReading& reading) {
  nlohmann::ordered_json json;
  json["pose"] = device::to_string(reading.pose);
  json["mean_lsb"] = reading.mean_lsb;
  json["sd_lsb"] = reading.sd_lsb;
  json["samples"] = reading.samples;
  json["temperature_c"] = reading.temperature_c;
  json["tilt_deg"] = reading.tilt_deg;
  json["from"] = reading.from ? nlohmann::ordered_json(device::to_string(*reading.from))
                              : nlohmann::ordered_json(nullptr);
  if (reading.turned_deg) {
    json["turned_deg"] = *reading.turned_deg;
  }
  return json;
}

nlohmann::ordered_json to_json(const JigProgress& progress) {
  nlohmann::ordered_json json;
  json["phase"] = to_string(progress.phase);
  json["refusals"] = progress.refusals;
  const auto list = [&json](const char* name, const std::vector<PoseReading>& readings) {
    json[name] = nlohmann::ordered_json::array();
    for (const PoseReading& reading : readings) {
      json[name].push_back(to_json(reading));
    }
  };
  list("faces", progress.faces);
  list("reversed", progress.reversed);
  list("reseat", progress.reseat);
  list("half_turn", progress.half_turn);
  list("recheck", progress.recheck);
  return json;
}

Result<JigProgress> parse_jig_progress(const nlohmann::ordered_json& json) {
  // nlohmann and value() throw on what does not fit; it stops here.
  try {
    JigProgress progress;
    SIXPOINT_ASSIGN(progress.phase, parse_jig_phase(json.at("phase").get<std::string>()));
    progress.refusals = json.at("refusals").get<int>();
    const auto list = [&json](const char* name, std::vector<PoseReading>& readings) {
      for (const auto& item : json.at(name)) {
        readings.push_back(parse_reading(item));
      }
    };
    list("faces", progress.faces);
    list("reversed", progress.reversed);
    list("reseat", progress.reseat);
    if (json.contains("half_turn")) {  // states of earlier versions do not have it
      list("half_turn", progress.half_turn);
    }
    list("recheck", progress.recheck);
    return progress;
  } catch (const std::exception& error) {
    return fail(ErrorCode::bad_data, fmt::format("the state of a run does not hold together: {}",
                                                 printable(error.what(), 120)));
  }
}

}  // namespace sixpoint::station
