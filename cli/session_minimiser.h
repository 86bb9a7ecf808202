// Makes a session small that shows something: what is left still ends as the whole did.
//
// Delta debugging (Zeller and Hildebrandt 2002, "Simplifying and isolating failure-inducing input",
// the ddmin algorithm) over the session's exchanges - a request with all that came until the next -
// and then over what came within them, played back by key (device/session_replay.h).
#pragma once

#include <string>

#include "base/env.h"
#include "device/session.h"

namespace sixpoint::station {

// What is done with the device in a replay.
enum class SessionWork { identify, jig, capture };
Result<SessionWork> parse_session_work(std::string_view text);  // usage

struct MinimiseOptions {
  SessionWork work = SessionWork::jig;
  // Replays that are tried at most; each takes what the work takes, mostly 10 ms.
  int most_replays = 2000;
};

struct MinimiseReport {
  device::Session session;
  std::string outcome;  // in a few words; the same for the session as it was
  std::size_t transfers_before = 0;
  int replays = 0;
  bool finished = false;  // false: most_replays was reached, it may be smaller still

  std::string brief() const;
};

// How the work ends on this session: the error, or the verdict and what was found; of a jig run
// also after how many faces.
std::string outcome_of(const device::Session& session, SessionWork work);

// Where it finished, the session is 1-minimal: without any one of its transfers the work ends
// otherwise.
MinimiseReport minimise(const device::Session& session, const MinimiseOptions& options);

}  // namespace sixpoint::station
