// A device that plays a recorded session back to an unmodified program (docs/sessions.md).
//
//   Link link = replay_link(session, SessionMatch::strict);
//
// strict: the program must write the recorded bytes in their order, and gets the recorded answers.
// by_key: a request (command and payload) gets the recorded answer to the same request, in any
// order, with the sequence of the new request. Both ignore the time of day in START_RECORDING.
//
// The link has a clock of its own, which stands at the time of each transfer: a replay of an hour
// takes moments.
#pragma once

#include "device/session/session.h"
#include "device/transport.h"

namespace sixpoint::device {

enum class SessionMatch { strict, by_key };

// The link to a session that was read. A write that does not match is bad_data; after the last
// transfer the device is gone (device_unavailable).
Link replay_link(Session session, SessionMatch match);

// Registers "replay:FILE[,match=strict|key]".
void register_replay(TransportRegistry& registry);

}  // namespace sixpoint::device
