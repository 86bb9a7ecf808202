// What an earlier program did not finish, as run_folder.h keeps it on the disk.
//
//   UnfinishedRun left;
//   left.serial = "TAS1C50140036";
//   left.jig_id = "J1";
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "station/capture/capture_run.h"
#include "station/run/jig_session.h"

namespace sixpoint::station {

struct UnfinishedRun {
  std::string device;
  std::string serial;
  std::string firmware;
  std::string operator_name;
  bool is_authenticated = false;
  std::string station;
  std::string client = {};
  bool write = false;
  std::string kind = "jig";  // or kWriteKind (run_records.h)
  // Of the run's constants, for a run of kWriteKind that writes them. Empty as long as there is no
  // record of them, and in folders of earlier versions.
  std::string constants_id = {};
  calib::FilterConfiguration filter = calib::FilterConfiguration::current;
  JigProtocol protocol = JigProtocol::production;
  std::string jig = {};  // JigReport::jig; empty in folders of earlier versions
  // Where it is measured; nothing in folders of earlier versions.
  std::optional<std::string> jig_id = {};
  std::optional<double> gravity_m_per_s2 = {};
  // What the unit's earlier runs demanded when it was measured; nothing where that was not noted.
  std::optional<RetestState> retest = {};
  // Of the rows of samples when this was saved: a run whose placements were measured on rows that
  // are lost is not gone on with.
  std::size_t rows_bytes = 0;
  std::string rows_sha256 = {};  // empty: of an earlier version, which did not note it
  JigResume resume = {};
};

// A calibration file, likewise. Its samples are in the unit.
struct UnfinishedCapture {
  std::string serial;
  std::string operator_name;
  std::string client;
  std::string output;  // the .gt3x to make
  CaptureResume resume;
};

}  // namespace sixpoint::station
