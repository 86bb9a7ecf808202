// Makes a session smaller that shows a defect: what is left ends in the same way.
//
//   MinimiseOptions options;
//   options.work = SessionWork::jig;
//   const MinimiseReport report = minimise(session, options);
//   context.out << report.brief();
//
// Delta debugging (Zeller and Hildebrandt 2002, "Simplifying and isolating failure-inducing input",
// the ddmin algorithm), first over exchanges (a request and all answers until the next request),
// then over single transfers. The sessions are replayed by key (device/session/session_replay.h).
#pragma once

#include <string>

#include "base/env.h"
#include "device/session/session.h"

namespace sixpoint::cli {

// What is done with the device in a replay.
enum class SessionWork { identify, jig, capture };
Result<SessionWork> parse_session_work(std::string_view text);  // usage

struct MinimiseOptions {
  SessionWork work = SessionWork::jig;
  // Most replays that are tried; one takes about 10 ms.
  int most_replays = 2000;
};

struct MinimiseReport {
  device::Session session;
  std::string outcome;  // of outcome_of(); the same for both sessions
  std::size_t transfers_before = 0;
  int replays = 0;
  bool finished = false;  // false: most_replays was reached, it may be smaller still

  std::string brief() const;
};

// How the work ends on this session: the error, or the verdict and what was found; for a jig run
// also the number of faces.
std::string outcome_of(const device::Session& session, SessionWork work);

// Where the report is `finished`, the session is 1-minimal: without any one of its transfers the
// work ends in another way.
MinimiseReport minimise(const device::Session& session, const MinimiseOptions& options);

}  // namespace sixpoint::cli
