// A calibration file that was recorded without the program and downloaded: can it help, and which
// side is missing?
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "calib/solve.h"

namespace sixpoint::station {

struct CalibrationFileCheck {
  std::string serial;
  std::string firmware;
  // Why no recording like this one can help, and what can; then nothing was solved.
  std::vector<std::string> refusal;
  std::optional<calib::SolveReport> solved;
  std::string sha256;

  bool usable() const { return refusal.empty() && solved && solved->usable(); }
};

// no_input, bad_data for what is no recording or was mended already.
Result<CalibrationFileCheck> check_calibration_file(Env& env, const std::string& path,
                                                    const calib::SolveOptions& options = {});

}  // namespace sixpoint::station
