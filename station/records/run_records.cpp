#include "station/records/run_records.h"

#include <nlohmann/json.hpp>

#include "gt3x/forms/model.h"
#include "station/records/software.h"
#include "station/records/station_records.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

// Names of files and texts of the unit may hold any bytes; the run is stored all the same.
std::string dumped(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// All limits that the verdict used: without them a verdict cannot be checked later.
Json limits_of(const JigSessionOptions& session) {
  Json json = to_json(session.limits);
  json["run"] = {{"tilt_deg", session.run.tilt_limit_deg},
                 {"moved_mg", session.run.moved_mg},
                 {"still_factor", session.run.still_factor},
                 {"moved_factor", session.run.moved_factor},
                 {"first_noise_mg", session.run.first_noise_limit_mg},
                 {"dwell_s", session.run.dwell_s},
                 {"rate_hz", session.run.rate_hz}};
  return json;
}

}  // namespace

db::RunRecord run_record_before(const JigSessionOptions& session, const std::string& serial,
                                const std::string& jig) {
  db::RunRecord run;
  run.serial = serial;
  run.model = gt3x::model_of(serial);
  run.kind = "jig";
  run.filter = calib::to_string(session.filter);
  run.jig = jig;
  run.software = software_name();
  run.build = software_build();
  run.limits = dumped(limits_of(session));
  run.gravity_m_per_s2 = session.gravity.m_per_s2;
  run.document = "{}";
  return run;
}

void complete_run_record(db::RunRecord& run, const JigReport& report, const std::string& study,
                         bool is_authenticated) {
  run.started = report.started;
  run.ended = report.ended;
  run.verdict = to_string(report.verdict);
  Json document = report.to_json();
  if (!study.empty()) {
    document["study"] = study;
  }
  if (is_authenticated) {
    document["operator_authenticated"] = true;
  }
  run.document = dumped(document);
  run.codes = report.codes;
  if (!report.faces.empty()) {
    double sum_c = 0;
    for (const PoseReading& face : report.faces) {
      sum_c += face.temperature_c;
    }
    run.temperature_c = sum_c / static_cast<double>(report.faces.size());
  }
}

db::ConstantsRecord constants_row(const calib::ConstantsRecord& record) {
  db::ConstantsRecord row;
  row.made_at = record.made_at;
  row.serial = record.serial;
  row.filter = calib::to_string(record.filter);
  row.method = record.method;
  row.document = dumped(calib::to_json(record));
  return row;
}

Result<RunIds> add_run_records(db::RecordWriter& writer, const JigReport& report,
                               const db::RunRecord& run) {
  RunIds done;
  SIXPOINT_ASSIGN(
      done.run_id,
      writer.add_run(run, {{"samples.csv", Bytes(report.raw_csv.begin(), report.raw_csv.end())}}));
  if (run.kind != "jig" && run.kind != kWriteKind) {
    return done;  // a study or a replay says nothing new of the unit
  }
  if (report.written && report.as_left) {
    db::UnitWrite write;
    write.run_id = done.run_id;
    write.serial = report.serial;
    write.written = report.ended;
    write.as_found =
        report.as_found ? calib::to_json(report.as_found->constants).dump() : std::string("null");
    write.read_back = calib::to_json(report.as_left->constants).dump();
    // A run that ended with its program has no solution any more; "written" is a page read back
    // equal.
    write.as_left = report.six ? calib::to_json(report.six->best().stored).dump() : write.read_back;
    SIXPOINT_CHECK(writer.add_unit_write(write));
  }
  if (report.usable() && run.kind != kWriteKind) {
    calib::ConstantsRecord constants = report.record();
    constants.made_from.station = run.station;
    db::ConstantsRecord row = constants_row(constants);
    row.run_id = done.run_id;
    SIXPOINT_ASSIGN(done.constants_id, writer.add_constants(row, run.model));
  }
  return done;
}

}  // namespace sixpoint::station
