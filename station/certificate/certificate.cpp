#include "station/certificate/certificate.h"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/measure.h"
#include "base/text/json_text.h"
#include "gt3x/forms/model.h"
#include "station/certificate/dcc.h"
#include "station/run/jig_report.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

// Reads a run's document. What is missing or of another type keeps its value; certificate_of()
// decides whether the rest makes a certificate.
class Document {
 public:
  explicit Document(const Json& json) : json_(json) {}

  Document in(const char* key) const {
    static const Json kNothing = Json::object();
    return Document(has(key) && json_[key].is_object() ? json_[key] : kNothing);
  }
  bool has(const char* key) const {
    return json_.is_object() && json_.contains(key) && !json_[key].is_null();
  }
  const Json* list(const char* key) const {
    return has(key) && json_[key].is_array() ? &json_[key] : nullptr;
  }
  std::string text(const char* key) const {
    return has(key) && json_[key].is_string() ? json_[key].get<std::string>() : std::string();
  }
  std::optional<double> number(const char* key) const {
    return has(key) && json_[key].is_number() ? std::optional(json_[key].get<double>())
                                              : std::nullopt;
  }
  bool flag(const char* key) const {
    return has(key) && json_[key].is_boolean() && json_[key].get<bool>();
  }
  template <class T>
  bool three(const char* key, PerAxis<T>& into) const {
    const Json* values = list(key);
    if (values == nullptr || values->size() != kAxes) {
      return false;
    }
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const Json& value = (*values)[axis];
      if (!value.is_number() || (std::is_integral_v<T> && !value.is_number_integer())) {
        return false;
      }
      into[axis] = value.get<T>();
    }
    return true;
  }
  std::vector<std::string> texts(const char* key) const {
    std::vector<std::string> out;
    if (const Json* values = list(key)) {
      for (const Json& value : *values) {
        if (value.is_string()) {
          out.push_back(value.get<std::string>());
        }
      }
    }
    return out;
  }

 private:
  const Json& json_;
};

bool read_stored(const Document& from, StoredConstants& into) {
  return from.three("positive_lsb", into.positive_lsb) &&
         from.three("negative_lsb", into.negative_lsb) && from.three("zero_lsb", into.zero_lsb);
}

std::optional<Certificate::Constants> read_page(const Document& from) {
  Certificate::Constants page;
  if (!read_stored(from, page.stored)) {
    return std::nullopt;
  }
  page.calibrated = from.text("calibrated");
  page.residual_mg = from.number("residual_mg");
  return page;
}

std::vector<Certificate::Pose> read_poses(const Json* list) {
  std::vector<Certificate::Pose> poses;
  for (const Json& item : list != nullptr ? *list : Json::array()) {
    const Document from(item);
    Certificate::Pose pose;
    pose.pose = from.text("pose");
    from.three("mean_lsb", pose.mean_lsb);
    from.three("sd_lsb", pose.sd_lsb);
    pose.samples = static_cast<int>(from.number("samples").value_or(0));
    pose.temperature_c = from.number("temperature_c");
    pose.tilt_deg = from.number("tilt_deg").value_or(0);
    pose.error_mg = from.number("error_mg");
    pose.chose_solution = from.flag("chose_solution");
    poses.push_back(std::move(pose));
  }
  return poses;
}

// False where one of them is missing.
bool read_results(const Document& document, Certificate& into) {
  const Document constants = document.in("constants");
  const Document expanded = document.in("uncertainty").in("expanded");
  return constants.three("sensitivity_g_per_lsb", into.sensitivity_g_per_lsb) &&
         constants.three("zero_lsb", into.zero_lsb) &&
         constants.three("positive_lsb", into.measured.positive_lsb) &&
         constants.three("negative_lsb", into.measured.negative_lsb) &&
         constants.three("stored_zero_lsb", into.measured.zero_lsb) &&
         expanded.three("sensitivity_percent", into.sensitivity_expanded_percent) &&
         expanded.three("zero_mg", into.zero_expanded_mg);
}

Json constants_to_json(const std::optional<Certificate::Constants>& constants) {
  if (!constants) {
    return nullptr;
  }
  Json json = calib::to_json(constants->stored);
  json["calibrated"] = constants->calibrated;
  json["residual_mg"] = constants->residual_mg ? Json(*constants->residual_mg) : Json(nullptr);
  return json;
}

Json poses_to_json(const std::vector<Certificate::Pose>& poses) {
  Json json = Json::array();
  for (const Certificate::Pose& pose : poses) {
    Json item = {{"pose", pose.pose},
                 {"mean_lsb", pose.mean_lsb},
                 {"sd_lsb", pose.sd_lsb},
                 {"samples", pose.samples},
                 {"temperature_c", pose.temperature_c ? Json(*pose.temperature_c) : Json(nullptr)},
                 {"tilt_deg", pose.tilt_deg}};
    if (pose.error_mg) {
      item["error_mg"] = *pose.error_mg;
      item["chose_solution"] = pose.chose_solution;
    }
    json.push_back(std::move(item));
  }
  return json;
}

// For ^FH: characters that are commands in ZPL, and control characters, in hex.
std::string zpl_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    out += byte < 0x20 || byte == 0x7F || c == '^' || c == '~' || c == '_' || c == '\\'
               ? fmt::format("_{:02X}", byte)
               : std::string(1, c);
  }
  return out;
}

}  // namespace

std::string method_in_words(const std::string& method) {
  return method == "six_pose_letter"   ? "the published formulas of six positions"
         : method == "six_pose_pair"   ? "least squares, each axis by itself"
         : method == "six_pose_vector" ? "least squares, all axes together"
                                       : method;
}

Result<Certificate> certificate_of(const db::RunRecord& run) {
  const Json json = parse_json(run.document);
  const Document document(json);
  const auto verdict = parse_jig_verdict(run.verdict);
  if ((run.kind != "jig" && run.kind != "write") || !verdict || *verdict == JigVerdict::stopped ||
      *verdict == JigVerdict::inconclusive || !document.in("constants").has("zero_lsb")) {
    return fail(
        ErrorCode::bad_data,
        fmt::format("run {} ended as '{}' and has no result to certify",
                    printable(db::shown_id(run.id)), printable(run.verdict, 40)),
        {},
        verdict == JigVerdict::fail
            ? "the unit failed before its six sides were measured; the run's report says why"
            : "measure the unit again with 'sixpoint jig'");
  }
  Certificate out;
  out.run = run.id;
  out.serial = run.serial;
  out.model = gt3x::model_of(run.serial);
  out.firmware = document.text("firmware");
  out.filter = run.filter;
  out.started = run.started;
  out.ended = run.ended;
  out.operator_name = run.operator_name;
  out.operator_authenticated = document.flag("operator_authenticated");
  out.station = run.station;
  out.software = run.build.empty() ? run.software : fmt::format("{} ({})", run.software, run.build);
  out.raw_sha256 = document.text("raw_sha256");
  out.head = run.head;
  out.jig = run.jig;
  out.jig_due = run.jig_due;
  out.verdict = *verdict;
  out.codes = run.codes;
  out.reasons = document.texts("reasons");
  if (const Json* quantities = document.list("quantities")) {
    out.quantities = quantities_from_json(*quantities);
  }
  const Document limits = document.in("limits");
  out.limits_source = limits.text("source");
  out.limits_sha256 = limits.text("sha256");
  out.decision.coverage_factor =
      limits.in("decision").number("coverage_factor").value_or(out.decision.coverage_factor);
  out.decision.guard_factor =
      limits.in("decision").number("guard_factor").value_or(out.decision.guard_factor);
  out.as_found = read_page(document.in("as_found"));
  out.as_left = read_page(document.in("as_left"));
  out.written = document.in("as_left").flag("written");
  out.method = document.text("method");
  if (!read_results(document, out) || out.quantities.empty()) {
    return fail(
        ErrorCode::bad_data,
        fmt::format("run {} lacks what a certificate needs", printable(db::shown_id(run.id))), {},
        "an earlier version of the program made it; measure the unit again");
  }
  out.poses = read_poses(document.list("poses"));
  out.verification = read_poses(document.in("verification").list("poses"));
  out.gravity_m_per_s2 = document.number("gravity_m_per_s2").value_or(0);
  out.gravity_standard_uncertainty_m_per_s2 =
      document.number("gravity_standard_uncertainty_m_per_s2").value_or(0);
  return out;
}

Json Certificate::to_json() const {
  Json json;
  json["schema"] = "sixpoint/certificate/1";
  json["run"] = run;
  json["unit"] = {{"serial", serial}, {"model", model}, {"firmware", firmware}, {"filter", filter}};
  json["calibrated"] = to_iso8601(ended);
  json["started"] = to_iso8601(started);
  json["issued"] = to_iso8601(ended);
  json["operator"] = operator_name;
  json["operator_authenticated"] = operator_authenticated;
  json["station"] = station;
  json["software"] = software;
  json["method"] = method;
  json["traceability"] = {{"jig", jig},
                          {"jig_due", jig_due ? Json(to_iso8601(*jig_due)) : Json(nullptr)}};
  json["environment"] = {{"gravity_m_per_s2", gravity_m_per_s2},
                         {"gravity_expanded_uncertainty_m_per_s2",
                          decision.coverage_factor * gravity_standard_uncertainty_m_per_s2}};
  for (const JudgedQuantity& quantity : quantities) {
    if (quantity.name == "temperature_c" || quantity.name == "temperature_change_c") {
      json["environment"][quantity.name] = quantity.value;
    }
  }
  json["as_found"] = constants_to_json(as_found);
  json["as_left"] = constants_to_json(as_left);
  json["written"] = written;
  json["results"] = {{"sensitivity_g_per_lsb", sensitivity_g_per_lsb},
                     {"sensitivity_expanded_uncertainty_percent", sensitivity_expanded_percent},
                     {"zero_lsb", zero_lsb},
                     {"zero_expanded_uncertainty_lsb", zero_expanded_lsb()},
                     {"coverage_factor", decision.coverage_factor}};
  json["verdict"] = to_string(verdict);
  json["codes"] = codes;
  json["reasons"] = reasons;
  json["decision_rule"] = {{"guide", "ILAC-G8:09/2019, 4.2.3"},
                           {"coverage_factor", decision.coverage_factor},
                           {"guard_factor", decision.guard_factor},
                           {"limits", limits_source},
                           {"limits_sha256", limits_sha256}};
  json["quantities"] = Json::array();
  for (const JudgedQuantity& quantity : quantities) {
    json["quantities"].push_back(station::to_json(quantity));
  }
  json["poses"] = poses_to_json(poses);
  json["verification"] = poses_to_json(verification);
  json["raw_sha256"] = raw_sha256;
  json["head"] = head.empty() ? Json(nullptr) : Json(head);
  json["accredited"] = false;
  return json;
}

PerAxis<double> Certificate::zero_expanded_lsb() const {
  PerAxis<double> lsb{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    lsb[axis] = zero_expanded_mg[axis] / kMgPerG / std::abs(sensitivity_g_per_lsb[axis]);
  }
  return lsb;
}

std::vector<std::string> documents_of(const db::RunRecord& run) {
  std::vector<std::string> names = {"report.json"};
  if (certificate_of(run)) {
    names.insert(names.end(), {"certificate.pdf", "certificate.json", "certificate.dcc.xml"});
  }
  if (label_zpl(run)) {
    names.emplace_back("label.zpl");
  }
  return names;
}

Status check_certificate_name(const std::string& path) {
  if (!path.ends_with(".pdf") && !path.ends_with(".json") && !path.ends_with(".dcc.xml")) {
    return fail(ErrorCode::usage, "a certificate is a .pdf, a .json or a .dcc.xml", path,
                "end the file's name with one of them");
  }
  return {};
}

Status write_certificate(FileSystem& files, const std::string& path, const db::RunRecord& run) {
  SIXPOINT_CHECK(check_certificate_name(path));
  SIXPOINT_ASSIGN(const Certificate certificate, certificate_of(run));
  if (path.ends_with(".json")) {
    return write_file(
        files, path,
        certificate.to_json().dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  }
  if (path.ends_with(".dcc.xml")) {
    return write_file(files, path, certificate_dcc(certificate));
  }
  SIXPOINT_ASSIGN(const Bytes bytes, certificate_pdf(certificate));
  return write_file(files, path, as_text(bytes));
}

Result<std::string> label_zpl(const db::RunRecord& run) {
  const auto refuse = [&](std::string why, const char* hint) {
    return fail(ErrorCode::bad_data, "no label: " + std::move(why), printable(run.serial, 60),
                hint);
  };
  constexpr const char* kNotHeld =
      "a label says that the unit holds what was measured: run 'sixpoint jig --write'";
  SIXPOINT_ASSIGN(const Certificate certificate, certificate_of(run));
  if (!is_passed(certificate.verdict)) {
    return refuse("the unit did not pass", "the report says why, and what to do");
  }
  if (!certificate.written || !certificate.as_left) {
    return refuse("nothing was written into the unit and read back", kNotHeld);
  }
  if (certificate.as_left->stored != certificate.measured) {
    return refuse("what the unit answered is not what was written", kNotHeld);
  }
  const std::string date = to_iso8601(certificate.ended).substr(0, 10);
  const std::string qr = fmt::format("sixpoint:{}:{}", certificate.serial, certificate.run);
  return fmt::format(
      "^XA\n^CI28\n^PW400\n^LL200\n^LH0,0\n"
      "^FO12,14^FB250,1,0,L^A0N,30,{}^FH^FD{}^FS\n"
      "^FO12,52^A0N,24,22^FDCalibrated {}^FS\n"
      "^FO12,84^A0N,24,22^FD{} (filter '{}')^FS\n"
      "^FO12,116^A0N,20,18^FDRun {}^FS\n"
      "^FO12,142^A0N,18,16^FDnot an accredited calibration^FS\n"
      "^FO275,10^BQN,2,3^FH^FDMA,{}^FS\n"
      "^XZ\n",
      // Narrower for a long number, so that it stays beside the QR code.
      certificate.serial.size() <= 16   ? 26
      : certificate.serial.size() <= 24 ? 17
                                        : 10,
      zpl_text(certificate.serial), date,
      certificate.verdict == JigVerdict::pass ? "PASS - WRITTEN" : "CONDITIONAL PASS - WRITTEN",
      certificate.filter, db::shown_id(certificate.run), zpl_text(qr));
}

}  // namespace sixpoint::station
