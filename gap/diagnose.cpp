#include "gap/diagnose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/diagnoser.h"

namespace sixpoint::gap {

Diagnosis Diagnoser::run() {
  out_.bundle = bundle_.path;
  out_.serial = bundle_.protocol_serial.empty() ? bundle_.header.serial : bundle_.protocol_serial;
  out_.firmware = bundle_.header.firmware;
  out_.losses = bundle_.losses;
  out_.seed = options_.seed;
  find_abilities();
  clean_ = clean_samples(bundle_);
  judge_discrete();
  if (!judge_poses()) {
    return give_up(
        "the unit moves inside the segments: the protocol's sample numbers are not of this "
        "recording");
  }
  noise_ = noise_spectrum(bundle_, clean_);
  if (!noise_.usable()) {
    return give_up("too little of the recording lies still and unmasked to know even its noise");
  }
  judge_timing();
  judge_lines();
  judge_response();
  judge_settling();
  slow_ = slow_noise(bundle_, clean_, noise_);
  // Where the tones' amplitudes follow no response that is known, they would bend everything
  // else.
  if (response_.tone_left_sd > 20) {
    for (ToneFit& tone : tones_) {
      tone.usable = tone.usable && tone.clipped_share == 0;
    }
    auto aside = tones_;
    for (ToneFit& tone : aside) {
      tone.usable = false;
    }
    blocks_ = make_blocks(bundle_, clean_, noise_, aside, response_);
  } else {
    blocks_ = make_blocks(bundle_, clean_, noise_, tones_, response_);
  }
  std::set<int> poses;
  for (const Block& block : blocks_) {
    const Eigen::Vector3d up = block.rotation.col(2);
    poses.insert(static_cast<int>(std::lround(2 * up[0]) * 25 + std::lround(2 * up[1]) * 5 +
                                  std::lround(2 * up[2])));
  }
  if (blocks_.empty() || clean_.pose_error_g > 0.45) {
    poses_wrong_ = true;
    if (!blocks_.empty()) {
      alarm(50, "pose: the recording's axes do not follow the protocol's poses");
    }
    if (blocks_.empty()) {
      return give_up("no dwell of two unmasked seconds is left");
    }
  }
  if (poses.size() < 4) {
    out_.losses.push_back(fmt::format(
        "{} poses only: gains and offsets of the unit can't be told from effects", poses.size()));
    few_poses_ = true;
  }
  judge_means();
  judge_left_over();
  list_not_observable();
  measure_gap();
  finish();
  return std::move(out_);
}

Result<Diagnosis> diagnose(const Bundle& bundle, const DiagnoseOptions& options) {
  for (const std::string& name : options.without) {
    if (find_entry(name) == nullptr) {
      return fail(ErrorCode::usage,
                  fmt::format("the catalogue has no effect '{}'", printable(name, 60)), "--without",
                  "sixpoint gap diagnose lists all names under `candidates`");
    }
  }
  return Diagnoser(bundle, options).run();
}

}  // namespace sixpoint::gap
