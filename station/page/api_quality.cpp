// Check units, the lock, statistics, gage studies: the routes of quality_control.h.
#include <charconv>

#include "base/serial.h"
#include "station/lanes/scan_rule.h"
#include "station/page/api_answers.h"
#include "station/page/quality_control.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

std::string parameter(const ApiRequest& request, const char* name) {
  return request.parameter(name).substr(0, kMostText);
}

ApiAnswer answer_of(const Result<Json>& json) {
  return json ? answer(200, *json) : refusal(json.error());
}

}  // namespace

std::optional<ApiAnswer> Api::get_quality(const ApiRequest& request, const std::string& what) {
  if (parts_.quality == nullptr) {
    return std::nullopt;
  }
  if (what == "check-units") {
    return answer_of(parts_.quality->check_units());
  }
  if (what == "runs") {
    // What was scanned or typed; a text that is no serial number is looked for all the same.
    const std::string serial = parameter(request, "serial");
    return answer_of(
        parts_.quality->runs(parameter(request, "from"), serial_of_label(serial).value_or(serial)));
  }
  if (what == "statistics") {
    return answer_of(parts_.quality->statistics(
        {parameter(request, "by"), parameter(request, "from"), parameter(request, "to")}));
  }
  if (what == "gage-rr") {
    GageQuery query;
    query.study = parameter(request, "study");
    if (query.study.empty()) {
      return answer_of(parts_.quality->studies());
    }
    if (const auto quantity = parameter(request, "quantity"); !quantity.empty()) {
      query.quantity = quantity;
      query.axis = parameter(request, "axis");
    }
    if (const std::string text = parameter(request, "tolerance"); !text.empty()) {
      const char* const end = text.data() + text.size();
      const auto [stop, error] = std::from_chars(text.data(), end, query.tolerance);
      if (error != std::errc() || stop != end || !(query.tolerance > 0)) {
        return bad_field("tolerance", "a width above 0");
      }
    }
    return answer_of(parts_.quality->gage_study(query));
  }
  return std::nullopt;
}

std::optional<ApiAnswer> Api::post_decision(const ApiRequest& request, const std::string& what,
                                            const Json& body) {
  if (parts_.quality == nullptr || (what != "station-lock" && what != "check-units")) {
    return std::nullopt;
  }
  // In addition to guard(): a form of another page cannot send this header.
  if (request.client.empty()) {
    return refusal(403, "client_needed", "a decision comes from the station's own page",
                   "send the header X-Sixpoint-Client");
  }
  const auto operator_name = text_of(body, "operator");
  const auto reason = text_of(body, "reason");
  if (!operator_name || !reason) {
    return bad_field(operator_name ? "reason" : "operator", kNameWanted);
  }
  db::StationEvent decision;
  const auto who = signer(request, *operator_name, OperatorRole::engineer);
  if (!who) {
    return who.error();
  }
  decision.operator_name = who->name;
  decision.reason = *reason;
  if (what == "station-lock") {
    if (body.contains("new_baseline") && !body["new_baseline"].is_boolean()) {
      return bad_field("new_baseline", "true or false");
    }
    decision.action = body.value("new_baseline", false) ? "sign_new_baseline" : "sign";
  } else {
    const auto serial = text_of(body, "serial");
    const auto action = text_of(body, "action");
    if (!serial || !is_serial(*serial)) {
      return bad_field("serial", "a serial number");
    }
    if (!action || (*action != "add" && *action != "remove")) {
      return bad_field("action", "add or remove");
    }
    decision.serial = *serial;
    decision.action = *action == "add" ? "check_unit" : "check_unit_end";
  }
  const auto id = parts_.quality->decide(decision);
  if (!id) {
    return refusal(id.error());
  }
  return answer(200, {{"stored_id", *id}, {"lock", parts_.quality->lock()}});
}

}  // namespace sixpoint::station
