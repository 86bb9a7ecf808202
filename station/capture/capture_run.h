// The customer's calibration file (the paper's second method): the unit records while it lies on
// each of its six sides; the file is downloaded, checked and solved.
//
// Sequential, because a unit that records sends no live samples: what can be judged is judged on
// the file afterwards, and says which sides to repeat.
//
// A capture outlives a unit that is pulled out and a program that ends: what was recorded until
// then stays in the unit as a recording of its own, the side under way is asked again, and at the
// end the pieces are put together (recording_pieces.h).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calib/solve.h"
#include "device/unit.h"
#include "station/jig_session.h"

namespace sixpoint::station {

struct CaptureOptions {
  std::string output;  // the .gt3x to make
  int rate_hz = 30;    // what the customers' own recordings have
  // A side needs three still blocks of 4 s, and at 30 Hz a noisy z axis loses half of them to the
  // paper's second criterion.
  double side_s = 40;
  double turn_s = 5;  // for the hand, after the prompt
  // Asked several times a second while the unit rests; true ends the recording. May be empty.
  std::function<bool()> cancelled;
  calib::SolveOptions solve;
  // A unit that was unplugged to be turned goes on recording: how long it is waited for at the end,
  // and how often a broken download is gone on with.
  double replug_patience_s = 60;
  int downloads = 5;
};

// Told before each side; answers whether the unit lies there (false: the person gives up). A jig
// that turns by itself is sent there afterwards.
using SidePrompt = std::function<bool(device::Pose side, std::size_t number, std::size_t of)>;

// What an earlier program had of this capture.
struct CaptureResume {
  struct Side {
    device::Pose pose = device::Pose::plus_z;
    std::uint16_t recording = 0;  // that holds it
  };
  UtcTime started{};
  std::vector<Side> done;
};

enum class SideAnswer {
  placed,   // it lies there
  waiting,  // asked again at once, after a look whether the unit is still there
  stop,     // the person gives up: the recording is ended
  leave     // the program ends: the unit goes on, and so does the capture, with a later program
};

// Whoever drives the capture hangs in here; all called on its own thread.
struct CaptureHooks {
  // `number` counts from 1.
  std::function<SideAnswer(device::Pose side, std::size_t number, std::size_t of)> ask;
  // Asked several times a second while the unit rests; anything but `stop` and `leave` goes on.
  std::function<SideAnswer()> word = nullptr;
  // After every side, for a disk. May be empty.
  std::function<void(const CaptureResume&)> progress = nullptr;
  // The unit went away. Waits until it is back and answers with it, opened anew, or gives up. Where
  // this is empty nobody looks: a unit that was unplugged to be turned goes on recording, and is
  // waited for at the end.
  std::function<Result<UnitOnJig>(const Error&)> reopen = nullptr;
};

struct CaptureReport {
  std::string serial;
  std::string firmware;
  calib::FilterConfiguration recording_filter = calib::FilterConfiguration::current;
  // Why a recording of this unit cannot help, and what can; then nothing was recorded.
  std::vector<std::string> refusal;
  bool stopped = false;  // by the person; the recording was stopped and left in the unit
  std::string file;
  std::string file_sha256;
  std::vector<std::string> pieces;  // the recordings that `file` was put together from, if it was
  std::optional<calib::SolveReport> solved;
  // What went wrong on the way and was got over, or explains what is missing.
  std::vector<std::string> notes;

  bool usable() const { return solved && solved->usable(); }
};

// A recording mends affected files only when it was made under `current`: not on a unit calibrated
// before 2014-03-24 with firmware below 1.4.0 or from 1.8.0 on. Empty when it can help.
std::vector<std::string> why_recording_cannot_help(const device::FilterState& filter,
                                                   const std::string& serial,
                                                   const std::string& firmware);

// For a unit that takes no commands: the recording that it holds, made while somebody laid it on
// its sides, is copied, checked and solved. bad_data where it holds none.
Result<CaptureReport> run_file_capture(device::Unit& unit, Env& env, const CaptureOptions& options);

// device_unavailable when the unit goes away; cannot_create when the file exists or cannot be made;
// `internal` when `leave` was said.
Result<CaptureReport> run_capture(UnitOnJig on_jig, Env& env, const CaptureOptions& options,
                                  const CaptureHooks& hooks,
                                  const std::optional<CaptureResume>& resume = {});
Result<CaptureReport> run_capture(device::Unit& unit, device::Jig& jig, Env& env,
                                  const CaptureOptions& options, const SidePrompt& prompt);

}  // namespace sixpoint::station
