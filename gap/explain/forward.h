// The forward model of one block of features: what the simulator would measure there, in closed
// form.
//
//   ForwardState state;                              // the nominal unit
//   state.drift_mg_per_h = {2, 0, 0};
//   const Eigen::VectorXd features_mg = predict(state, block, 1000.0 / 256);
//
// A block is a dwell (or a piece of a long one), or a tone. Its features are the mean per axis, and
// for tones the amplitude in phase per axis and the second and third harmonic on the axis that is
// moved most. The model goes through the same chain as sim/ in the same order - stimulus, sensor,
// digital - on 24 phases of one period, and projects: exact for the polynomials it holds.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "gap/explain/learnt_size.h"
#include "gap/recording/bundle.h"

namespace sixpoint::gap {

// Real effects bend from their plain laws by up to this share.
inline constexpr double kBend = 0.1;
// Tempcos bend by that over this range of temperature.
inline constexpr double kBend_c = 20;
// Functions of time by which a drift ripples: sine and cosine of one, two and three periods in the
// recording.
inline constexpr int kRipples = 6;
// Amplitude of one of them as a share of all that the drift adds: a ripple of kBend from crest to
// trough.
inline constexpr double kRippleShare = kBend / 2;

// The parameters; parameter() gives them by position, in this order.
struct ForwardState {
  Eigen::Vector3d gain = Eigen::Vector3d::Ones();
  Eigen::Vector3d offset_mg = Eigen::Vector3d::Zero();
  Eigen::Vector2d tilt_deg = Eigen::Vector2d::Zero();
  Eigen::Vector3d misalignment_deg = Eigen::Vector3d::Zero();
  Eigen::Vector3d cross = Eigen::Vector3d::Zero();  // yz xz xy
  Eigen::Vector3d second_mg_per_g2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d third_mg_per_g3 = Eigen::Vector3d::Zero();
  Eigen::Vector3d hysteresis_mg = Eigen::Vector3d::Zero();
  Eigen::Vector3d tempco_mg_per_c = Eigen::Vector3d::Zero();
  Eigen::Vector3d tempco_curve_mg_per_c2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d tempco_cubic_mg_per_c3 = Eigen::Vector3d::Zero();
  Eigen::Vector3d sensitivity_percent_per_c = Eigen::Vector3d::Zero();
  Eigen::Vector3d sensitivity_curve_percent_per_c2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d sensitivity_cubic_percent_per_c3 = Eigen::Vector3d::Zero();
  Eigen::Vector3d warm_up_mg = Eigen::Vector3d::Zero();
  Eigen::Vector3d quick_warm_up_mg =
      Eigen::Vector3d::Zero();  // with a quarter of the time constant
  Eigen::Vector3d drift_mg_per_h = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, kRipples> drift_ripple_mg_per_h =
      Eigen::Matrix<double, 3, kRipples>::Zero();  // times Block::ripple_h
  double gravity_ratio = 0;
  double truncation = 0;  // 1: toward zero instead of nearest
  // Shape of effects that are not linear in their parameters.
  double warm_up_tau_s = 300;
  // 0: in proportion to the step; 1: its sign; from 2 on: that of the axis' last step, by the
  // columns of HeldSigns.
  int hysteresis_shape = 1;
};

// Groups of parameters that come and go together: an effect, or a nuisance.
struct ParameterGroup {
  std::string effect;  // catalogue name; "gain" and "offset" for the nuisances
  int first = 0;       // position in the flat vector
  int count = 0;
  double prior_sd = 1;  // of each, from the realistic sizes of the catalogue
  double prior_mean = 0;
  double curve_sd = 0;  // of the fourth to the sixth number: what bends the effect's main law
  double largest = 0;   // largest realistic size
  double smallest = 0;  // smallest realistic size; 0: not used
  double tau_s = 0;     // shape of warm_up
  int shape = 1;        // shape of hysteresis
  double cubic_sd = 0;  // of the seventh number on
  bool faint = false;   // far below the typical size: see parameter_groups()
  // In the place of prior_mean and prior_sd where it is there: what earlier units had.
  std::optional<LearntSize> learnt = {};

  // Prior mean and standard deviation of the group's i-th number.
  double mean_of(int i) const {
    return learnt && i < 3 ? learnt->mean[static_cast<std::size_t>(i)] : prior_mean;
  }
  double sd_of(int i) const {
    return learnt && i < 3 ? learnt->sd[static_cast<std::size_t>(i)]
           : i < 3         ? prior_sd
           : i < 6         ? curve_sd
                           : cubic_sd;
  }
};
inline constexpr int kForwardParameters = 70;
// Every group, with each shape of warm_up and hysteresis as a group of its own, and each effect
// that every unit has a little of three times: at its typical size, at a fifth of it, and at a
// fifth of that (`faint`); those that bend also at four times of it. Behind them each shape of what was
// learnt, for the effects among them.
std::vector<ParameterGroup> parameter_groups(const std::vector<LearntSize>& learnt = {});
inline constexpr double kReference_c = 25;
// The catalogue's parameter of a unit without the effect, from which the model's numbers count: its
// `ratio` of local_gravity is 1 there, all others are 0.
double absent_value(const std::string& effect);

double& parameter(ForwardState& state, int position);
double parameter(const ForwardState& state, int position);

// Where the features of a tone begin in Block::value_mg.
inline constexpr int kToneAmplitude = 3;
inline constexpr int kSecondHarmonic = 6;
inline constexpr int kThirdHarmonic = 7;

struct Block {
  std::size_t segment = 0;
  int placement = 0;
  int session = 0;    // run of segments of one name
  int condition = 0;  // for hold-out: what is left out together
  bool tone = false;
  int axis = 0;         // of tones
  double middle_s = 0;  // host time
  double seconds = 0;
  // The functions of the drift's ripple, each times the length of the recording in hours.
  Eigen::Matrix<double, kRipples, 1> ripple_h = Eigen::Matrix<double, kRipples, 1>::Zero();
  double temperature_c = 25;
  Eigen::Vector3d gravity_lab_g = Eigen::Vector3d::UnitZ();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d approach_g = Eigen::Vector3d::Zero();
  HeldSigns held_sign = HeldSigns::Zero();
  Eigen::Vector3d vibration_lab_g = Eigen::Vector3d::Zero();  // amplitude, with the mount's gain
  double filter_gain = 1;                                     // of the low-pass behind the sensor
  bool harmonics = false;                                     // 8 features instead of 6
  Eigen::Vector3d noise_mg = Eigen::Vector3d::Zero();         // of one sample, for truncation
  // Of a dwell: what truncation would have taken from its means, truncated_mg(). By what was measured,
  // not by what is predicted: a slow noise that no prediction has may carry a mean through zero.
  Eigen::Vector3d truncated_mg = Eigen::Vector3d::Zero();

  Eigen::VectorXd value_mg;   // 3, 6 or 8: mean XYZ, in phase XYZ, second and third harmonic
  Eigen::MatrixXd white_mg2;  // covariance of the noise
  Eigen::Index size() const { return value_mg.size(); }
};

// What truncation toward zero takes from a mean that is stored as `stored_mg`, where Gaussian noise of
// this standard deviation is on it: the mean y is stored as y - lsb / 2 erf(y / (noise sqrt(2))).
double truncated_mg(double stored_mg, double noise_mg, double lsb_mg);

// Block::ripple_h of all blocks of a recording, from their times.
void set_ripples(std::vector<Block>& blocks);

// Predicted features, as long as block.value_mg. `lsb_mg` is the width of a stored count.
Eigen::VectorXd predict(const ForwardState& state, const Block& block, double lsb_mg);

// d(features)/d(small rotation of the unit in its seat, sensor's frame), mg per degree: size x 3.
Eigen::MatrixXd seating_lever(const Block& block);

// What a small turn takes off the features to second order, mg per rad^2 of each angle: half of the
// vectors themselves.
Eigen::VectorXd seating_loss(const Block& block);

}  // namespace sixpoint::gap
