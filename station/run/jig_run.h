// The technician's run: a state machine that turns samples into accepted poses.
//
// It is fed with events (a sample, samples were lost, the operator said something, time passed, the
// unit is gone, constants were written) and answers each with actions (turn the jig, tell the
// person, write the constants, done). It neither waits nor reads nor prints: the terminal, the page
// and the tests drive the same machine. One thread at a time.
//
// Phases, which are the production protocol of `gap/`: measuring (`faces`: six, any order) ->
// verifying (`faces_reversed`: six again, each reached from another face than before, so that what
// depends on the side of approach shows) -> reseating (`reseat`: two taken off and put back) ->
// [writing -> rechecking (with what the unit then holds)] -> finished. The fit sees the first six
// readings only; the eight others judge it.
//
// resume() starts a machine with what an earlier one had accepted: the program was restarted.
//
// A pose is recognised from the readings by what the accepted ones say of the unit, by the unit's
// own constants, which may be off by 20 % and 0.2 g, or by nominal ones. Where all of them see a
// unit between its faces, and the same placement comes again, a hand would not have repeated it to
// half a degree but a jig would: then the constants are what is wrong (an ADXL362's zero may lie
// 0.45 g off), and the placement is taken; the tilt is judged as for every other. Stillness is
// judged by the unit's own noise, with hysteresis. Tilt is judged by the two level axes: an axis
// reads its zero in all four poses in which it lies level, so a placement that is off by an angle
// disagrees with the others. Where one placement disagrees with one other, either may be the tilted
// one: the newer is asked for again, and when it repeats itself the older goes.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "base/constants.h"
#include "base/measure.h"
#include "base/result.h"
#include "calib/constants.h"
#include "device/jig.h"
#include "device/protocol.h"

namespace sixpoint::station {

using device::Pose;

struct JigRunOptions {
  int rate_hz = 100;
  // Mean of 6 s: noise of 5.5 mg falls to 0.2 mg, below the 0.17 mg per 0.01 degree of seating.
  // Fourteen placements, and two after a write, then cost two minutes of dwell, of the three that
  // production allows.
  double dwell_s = 6;
  double settle_s = 0.5;  // still for this long before the dwell: straps and jigs ring that long
  double window_s = 1;    // over which noise is judged
  double first_noise_limit_mg = 25;  // until the unit's own noise is known; a hand trembles more
  double still_factor = 1.6;         // enters stillness below this many times its own noise
  double moved_factor = 2.5;         // leaves it above
  double moved_mg = 8;               // or when the mean has moved by this
  // A real sensor with 2.8 % of cross-axis sensitivity reads 3.2 degrees apart in opposite poses
  // without any tilt; a tilt of 4 degrees moves the face's own reading by 2.4 mg (1 - cos).
  double tilt_limit_deg = 4;
  double between_faces_deg = 30;  // further from every face than this: lies on none
  double pose_time_out_s = 180;   // without any accepted pose
  // So many in a row, or five times as many in all, end the run: something is wrong that
  // patience does not mend.
  int refusals_in_row = 8;
  // The first round backwards, its last face last: asked for in this order, every face is reached
  // from another one than in the first round.
  std::vector<Pose> verification = {Pose::plus_y,  Pose::minus_x, Pose::plus_x,
                                    Pose::minus_z, Pose::plus_z,  Pose::minus_y};
  std::vector<Pose> reseat = {Pose::plus_z, Pose::minus_x};
  std::vector<Pose> recheck = {Pose::minus_z, Pose::plus_x};  // after a write
  bool write = false;
  // An axis that repeats one count for so long is stuck: a working one has noise of a count, and a
  // turn falls into the time of every pose.
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
  double tilt_deg = 0;  // by the level axes, against what was known when it was taken
  // The face it lay on before; none where that was not seen.
  std::optional<Pose> from = {};
};

enum class JigPhase { measuring, verifying, reseating, writing, rechecking, finished };
enum class JigOutcome {
  running,
  complete,
  timed_out,
  too_many_refusals,
  stopped,
  unit_gone,
  sensor_stuck,
};
// What the unit is doing: still counts from a second without movement on.
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
  Kind kind = Kind::place;
  Pose pose = Pose::plus_z;
  std::string text;  // for people, one sentence without a full stop
};

// The pose that a calibrated reading shows, and how far it is from it.
struct NearestFace {
  Pose pose = Pose::plus_z;
  double angle_deg = 0;
};
NearestFace nearest_face(const PerAxis<double>& force_g);

enum class OperatorWord { undo, stop };

// What a run has so far: all that a later program needs to go on.
struct JigProgress {
  JigPhase phase = JigPhase::measuring;
  std::vector<PoseReading> faces;
  std::vector<PoseReading> reversed;
  std::vector<PoseReading> reseat;
  std::vector<PoseReading> recheck;
  int refusals = 0;
};

// For the page: where the unit lies now.
struct JigLive {
  JigStillness stillness = JigStillness::moving;
  std::optional<NearestFace> face;  // none before the first second of samples
  double dwell_fraction = 0;        // of the reading under way
};

// What a run recognises a unit's faces by at first: its stored constants where a working ADXL362
// could have them (150 to 350 LSB/g, zero within 0.75 g: the datasheet's limits and what the two
// filter configurations do), nominal ones otherwise. `is_nominal` says which.
struct FirstApproximation {
  calib::Calibration calibration;
  bool is_nominal = true;
};
FirstApproximation first_approximation(const std::optional<StoredConstants>& stored);

class JigRun {
 public:
  // `approximation`: first_approximation() of the unit's stored constants.
  JigRun(JigRunOptions options, const calib::Calibration& approximation);

  // Before start(): goes on where another machine was. A write that was under way is done anew.
  void resume(const JigProgress& progress);
  JigProgress progress() const;

  std::vector<JigAction> start(double now_s);
  std::vector<JigAction> on_sample(const Sample& sample);
  std::vector<JigAction> on_loss();  // samples were lost: a reading under way begins anew
  std::vector<JigAction> on_operator(OperatorWord word);
  std::vector<JigAction> on_time(double now_s);
  std::vector<JigAction> on_unit_gone();  // for good
  // It was away and is back: it may have been turned meanwhile, and nobody was slow.
  std::vector<JigAction> on_unit_back(double now_s);
  std::vector<JigAction> on_written(double now_s);
  // Better knowledge of the unit, from the six faces: tilt is judged against it from here on.
  void set_approximation(const calib::Calibration& calibration) { approximation_ = calibration; }

  // What is known of the unit so far, for a picture of how it lies: by the faces that were taken,
  // where there are any, and what the machine was given otherwise.
  calib::Calibration approximation() const { return seen_by_faces().value_or(approximation_); }

  JigPhase phase() const { return phase_; }
  JigOutcome outcome() const { return outcome_; }
  const std::vector<Pose>& open_poses() const { return open_; }
  const std::vector<PoseReading>& faces() const { return faces_; }
  std::vector<PoseReading> verification() const;  // both sides of approach, then the reseated
  const std::vector<PoseReading>& recheck() const { return recheck_; }
  int refusals() const { return refusals_; }
  JigLive live() const;

 private:
  using State = JigStillness;
  struct Window {
    PerAxis<double> mean_lsb{};
    PerAxis<double> sd_mg{};
  };

  const std::vector<PoseReading>& readings_of(JigPhase phase) const;
  const std::vector<PoseReading>& readings_of_phase() const { return readings_of(phase_); }
  std::vector<PoseReading>& readings_of_phase() {
    return const_cast<std::vector<PoseReading>&>(readings_of(phase_));
  }
  const std::vector<Pose>& wanted_in(JigPhase phase) const;
  std::string why_not_open(Pose pose) const;
  bool from_other_side(Pose pose, Pose from) const;
  double g_per_lsb(std::size_t axis) const { return approximation_.sensitivity_g_per_lsb[axis]; }
  NearestFace recognise(const PerAxis<double>& mean_lsb) const;
  // What the accepted faces say of the unit; none before the first.
  std::optional<calib::Calibration> seen_by_faces() const;
  Window window() const;
  bool is_still(const Window& window, bool already) const;
  void leave();
  void begin_dwell();
  void finish_dwell();
  void refuse(Pose pose, std::string reason);
  void ask_next();
  void next_phase();
  void finish(JigOutcome outcome, std::string text);
  bool is_stuck(const device::RawCounts& counts);
  // Reading of a level axis in the accepted poses; nothing where there is none yet.
  std::optional<double> level_lsb(std::size_t axis, std::optional<Pose> except) const;
  double tilt_of(const PoseReading& reading) const;
  bool repeats_refused(const PoseReading& reading) const;
  bool same_placement(const PerAxis<double>& a_lsb, const PerAxis<double>& b_lsb) const;
  void drop_disagreeing(const PoseReading& reading);
  bool midpoints_agree_with(const PoseReading& reading) const;
  // False when it asked for the pose again instead.
  bool agrees_with_first_round(const PoseReading& reading);

  JigRunOptions options_;
  calib::Calibration approximation_;
  calib::Calibration nominal_;
  JigPhase phase_ = JigPhase::measuring;
  JigOutcome outcome_ = JigOutcome::running;
  State state_ = State::moving;
  std::optional<PerAxis<double>> between_faces_lsb_;  // where it was refused for that last
  std::vector<Pose> open_;
  std::vector<PoseReading> faces_;
  std::vector<PoseReading> reversed_;
  std::vector<PoseReading> reseat_;
  std::vector<PoseReading> recheck_;
  std::optional<Pose> detour_;     // asked for only to come from there
  std::optional<Pose> last_face_;  // where it lay still last
  std::optional<Pose> came_from_;  // and before that
  std::optional<PoseReading> last_refused_;
  int refusals_ = 0;
  int refusals_in_row_ = 0;

  std::deque<device::RawCounts> recent_;  // the window
  PerAxis<std::int64_t> sum_{};
  PerAxis<std::int64_t> sum_square_{};
  PerAxis<double> own_noise_mg_{};  // the least seen; 0 = not known yet
  int still_samples_ = 0;
  device::RawCounts repeated_{};  // the counts that came last
  PerAxis<int> repeats_{};        // and how often in a row
  PerAxis<double> dwell_start_lsb_{};
  PerAxis<double> left_lsb_{};  // where the unit lay when it was told to leave
  std::vector<Sample> dwell_;
  double last_progress_s_ = 0;
  double now_s_ = 0;
  std::vector<JigAction> actions_;
};

// Seconds of dwell that a whole run takes when nothing is refused.
double dwell_budget_s(const JigRunOptions& options);

}  // namespace sixpoint::station
