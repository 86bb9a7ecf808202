// The records of a jig run for the store, from the terminal and from the station alike.
//
//   db::RunRecord run = run_record_before(session, serial, jig);
//   run.operator_name = "Ada";
//   complete_run_record(run, report);
//   SIXPOINT_ASSIGN(const RunIds stored, add_run_records(recorder, report, run));
//
// Times are UTC; errors are those of the store.
#pragma once

#include <optional>
#include <string>

#include "db/store.h"
#include "station/run/jig_session.h"

namespace sixpoint::station {

// The kind of a record that only wrote the constants of a run before it, with that run's readings:
// no statistics and no rule about repeated runs counts it a second time.
inline constexpr const char* kWriteKind = "write";

// What is known before the unit is measured; the document is still empty.
db::RunRecord run_record_before(const JigSessionOptions& session, const std::string& serial,
                                const std::string& jig);
// What the report adds; `study` names the gage study that a run of kStudyKind belongs to. The
// operator's name is noted as authenticated where it was, by a PIN.
void complete_run_record(db::RunRecord& run, const JigReport& report, const std::string& study = {},
                         bool is_authenticated = false);

// A row for the store; the run's id is still empty.
db::ConstantsRecord constants_row(const calib::ConstantsRecord& record);

struct RunIds {
  std::string run_id;
  std::optional<std::string> constants_id;  // of a usable report that is no study
};
// The run with its samples. Of a run of kind "jig" or "write" also what was written into the unit;
// of kind "jig" the constants: those of a write are the constants of the run before it.
Result<RunIds> add_run_records(db::RecordWriter& writer, const JigReport& report,
                               const db::RunRecord& run);

}  // namespace sixpoint::station
