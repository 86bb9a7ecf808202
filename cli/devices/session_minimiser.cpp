#include "cli/devices/session_minimiser.h"

#include <algorithm>
#include <functional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/memory_env.h"
#include "cli/devices/known_devices.h"
#include "device/session/session_replay.h"
#include "device/unit.h"
#include "device/wire/wire_unit.h"
#include "station/capture/capture_run.h"
#include "station/run/jig_session.h"

namespace sixpoint::cli {

namespace {

using device::Session;
using device::SessionTransfer;
// Indices of transfers that are kept or left out together.
using Part = std::vector<std::size_t>;

std::string brief_of(const Error& error) {
  return fmt::format("{}: {}", to_string(error.code), error.what);
}

Result<std::string> work_on(Session session, SessionWork work) {
  MemoryEnv memory;
  memory.clock.set(session.started);
  SIXPOINT_ASSIGN(const auto unit, device::WireUnit::open(device::replay_link(
                                       std::move(session), device::SessionMatch::by_key)));
  device::ManualJig jig;
  switch (work) {
    case SessionWork::identify:
      return unit->identity().serial;
    case SessionWork::jig: {
      station::JigSessionOptions options;
      options.keep_interrupted = true;  // how far it came is a part of how it ended
      station::JigHooks hooks;
      hooks.reopen = station::wait_for_unit(*unit, jig, [](const std::string& /*text*/) {});
      SIXPOINT_ASSIGN(const station::JigReport report,
                      station::run_jig({unit.get(), &jig}, memory.env, options, hooks));
      return fmt::format("{} {} after {} faces: {}", report.serial, to_string(report.verdict),
                         report.faces.size(),
                         report.ended_by ? brief_of(*report.ended_by)
                                         : fmt::format("{}", fmt::join(report.reasons, "; ")));
    }
    case SessionWork::capture: {
      station::CaptureOptions options;
      options.output = "capture.gt3x";
      const station::CaptureHooks hooks{.ask = [](device::Pose, std::size_t, std::size_t) {
        return station::SideAnswer::placed;
      }};
      SIXPOINT_ASSIGN(const station::CaptureReport report,
                      station::run_capture({unit.get(), &jig}, memory.env, options, hooks));
      return fmt::format("{} {} {}", report.serial, report.usable() ? "usable" : "not usable",
                         fmt::join(report.refusal, "; "));
    }
  }
  return std::string();
}

Session with(const Session& session, const std::vector<Part>& parts) {
  Part all;
  for (const Part& part : parts) {
    all.insert(all.end(), part.begin(), part.end());
  }
  std::sort(all.begin(), all.end());
  Session smaller;
  smaller.device = session.device;
  smaller.started = session.started;
  for (const std::size_t index : all) {
    smaller.transfers.push_back(session.transfers[index]);
  }
  return smaller;
}

class Minimiser {
 public:
  Minimiser(const Session& session, const MinimiseOptions& options)
      : session_(session), options_(options), outcome_(outcome_of(session, options.work)) {}

  MinimiseReport run() {
    std::vector<Part> exchanges;
    for (std::size_t i = 0; i < session_.transfers.size(); ++i) {
      if (exchanges.empty() || session_.transfers[i].kind != SessionTransfer::Kind::from_device) {
        exchanges.emplace_back();
      }
      exchanges.back().push_back(i);
    }
    exchanges = reduce(std::move(exchanges));
    std::vector<Part> single;
    for (const Part& part : exchanges) {
      for (const std::size_t index : part) {
        single.push_back({index});
      }
    }
    single = reduce(std::move(single));
    MinimiseReport report;
    report.session = with(session_, single);
    report.outcome = outcome_;
    report.transfers_before = session_.transfers.size();
    report.replays = replays_;
    report.finished = replays_ < options_.most_replays;
    return report;
  }

 private:
  bool same(const std::vector<Part>& parts) {
    ++replays_;
    return outcome_of(with(session_, parts), options_.work) == outcome_;
  }

  // Tries to leave out pieces, then smaller ones; single parts as long as one can be left out.
  std::vector<Part> reduce(std::vector<Part> parts) {
    std::size_t size = (parts.size() + 1) / 2;
    while (!parts.empty() && replays_ < options_.most_replays) {
      bool smaller = false;
      for (std::size_t begin = 0; begin < parts.size() && replays_ < options_.most_replays;) {
        const std::size_t end = std::min(begin + size, parts.size());
        std::vector<Part> rest(parts.begin(), parts.begin() + static_cast<std::ptrdiff_t>(begin));
        rest.insert(rest.end(), parts.begin() + static_cast<std::ptrdiff_t>(end), parts.end());
        if (same(rest)) {
          parts = std::move(rest);
          smaller = true;
        } else {
          begin = end;
        }
      }
      if (size == 1 && !smaller) {
        break;
      }
      size = (size + 1) / 2;
    }
    return parts;
  }

  const Session& session_;
  const MinimiseOptions& options_;
  std::string outcome_;
  int replays_ = 0;
};

}  // namespace

Result<SessionWork> parse_session_work(std::string_view text) {
  if (text == "identify") {
    return SessionWork::identify;
  }
  if (text == "jig") {
    return SessionWork::jig;
  }
  if (text == "capture") {
    return SessionWork::capture;
  }
  return fail(ErrorCode::usage, fmt::format("'{}' cannot be done in a replay", printable(text, 40)),
              {}, "use identify, jig or capture");
}

std::string outcome_of(const Session& session, SessionWork work) {
  const Result<std::string> outcome = work_on(session, work);
  return outcome ? *outcome : brief_of(outcome.error());
}

std::string MinimiseReport::brief() const {
  return fmt::format("{} of {} transfers are left after {} replays{}; it still ends with: {}",
                     session.transfers.size(), transfers_before, replays,
                     finished ? "" : " (the most that were allowed)", printable(outcome, 400));
}

MinimiseReport minimise(const Session& session, const MinimiseOptions& options) {
  return Minimiser(session, options).run();
}

}  // namespace sixpoint::cli
