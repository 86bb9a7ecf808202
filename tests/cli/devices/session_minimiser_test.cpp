#include "cli/devices/session_minimiser.h"

#include <fstream>

#include "cli/devices/session_fixture.h"
#include "expect_result.h"

namespace sixpoint::cli {
namespace {

// Oracle: the outcome of the whole session.
TEST_F(SessionCommand, TheMinimiserKeepsTheOutcome) {
  ASSERT_EQ(jig("virtual:seed=7,jig=auto", {"--record", path("r.zip")}).exit_code, 0);
  const auto answer =
      run({"session", "minimise", path("r.zip"), "-o", path("m.zip"), "--doing", "identify"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const auto whole = *device::read_session(posix_env().files, path("r.zip"));
  const auto small = *device::read_session(posix_env().files, path("m.zip"));
  EXPECT_EQ(small.transfers.size(), 2U) << "one request, one reply";
  EXPECT_EQ(outcome_of(small, SessionWork::identify), outcome_of(whole, SessionWork::identify));
  const auto show = run({"session", "show", path("m.zip"), "--json"});
  EXPECT_EQ(show.json()["transfers"], 2);
  EXPECT_EQ(show.json()["requests"]["identify"], 1);
  EXPECT_EQ(run({"session", "minimise", path("r.zip"), "-o", path("n.zip"), "--doing", "dance"})
                .exit_code,
            64);
}

// Jig runs and a download that fail: the small session ends as the whole one did, in the program
// too, and each of its transfers is needed.
TEST_F(SessionCommand, TheMinimiserKeepsHowAndWhereARunFailed) {
  const struct {
    const char* fault;
    SessionWork work;
    int exit_code;
    std::size_t most;  // transfers that may be left, of about 700 and 70
  } kCases[] = {
      {R"({"fault": "unplug", "at_s": 25})", SessionWork::jig, 69, 400},
      {R"({"fault": "axis_stuck", "at_s": 5, "axis": "y"})", SessionWork::jig, 1, 360},
      {R"({"fault": "lost", "channel": "bulk", "at_report": 3, "count": 0})", SessionWork::capture,
       69, 20},
  };
  int number = 0;
  for (const auto& one : kCases) {
    SCOPED_TRACE(one.fault);
    const bool is_jig = one.work == SessionWork::jig;
    const std::string name = std::to_string(++number);
    std::ofstream(path("f.json")) << R"({"schema": "sixpoint/faults/1", "faults": [)" << one.fault
                                  << "]}";
    const auto work = [&](const std::string& device, const std::vector<std::string>& more) {
      std::vector<std::string> arguments = {
          is_jig ? "jig" : "capture", "--device", device, "--store", path("s.db"), "--json"};
      if (!is_jig) {
        arguments.insert(arguments.end(), {"-o", path(device.substr(0, 3) + name + ".gt3x")});
      }
      arguments.insert(arguments.end(), more.begin(), more.end());
      return run(arguments);
    };
    const auto recorded =
        work("virtual:seed=7,jig=auto,faults=" + path("f.json"), {"--record", path(name + ".zip")});
    EXPECT_EQ(recorded.exit_code, one.exit_code);
    const auto whole = *device::read_session(posix_env().files, path(name + ".zip"));

    MinimiseOptions options;
    options.work = one.work;
    options.most_replays = 20'000;
    const auto report = minimise(whole, options);
    ASSERT_TRUE(report.finished) << report.brief();
    const device::Session& small = report.session;
    EXPECT_LE(small.transfers.size(), one.most);
    EXPECT_LT(small.transfers.size(), whole.transfers.size());
    const std::string outcome = outcome_of(whole, one.work);
    EXPECT_EQ(outcome_of(small, one.work), outcome);
    for (std::size_t i = 0; i < small.transfers.size(); ++i) {
      device::Session without = small;
      without.transfers.erase(without.transfers.begin() + static_cast<std::ptrdiff_t>(i));
      EXPECT_NE(outcome_of(without, one.work), outcome)
          << "transfer " << i << " of " << small.transfers.size();
    }
    // Oracle: the program itself, on the small session.
    ASSERT_OK(device::write_session(posix_env().files, path("m" + name + ".zip"), small));
    const auto again = work("replay:" + path("m" + name + ".zip") + ",match=key", {});
    EXPECT_EQ(again.exit_code, one.exit_code) << again.people;
    if (is_jig) {
      EXPECT_EQ(again.json()["poses"].size(), recorded.json()["poses"].size());
    }
  }
}

// Oracle: the program's own run, which waits for a unit that is plugged in again.
TEST_F(SessionCommand, TheMinimiserWaitsForAUnitAsARunDoes) {
  std::ofstream(path("f.json")) << R"({"schema": "sixpoint/faults/1", "faults": [
      {"fault": "unplug", "at_s": 25, "seconds": 8}]})";
  const auto answer =
      jig("virtual:seed=7,jig=auto,faults=" + path("f.json"), {"--record", path("r.zip")});
  EXPECT_EQ(answer.json()["verdict"], "pass") << answer.people;
  const auto whole = *device::read_session(posix_env().files, path("r.zip"));
  EXPECT_THAT(outcome_of(whole, SessionWork::jig), testing::HasSubstr("pass after 6 faces"));
}

// Nothing is needed where nothing is done with a session that has nothing in it.
TEST_F(SessionCommand, TheMinimiserMayLeaveNothing) {
  device::Session session;
  for (int i = 0; i < 5; ++i) {
    session.transfers.push_back({device::SessionTransfer::Kind::from_device,
                                 device::SessionChannel::bulk,
                                 std::chrono::seconds(i),
                                 Bytes(8),
                                 {}});
  }
  const auto report = minimise(session, {});
  EXPECT_TRUE(report.finished);
  EXPECT_TRUE(report.session.transfers.empty()) << report.brief();
}

}  // namespace
}  // namespace sixpoint::cli
