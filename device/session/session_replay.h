// Plays a recorded session back: the program on one side is unmodified, the device on the other is
// the recording (docs/sessions.md).
//
// strict: the program must write what was written then, byte for byte and in that order, and gets
// what came then. by_key: every request is answered by what answered the same request (command and
// payload) in the recording, in whatever order they are asked; the sequence is put in anew. In both
// the time in START_RECORDING is not compared, for it is the time of day.
//
// Time passes on the link's own clock, which stands at the time of each transfer: a replay of an
// hour takes moments.
#pragma once

#include "device/session.h"
#include "device/transport.h"

namespace sixpoint::device {

enum class SessionMatch { strict, by_key };

// The link to a session that was read. A write that does not match is bad_data; after the last
// transfer the device is gone (device_unavailable).
Link replay_link(Session session, SessionMatch match);

// Registers "replay:FILE[,match=strict|key]".
void register_replay(TransportRegistry& registry);

}  // namespace sixpoint::device
