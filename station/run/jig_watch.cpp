#include "station/run/jig_watch.h"

#include <utility>

#include <fmt/format.h>

namespace sixpoint::station {

Status JigWatch::place(device::Jig& jig, device::Pose pose, JigPhase phase) {
  if (jig.turns_by_itself()) {
    SIXPOINT_CHECK(device::check_jig(jig));
  }
  return phase == JigPhase::turning ? jig.go_to_half_turned(pose) : jig.go_to(pose);
}

Result<std::optional<device::Pose>> JigWatch::ask(device::Jig& jig, double now_s) {
  if (!jig.turns_by_itself()) {
    return std::nullopt;
  }
  if (asked_s_ && now_s - *asked_s_ < options_.poll_s) {
    return stands_;
  }
  asked_s_ = now_s;
  SIXPOINT_ASSIGN(const device::JigPosition position, jig.position());
  if (!position.fault.empty()) {
    SIXPOINT_CHECK(device::check_jig(jig));
  }
  stands_ = position.pose;
  return stands_;
}

Status JigWatch::compare(device::Jig& jig, const JigAction& action) {
  if (!jig.turns_by_itself()) {
    return {};
  }
  SIXPOINT_CHECK(device::check_jig(jig));  // a stop or a fault spoils this placement
  const bool accepted = action.kind == JigAction::Kind::accepted;
  const bool tilted = action.refusal == JigAction::Refusal::tilted;
  if (!accepted && action.refusal == JigAction::Refusal::other) {
    return {};
  }
  SIXPOINT_ASSIGN(const device::JigPosition position, jig.position());
  if (!position.pose) {
    return {};  // it does not know
  }
  const auto disagree = [&](std::string what) {
    return fail(ErrorCode::bad_data, std::move(what), jig.name(),
                "look how the unit is seated, and whether the jig turns truly");
  };
  if (*position.pose != action.pose) {
    return disagree(fmt::format("the jig says it stands at {} and the unit reads {}",
                                device::to_string(*position.pose), device::to_string(action.pose)));
  }
  if (accepted) {
    disagreements_ = 0;
  }
  disagreements_ += tilted ? 1 : 0;
  if (disagreements_ >= options_.most_disagreements) {
    return disagree(fmt::format(
        "the jig says it stands at {} to {:.2g} degrees, and the unit was {} time "
        "after time",
        device::to_string(*position.pose), position.angle_uncertainty_deg, action.text));
  }
  return {};
}

}  // namespace sixpoint::station
