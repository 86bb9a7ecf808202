// The technician's run: a state machine that turns samples into accepted poses.
//
//   JigRun run(JigRunOptions{}, first_approximation(stored).calibration);
//   std::vector<JigAction> actions = run.start(now_s);
//   while (run.phase() != JigPhase::finished) {
//     actions = run.on_sample({now_s, counts, temperature_c});  // turn the jig, show the text ...
//   }
//
// It is fed with events and answers each with actions. It neither waits nor reads nor prints, so
// that the terminal, the page and the tests drive the same machine. Times in seconds on any scale
// that does not go back. One thread at a time.
//
// | phase      | poses that are asked for          | when all of them are accepted             |
// |------------|-----------------------------------|-------------------------------------------|
// | measuring  | the six, in any order             | action `fit`, -> verifying                |
// | verifying  | the six, each from another side   | -> reseating                              |
// | reseating  | two; the unit is taken off before | production+: -> turning; else the next    |
// | turning    | three, turned by half a turn      | with `write`: action `write`, -> writing; |
// |            | about the vertical                | else -> finished (complete)               |
// | writing    | none                              | on_written() -> rechecking                |
// | rechecking | two, with the unit's constants    | -> finished (complete)                    |
//
// The fit has the first six readings only; the eight others judge it. Those of `turning` do
// neither: they tell the jig's tilt from the unit's own for the diagnosis (docs/gap.md,
// "production+"). They come after the eight, which are then those of a production run, and before a
// write, so that a unit whose constants are not written has them too.
//
// How a face lies about the vertical, seen by a person in front of the jig (`production` does not
// ask for it, and its readings do not say it):
//
//     face          turned_deg 0             turned_deg 180
//     +x -x         y axis away from him     y axis towards him
//     +y -y +z -z   x axis to the right      x axis to the left
//
// Gravity does not show it. A reading of `turning` is refused unless the unit was tipped since the
// last reading, so that a unit which was left as it lay, or was knocked, is never taken for turned.
//
// | event        | in a phase that asks for poses            | writing             | finished |
// |--------------|-------------------------------------------|---------------------|----------|
// | on_sample    | see the next table                        | -                   | -        |
// | on_loss      | a reading under way begins again          | -                   | -        |
// | undo         | the last reading is asked for again       | -                   | -        |
// | stop         | -> finished (stopped)                     | -> finished         | -        |
// | on_time      | -> finished (timed_out) when no reading   | -> finished         | -        |
// |              | was accepted in pose_time_out_s + dwell_s |                     |          |
// | on_unit_back | time-out and stillness begin again        | the time-out, too   | -        |
// | on_unit_gone | -> finished (unit_gone)                   | -> finished         | -        |
// | on_written   | -                                         | -> rechecking       | -        |
//
// | stillness | ends when                                      | then                             |
// |-----------|------------------------------------------------|----------------------------------|
// | moving    | the window is still                            | settling                         |
// | settling  | it was still for settle_s                      | dwelling where a reading of this |
// |           |                                                | face is wanted, else refused     |
// | dwelling  | dwell_s are over: accepted or refused          | leaving                          |
// |           | the unit moved: refused                        | moving                           |
// | leaving   | the unit moved, or lies on another face        | moving, settling                 |
//
// How a placement is judged (jig_placement.cpp):
//  - Still: by the unit's own noise, with hysteresis.
//  - Face: see the table below.
//  - Between two faces: refused. When the same placement comes again (to half a degree) it is
//    taken: a person would not repeat it, a jig does, so the constants are wrong.
//  - Tilt: an axis reads its zero in all four poses in which it lies level, so a tilted placement
//    disagrees with the others. Where one disagrees with one, the newer is asked for again; when it
//    repeats itself, the older is dropped.
//
// On which face a unit lies. The expected face is where a jig that turns by itself says it stands;
// else the one that is asked for. The zero of a unit may be 1 g off, and that of its constants too;
// the changes from one placement to another do not depend on it.
//
// | accepted faces | what else                                        | the face is              |
// |----------------|--------------------------------------------------|--------------------------|
// | none           | the jig says where it stands                     | that; the next placement |
// |                |                                                  | confirms it              |
// | none           | within 30 degrees of a face by the unit's own    | that face; where the two |
// |                | constants or by nominal ones                     | differ, the asked one    |
// | none           | of none by both, asked: a zero within 1.2 g      | between faces; when it   |
// |                | explains the asked face                          | comes again: the asked   |
// | none           | of none by both, and no such zero                | between faces; when it   |
// |                |                                                  | comes again: the nearest |
// | some           | the changes from all of them fit the expected    | the expected face        |
// |                | face: an axis that turns by 1 g or 2 g changes   |                          |
// |                | by 64 to 512 LSB/g, one that does not by less    |                          |
// |                | than half a g                                    |                          |
// | some           | they do not fit it                               | the nearest, by the      |
// |                |                                                  | zeros of the accepted    |
// |                |                                                  | faces; with a single one |
// |                |                                                  | also by the constants    |
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/measure.h"
#include "base/result.h"
#include "base/stored_constants.h"
#include "calib/constants.h"
#include "device/jig.h"
#include "device/unit_types.h"
#include "station/run/sample_window.h"

namespace sixpoint::station {

using device::Pose;

// production: 14 placements. production+: and three, half a turn about the vertical.
enum class JigProtocol { production, production_plus };
std::string_view to_string(JigProtocol protocol);
Result<JigProtocol> parse_jig_protocol(std::string_view text);  // usage when it is none

struct JigRunOptions {
  JigProtocol protocol = JigProtocol::production;
  int rate_hz = 100;
  // In the mean of 6 s, noise of 5.5 mg falls to 0.2 mg; 0.01 degree of seating are 0.17 mg.
  // Sixteen placements then take two of the three minutes that production allows.
  double dwell_s = 6;
  double settle_s = 0.5;  // still for this long before the dwell: straps and jigs vibrate that long
  double window_s = 1;    // over which noise is judged
  double first_noise_limit_mg = 25;  // until the unit's own noise is known; below a hand's tremor
  double still_factor = 1.6;         // enters stillness below this many times its own noise
  double moved_factor = 2.5;         // leaves it above
  double moved_mg = 8;               // or when the mean has moved by this
  // A real sensor with 2.8 % of cross-axis sensitivity reads 3.2 degrees apart in opposite poses
  // without any tilt; a tilt of 4 degrees moves the face's own reading by 2.4 mg (1 - cos).
  double tilt_limit_deg = 4;
  double between_faces_deg = 30;  // further from every face than this: lies on none
  double pose_time_out_s = 180;   // without any accepted pose, beside the dwell itself
  int refusals_in_row = 8;        // this many in a row, or five times as many in all, end the run
  // In this order every face is reached from another one than in the first round.
  std::vector<Pose> verification = {Pose::plus_y,  Pose::minus_x, Pose::plus_x,
                                    Pose::minus_z, Pose::plus_z,  Pose::minus_y};
  std::vector<Pose> reseat = {Pose::plus_z, Pose::minus_x};
  // With production+: those of the segment `half_turn` (docs/gap.md); one face of each axis.
  std::vector<Pose> half_turn = {Pose::plus_x, Pose::plus_y, Pose::plus_z};
  std::vector<Pose> recheck = {Pose::minus_z, Pose::plus_x};  // after a write
  bool write = false;
  // An axis that repeats one count for so long is stuck: a working one has noise of one count.
  double stuck_s = 15;
};

struct Sample {
  double time_s = 0;  // on any scale that does not go back
  device::RawCounts counts{};
  double temperature_c = 0;
};

struct PoseReading {
  Pose pose = Pose::plus_z;
  PerAxis<double> mean_lsb{};
  PerAxis<double> sd_lsb{};
  int samples = 0;
  double temperature_c = 0;
  double start_s = 0;
  double tilt_deg = 0;            // by the level axes, against what was known when it was taken
  std::optional<Pose> from = {};  // the face it lay on before, where that is known
  std::optional<int> turned_deg = {};  // about the vertical, as it was asked for: 0, 180, or not
};

enum class JigPhase { measuring, verifying, reseating, turning, writing, rechecking, finished };
enum class JigOutcome {
  running,
  complete,
  timed_out,
  too_many_refusals,
  stopped,
  unit_gone,
  sensor_stuck,
};
enum class JigStillness { moving, settling, dwelling, leaving };
std::string_view to_string(JigPhase phase);
std::string_view to_string(JigStillness stillness);
Result<JigPhase> parse_jig_phase(std::string_view text);  // bad_data when it is none
std::string_view to_string(JigOutcome outcome);

struct JigAction {
  enum class Kind {
    place,     // this pose next, unless the person prefers another of `open_poses()`
    accepted,  // a reading was taken
    refused,   // `text` says why; the same pose is asked for again
    dropped,   // an earlier reading was found wrong and is asked for again
    fit,       // six faces are there: call set_approximation() with what they give
    write,     // write the constants, then call on_written()
    finished,
  };
  enum class Refusal {
    other,     // it moved, lies between two faces, is too noisy; or an axis may be stuck
    unwanted,  // it lies on the face `pose`, which is not wanted
    tilted,    // it lies on the face `pose`, tilted
  };
  Kind kind = Kind::place;
  Pose pose = Pose::plus_z;
  std::string text;  // for people, one sentence without a full stop
  Refusal refusal = Refusal::other;
};

// The pose that a calibrated reading shows, and how far it is from it.
struct NearestFace {
  Pose pose = Pose::plus_z;
  double angle_deg = 0;
};
NearestFace nearest_face(const PerAxis<double>& force_g);

enum class OperatorCommand { undo, stop };

// The state of a run that a later program needs to go on with it.
struct JigProgress {
  JigPhase phase = JigPhase::measuring;
  std::vector<PoseReading> faces;
  std::vector<PoseReading> reversed;
  std::vector<PoseReading> reseat;
  std::vector<PoseReading> recheck;
  int refusals = 0;
  std::vector<PoseReading> half_turn = {};

  std::size_t placements() const {
    return faces.size() + reversed.size() + reseat.size() + half_turn.size() + recheck.size();
  }
};

// For the page: where the unit lies now.
struct JigLive {
  JigStillness stillness = JigStillness::moving;
  std::optional<NearestFace> face;  // none before the first second of samples
  double dwell_fraction = 0;        // of the reading under way
};

// The constants that recognise a unit's faces before the first reading: the stored ones where a
// working sensor can have them (calib::why_no_sensor()), nominal ones otherwise.
struct FirstApproximation {
  calib::Calibration calibration;
  bool is_nominal = true;
};
FirstApproximation first_approximation(const std::optional<StoredConstants>& stored);

class JigRun {
 public:
  // `approximation`: first_approximation() of the unit's stored constants.
  JigRun(JigRunOptions options, const calib::Calibration& approximation);

  // Before start(): goes on where another machine was. A write that was under way is repeated.
  void resume(const JigProgress& progress);
  const JigProgress& progress() const { return progress_; }

  std::vector<JigAction> start(double now_s);
  std::vector<JigAction> on_sample(const Sample& sample);
  std::vector<JigAction> on_loss();  // samples were lost
  std::vector<JigAction> on_operator(OperatorCommand command);
  std::vector<JigAction> on_time(double now_s);
  std::vector<JigAction> on_unit_gone();              // and will not come back
  std::vector<JigAction> on_unit_back(double now_s);  // it may have been turned meanwhile
  std::vector<JigAction> on_written(double now_s);
  // Constants from the six faces: tilt is judged by them from here on.
  void set_approximation(const calib::Calibration& calibration) { approximation_ = calibration; }

  // Where a jig that turns by itself says it stands, from here on; none where it does not know, and
  // where a person turns the unit.
  void set_jig_pose(std::optional<Pose> pose) { jig_pose_ = pose; }

  // The best constants so far, for a picture of how the unit lies.
  calib::Calibration approximation() const { return constants_of_faces().value_or(approximation_); }

  JigPhase phase() const { return progress_.phase; }
  JigOutcome outcome() const { return outcome_; }
  const std::vector<Pose>& open_poses() const { return open_; }
  const std::vector<PoseReading>& faces() const { return progress_.faces; }
  std::vector<PoseReading> verification() const;  // both sides of approach, then the reseated
  const std::vector<PoseReading>& half_turn() const { return progress_.half_turn; }
  const std::vector<PoseReading>& recheck() const { return progress_.recheck; }
  int refusals() const { return progress_.refusals; }
  JigLive live() const;

 private:
  std::vector<JigAction> answer() { return std::exchange(actions_, {}); }

  // The protocol (jig_run.cpp).
  std::vector<PoseReading>& readings();  // of the phase
  const std::vector<Pose>& wanted_in(JigPhase phase) const;
  std::string why_not_wanted(Pose pose) const;
  bool from_other_side(Pose pose, Pose from) const;
  void ask_next();
  bool ask_detour();
  void ask_next_or_end_phase();
  void next_phase();
  void write_or_finish();
  std::optional<int> turned_deg() const;  // as the phase asks for
  void accept(const PoseReading& reading);
  void refuse(Pose pose, std::string reason,
              JigAction::Refusal refusal = JigAction::Refusal::other);
  void leave();
  void finish(JigOutcome outcome, std::string text);

  // The judgement of a placement (jig_placement.cpp).
  double to_g(double lsb, std::size_t axis) const;
  double to_mg(double lsb, std::size_t axis) const;
  bool is_stuck(const device::RawCounts& counts);
  bool may_be_stuck() const;  // too early to say
  bool is_still() const;
  bool has_moved(const PerAxis<double>& from_lsb, double limit_mg) const;
  NearestFace recognise(const PerAxis<double>& mean_lsb) const;
  NearestFace nearest_by_constants(const PerAxis<double>& mean_lsb) const;
  std::optional<Pose> asked_face() const;
  bool changes_fit(Pose pose, const PerAxis<double>& mean_lsb) const;
  std::optional<calib::Calibration> constants_of_faces() const;  // none before the first
  void on_settled();
  void finish_dwell();
  PoseReading read_dwell() const;
  std::string why_unusable() const;
  bool tilt_is_accepted(PoseReading& reading);
  std::optional<double> level_lsb(std::size_t axis, std::optional<Pose> except) const;
  std::optional<double> midpoint_lsb(std::size_t axis) const;
  double tilt_of(const PoseReading& reading) const;
  bool repeats_refused(const PoseReading& reading) const;
  bool same_placement(const PerAxis<double>& a_lsb, const PerAxis<double>& b_lsb) const;
  bool drop_disagreeing(const PoseReading& reading);
  bool midpoints_agree_with(const PoseReading& reading) const;
  bool agrees_with_first_round(const PoseReading& reading);

  JigRunOptions options_;
  calib::Calibration approximation_;
  JigProgress progress_;
  JigOutcome outcome_ = JigOutcome::running;
  std::vector<Pose> open_;
  std::optional<Pose> detour_;     // asked for only to come from there
  std::optional<Pose> jig_pose_;   // where the jig says it stands
  std::optional<Pose> last_face_;  // where it lay still last
  std::optional<Pose> came_from_;  // and before that
  std::optional<PoseReading> last_refused_;
  std::optional<PerAxis<double>> between_faces_lsb_;  // the last placement refused for that
  std::optional<PerAxis<double>> read_lsb_;           // mean of the last reading
  bool tipped_ = false;                               // since then; known in `turning` only
  int refusals_in_row_ = 0;

  JigStillness stillness_ = JigStillness::moving;
  SampleWindow window_;
  PerAxis<double> own_noise_lsb_{};  // the least so far; 0: not known yet
  int still_samples_ = 0;
  std::vector<Sample> dwell_;
  PerAxis<double> dwell_start_lsb_{};
  PerAxis<double> left_lsb_{};  // mean when the reading there ended
  double last_progress_s_ = 0;
  double now_s_ = 0;
  std::vector<JigAction> actions_;
};

// Placements of a whole run, and the seconds of dwell that they take when nothing is refused.
std::size_t placements_of(const JigRunOptions& options);
double dwell_budget_s(const JigRunOptions& options);

}  // namespace sixpoint::station
