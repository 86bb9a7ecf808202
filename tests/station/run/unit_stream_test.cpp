#include "station/run/unit_stream.h"

#include <gmock/gmock.h>

#include "expect_result.h"

namespace sixpoint::station {
namespace {

using calib::FilterConfiguration;
using testing::ElementsAre;

// A unit of which only the stream is there; it notes what it is asked.
class StreamingUnit final : public device::Unit {
 public:
  device::UnitAbilities abilities() const override { return {}; }
  const device::Identity& identity() const override { return identity_; }
  Clock& clock() override { return *clock_; }
  const std::string& address() const override { return address_; }
  Result<device::Identity> identify() override { return identity_; }
  Status reconnect(std::chrono::nanoseconds, const std::function<Status()>&) override { return {}; }
  Status set_filter(FilterConfiguration) override {
    asked.emplace_back("filter");
    return std::exchange(filter_answer, Status{});
  }
  Status start_stream(int rate_hz) override {
    asked.push_back("start " + std::to_string(rate_hz));
    statistics = {};
    return {};
  }
  Status stop_stream() override {
    asked.emplace_back("stop");
    return {};
  }
  const device::StreamStatistics& stream_statistics() const override { return statistics; }
  void cancel() override {}

  std::vector<std::string> asked;
  Status filter_answer;
  device::StreamStatistics statistics;

 private:
  device::Identity identity_;
  std::string address_;
  Clock* clock_ = nullptr;  // asked by none of these tests
};

TEST(UnitStream, AUnitThatStillStreamsIsStoppedFirst) {
  StreamingUnit unit;
  unit.filter_answer = fail(ErrorCode::io, "it streams", {}, "stop it");
  UnitStream stream(FilterConfiguration::current, 100);
  ASSERT_OK(stream.start(unit));
  EXPECT_THAT(unit.asked, ElementsAre("filter", "stop", "filter", "start 100"));
}

TEST(UnitStream, AnotherErrorOfTheFilterIsTheAnswer) {
  StreamingUnit unit;
  unit.filter_answer = fail(ErrorCode::device_unavailable, "unplugged", {}, "plug it in");
  UnitStream stream(FilterConfiguration::current, 100);
  EXPECT_FAILS(stream.start(unit), ErrorCode::device_unavailable);
  EXPECT_THAT(unit.asked, ElementsAre("filter"));
  EXPECT_EQ(stream.statistics(&unit).samples, 0U);
}

// Two streams and what an earlier program counted: 5 + 30 + 12 samples.
TEST(UnitStream, NumbersAreOfTheWholeRun) {
  StreamingUnit unit;
  device::StreamStatistics before;
  before.samples = 5;
  before.clock_jumped_s = 0.5;
  UnitStream stream(FilterConfiguration::current, 100, before);
  ASSERT_OK(stream.start(unit));
  unit.statistics.samples = 30;
  unit.statistics.clock_jumped_s = -0.25;
  EXPECT_EQ(stream.statistics(&unit).samples, 35U);
  ASSERT_OK(stream.start(unit));  // plugged in again
  unit.statistics.samples = 12;
  EXPECT_EQ(stream.statistics(&unit).samples, 47U);
  ASSERT_OK(stream.stop(unit));
  stream.count(unit);
  EXPECT_EQ(stream.statistics(nullptr).samples, 47U) << "no stream is counted twice";
  EXPECT_DOUBLE_EQ(stream.statistics(nullptr).clock_jumped_s, 0.25);
}

TEST(UnitStream, ALossIsReportedOnceAndANewStreamCountsFromZero) {
  StreamingUnit unit;
  UnitStream stream(FilterConfiguration::current, 100);
  ASSERT_OK(stream.start(unit));
  EXPECT_FALSE(stream.lost_since_asked(unit));
  unit.statistics.lost_samples = 3;
  EXPECT_TRUE(stream.lost_since_asked(unit));
  EXPECT_FALSE(stream.lost_since_asked(unit));
  unit.statistics.clock_jumps = 1;
  EXPECT_TRUE(stream.lost_since_asked(unit));
  ASSERT_OK(stream.start(unit));
  unit.statistics.lost_samples = 2;
  EXPECT_TRUE(stream.lost_since_asked(unit));
}

}  // namespace
}  // namespace sixpoint::station
