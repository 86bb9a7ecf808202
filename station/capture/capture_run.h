// The customer's calibration file (the paper's second method): the unit records while it lies on
// each of its six sides, and if asked stands on its eight corners; the file is downloaded, checked
// and solved.
//
//   CaptureOptions options;
//   options.output = "side.gt3x";
//   CaptureHooks hooks;
//   hooks.ask = [](device::Pose side, std::size_t number, std::size_t of) {
//     return SideAnswer::placed;  // after the person laid the unit on `side`
//   };
//   SIXPOINT_ASSIGN(CaptureReport report, run_capture({&unit, &jig}, env, options, hooks));
//   report.usable();  // report.solved has the constants, report.notes what went wrong
//
// A unit that records sends no live samples, so the file is judged afterwards. Sides without still
// readings are then asked for again, alone (sides_to_repeat.h), where the driver offers it; where
// that is stopped or fails, the file that is there is judged. A capture goes on after the unit was
// unplugged and after the program was restarted: what was recorded stays in the unit, the side
// under way is asked for again, and at the end the pieces are joined (recording_pieces.h).
//
// Blocking; hooks are called on the calling thread. Unit, jig and Env belong to the caller.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "calib/solve.h"
#include "device/corner.h"
#include "device/unit.h"
#include "station/run/jig_session.h"

namespace sixpoint::station {

struct CaptureOptions {
  std::string output;  // the .gt3x to make
  int rate_hz = 30;    // what the customers' own recordings have
  // The eight corners after the six sides: they show the cross-axis terms, which six sides cannot
  // (calib/poses/efficiency.h), and directions to test the constants with. Only where asked for,
  // since it takes more than twice as long. usage where the jig turns by itself and is no
  // CornerJig.
  bool corners = false;
  // A side needs three still blocks of 4 s, and at 30 Hz a noisy z axis loses half of them to the
  // paper's second criterion.
  double side_s = 40;
  double turn_s = 5;  // after the prompt, to let go of the unit
  calib::SolveOptions solve;
  double replug_patience_s = 60;  // for an unplugged unit, when its recording is downloaded
  int downloads = 5;              // attempts
  int most_repeats = 2;           // a side that fails three times fails for another reason
};

// How the unit rests: on a side, or on a corner.
using CapturePose = std::variant<device::Pose, device::Corner>;

// What an earlier program had of this capture.
struct CaptureResume {
  struct Side {
    CapturePose pose = device::Pose::plus_z;
    std::uint16_t recording = 0;  // that holds it
  };
  UtcTime started{};
  std::vector<Side> done;
  // How often sides were asked for again. Above 0 the output is there, and stays until the new one
  // is whole. No other file had the names of pieces and of the second download then ("c-1.gt3x",
  // "c-new.gt3x", "c-new-1.gt3x" ... for "c.gt3x"), so those that have them now are this capture's.
  int asked_again = 0;
};

enum class SideAnswer {
  placed,   // the unit lies there
  waiting,  // not yet: ask again, after a check that the unit is still plugged in
  stop,     // the person gives up: the recording is ended
  leave     // the program ends: the unit records on, and a later program goes on with the capture
};

// What the capture asks of its driver. All but `ask` may be empty; `ask_corner` where
// CaptureOptions::corners is false.
struct CaptureHooks {
  // Does the unit lie on this side? `number` counts from 1. A jig that turns by itself is sent
  // there afterwards.
  std::function<SideAnswer(device::Pose side, std::size_t number, std::size_t of)> ask;
  // The same for a corner; `number` and `of` count sides and corners.
  std::function<SideAnswer(const device::Corner& corner, std::size_t number, std::size_t of)>
      ask_corner = nullptr;
  // Asked several times a second while the unit rests; `stop` and `leave` end the rest.
  std::function<SideAnswer()> next_answer = nullptr;
  // After every side: save this to go on after a restart.
  std::function<void(const CaptureResume&)> progress = nullptr;
  // These sides have too few still readings and are asked for next. Where this is empty, the
  // recording is judged as it is.
  std::function<void(const std::vector<device::Pose>& sides)> again = nullptr;
  // The unit was unplugged. Waits until it is back and returns it, opened anew, or an error. Where
  // this is empty, the unit may be unplugged while it is turned: only the end waits for it.
  std::function<Result<UnitOnJig>(const Error&)> reopen = nullptr;
};

struct CaptureReport {
  std::string serial;
  std::string firmware;
  calib::FilterConfiguration recording_filter = calib::FilterConfiguration::current;
  // Of why_recording_cannot_help(): then nothing was recorded. Or that an axis repeated itself:
  // then nothing is solved.
  std::vector<std::string> refusal;
  bool stopped = false;  // by the person; the recording was stopped and left in the unit
  std::string file;
  std::string file_sha256;
  std::vector<std::string> pieces;  // the recordings that `file` was joined from, if it was
  std::optional<calib::SolveReport> solved;
  std::vector<std::string> notes;  // trouble on the way, for people
  // The unit's clock jumped in mid-run. The constants do not depend on it; who solves `file` alone
  // sees a pause and may refuse it.
  bool clock_jumped = false;

  bool usable() const { return solved && solved->usable(); }
};

// For a unit that takes no commands: its last recording, made while a person laid it on its sides,
// is copied, checked and solved. bad_data where it holds none.
Result<CaptureReport> run_file_capture(device::Unit& unit, Env& env, const CaptureOptions& options);

// device_unavailable when the unit goes away; cannot_create when the file exists or cannot be made;
// internal after SideAnswer::leave, and where `reopen` says so: a later program goes on. Any other
// error leaves the file of before, judged, where sides were asked for again.
Result<CaptureReport> run_capture(UnitOnJig on_jig, Env& env, const CaptureOptions& options,
                                  const CaptureHooks& hooks,
                                  const std::optional<CaptureResume>& resume = {});

// A capture that asked for sides again and does not go on, for `why`: the file of before is judged.
Result<CaptureReport> judge_file_of_before(Env& env, const CaptureOptions& options,
                                           CaptureReport report, const std::string& why);

}  // namespace sixpoint::station
