#include "device/session/session_replay.h"

#include <gmock/gmock.h>

#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "made_session.h"

namespace sixpoint::device {
namespace {

using testing::HasSubstr;

TEST(Replay, GivesTheProgramWhatItGotThen) {
  const Session session = tests::made_session();
  for (const SessionMatch match : {SessionMatch::strict, SessionMatch::by_key}) {
    const auto unit = *WireUnit::open(replay_link(session, match));
    EXPECT_EQ(unit->identity().serial, sim::draw_unit(7).serial);
    EXPECT_EQ(unit->read_calibration()->constants, sim::draw_unit(7).constants);
    ASSERT_OK(unit->start_stream(100));
    for (int i = 0; i < 20; ++i) {
      const auto block = unit->next_samples(std::chrono::seconds(1));
      ASSERT_OK(block);
      ASSERT_TRUE(*block) << i;
      EXPECT_EQ((*block)->first_index, static_cast<std::uint32_t>(6 * i));
    }
    EXPECT_EQ(unit->stream_statistics().lost_samples, 0U);
    ASSERT_OK(unit->stop_stream());
  }
}

TEST(Replay, StrictTakesNothingElse) {
  const auto unit = *WireUnit::open(replay_link(tests::made_session(), SessionMatch::strict));
  const auto filter = unit->filter();
  EXPECT_FAILS(filter, ErrorCode::bad_data);
  EXPECT_THAT(filter.error().what,
              HasSubstr("the program sends 'get_filter' where the session has 'read_page'"));
}

TEST(Replay, ByKeyTakesAnyOrderAndRefusesWhatWasNeverAsked) {
  const auto unit = *WireUnit::open(replay_link(tests::made_session(), SessionMatch::by_key));
  ASSERT_OK(unit->start_stream(100));
  ASSERT_OK(unit->stop_stream());
  EXPECT_EQ(unit->read_calibration()->constants, sim::draw_unit(7).constants);
  EXPECT_EQ(unit->read_calibration()->constants, sim::draw_unit(7).constants) << "twice";
  EXPECT_FAILS(unit->filter(), ErrorCode::bad_data);
}

TEST(Replay, EndsWhereTheRecordingEnds) {
  Session session = tests::made_session();
  session.transfers.resize(2);
  const auto unit = *WireUnit::open(replay_link(session, SessionMatch::strict));
  EXPECT_FAILS(unit->read_calibration(), ErrorCode::device_unavailable);
}

}  // namespace
}  // namespace sixpoint::device
