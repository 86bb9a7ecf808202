// The calibration certificate of a jig run (docs/certificate.md), and the label for the unit.
//
//   SIXPOINT_ASSIGN(const db::RunRecord run, store.run(id));
//   SIXPOINT_CHECK(write_certificate(env.files, "certificate.pdf", run));
//   SIXPOINT_ASSIGN(const std::string label, label_zpl(run));
//
// Both are made from the stored record of a run alone, so that they can be made again years later:
// the same record gives the same bytes. The date of issue is that of the run. Any thread.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "base/result.h"
#include "base/stored_constants.h"
#include "db/store.h"
#include "station/limits/verdict.h"

namespace sixpoint::station {

// The content of a certificate; what is empty is printed as "not stated".
struct Certificate {
  std::string run;  // the run's id, the certificate's number
  std::string serial;
  std::string model;
  std::string firmware;
  std::string filter;
  UtcTime started{};
  UtcTime ended{};
  std::string operator_name;
  bool operator_authenticated = false;  // by a PIN
  std::string station;
  std::string software;    // name and version, and the build where it is known
  std::string raw_sha256;  // of the samples that the store keeps
  std::string head;        // of the store's chain, at this run; empty where no store has it yet

  std::string jig;  // its number, or its kind where that was not given
  std::optional<UtcTime> jig_due;

  JigVerdict verdict = JigVerdict::inconclusive;
  std::vector<std::string> codes;
  std::vector<std::string> reasons;
  std::vector<JudgedQuantity> quantities;
  std::string limits_source;
  std::string limits_sha256;
  DecisionRule decision;

  struct Constants {
    StoredConstants stored;
    std::string calibrated;  // the page's date
    std::optional<double> residual_mg;
  };
  std::optional<Constants> as_found;
  std::optional<Constants> as_left;
  bool written = false;

  std::string method;  // "six_pose_pair" ..., of JigReport
  PerAxis<double> sensitivity_g_per_lsb{};
  PerAxis<double> zero_lsb{};
  PerAxis<double> sensitivity_expanded_percent{};
  PerAxis<double> zero_expanded_mg{};  // of the reading in counts, without that of the scale
  StoredConstants measured;            // the nine integers

  struct Pose {
    std::string pose;
    PerAxis<double> mean_lsb{};
    PerAxis<double> sd_lsb{};
    int samples = 0;
    std::optional<double> temperature_c;
    double tilt_deg = 0;
    std::optional<double> error_mg;  // of verification poses
    bool chose_solution = false;  // one of those that chose among the solutions and judge nothing
  };
  std::vector<Pose> poses;
  std::vector<Pose> verification;

  double gravity_m_per_s2 = 0;
  double gravity_standard_uncertainty_m_per_s2 = 0;

  PerAxis<double> zero_expanded_lsb() const;
  nlohmann::ordered_json to_json() const;  // "sixpoint/certificate/1"
};

// The method for people: "six_pose_pair" is "least squares, each axis by itself". A method that this
// program does not know stays as it is.
std::string method_in_words(const std::string& method);
// bad_data where the record is no complete jig run. One that was stopped or is inconclusive has no
// result to certify; a failed one has.
Result<Certificate> certificate_of(const db::RunRecord& run);
// A PDF of A4 pages: text that can be searched, a QR code "sixpoint:SERIAL:RUN".
Result<Bytes> certificate_pdf(const Certificate& certificate);
// usage where the file's name ends in neither .pdf nor .json nor .dcc.xml.
Status check_certificate_name(const std::string& path);
// What can be asked for about a stored run:
//
// | the run                                                   | documents                         |
// |-----------------------------------------------------------|-----------------------------------|
// | any                                                       | report.json                       |
// | certificate_of() makes one: measured on the jig, or       | ... and certificate.pdf,          |
// | written afterwards, neither stopped nor inconclusive      | certificate.json and .dcc.xml     |
// | label_zpl() makes one: it also passed, was written, and   | ... and label.zpl                 |
// | returned what was written                                 |                                   |
std::vector<std::string> documents_of(const db::RunRecord& run);
// By the ending of `path`.
Status write_certificate(FileSystem& files, const std::string& path, const db::RunRecord& run);

// ZPL II for a label of 50 x 25 mm at 203 dpi: serial, date, verdict, run, QR code.
// bad_data unless the unit passed, its constants were written, and it returned what was written: a
// label says that the unit holds what was measured.
Result<std::string> label_zpl(const db::RunRecord& run);

}  // namespace sixpoint::station
