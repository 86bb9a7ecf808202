#include "device/session.h"

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "device/session_replay.h"
#include "made_session.h"
#include "mocks/inert.h"

namespace sixpoint::device {
namespace {

using testing::HasSubstr;

TEST(Session, IsWrittenAndReadBackTheSame) {
  const Session session = tests::made_session();
  ASSERT_GT(session.transfers.size(), 40U);
  MemoryFiles files;
  ASSERT_OK(write_session(files, "s.zip", session));
  const auto back = read_session(files, "s.zip");
  ASSERT_OK(back);
  EXPECT_EQ(back->device, "virtual:seed=7");
  EXPECT_EQ(back->started, session.started);
  EXPECT_EQ(back->transfers, session.transfers);
  ASSERT_OK(write_session(files, "t.zip", *back));
  EXPECT_EQ(*read_file(files, "s.zip"), *read_file(files, "t.zip")) << "the same bytes";
}

// Every byte of the file changed in turn, in steps: an error, or the very same session.
TEST(Session, AChangedFileIsNoticed) {
  const Session session = tests::made_session(3);
  MemoryFiles files;
  ASSERT_OK(write_session(files, "s.zip", session));
  const Bytes whole = *read_file(files, "s.zip");
  int noticed = 0;
  for (std::size_t at = 0; at < whole.size(); at += 7) {
    Bytes bytes = whole;
    bytes[at] ^= 0x10;
    const std::string name = std::to_string(at) + ".zip";
    ASSERT_OK(write_file(files, name, {reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
    const auto back = read_session(files, name);
    if (!back) {
      EXPECT_EQ(back.error().code, ErrorCode::bad_data) << at;
      ++noticed;
    } else {
      EXPECT_EQ(back->transfers, session.transfers) << at;
    }
  }
  EXPECT_GT(noticed, static_cast<int>(whole.size() / 7 / 2));
  ASSERT_OK(write_file(files, "n.zip", "no zip"));
  EXPECT_FAILS(read_session(files, "n.zip"), ErrorCode::bad_data);
  EXPECT_FAILS(read_session(files, "none.zip"), ErrorCode::no_input);
}

TEST(Session, LinesThatAreNoTransfersAreRefused) {
  for (const char* line :
       {"x", "{}", R"({"t_ns":-1,"kind":"out","channel":"bulk"})",
        R"({"t_ns":1,"kind":"up","channel":"bulk"})", R"({"t_ns":1,"kind":"in","channel":"x"})",
        R"({"t_ns":1,"kind":"in","channel":"bulk","hex":"0g"})",
        R"({"t_ns":1,"kind":"in","channel":"bulk","hex":"012"})",
        R"({"t_ns":1,"kind":"in","channel":"bulk","error":"fire"})",
        "{\"t_ns\":2,\"kind\":\"reopened\"}\n{\"t_ns\":1,\"kind\":\"reopened\"}"}) {
    SCOPED_TRACE(line);
    EXPECT_FAILS(parse_lines(line), ErrorCode::bad_data);
  }
}

TEST(Replay, GivesTheProgramWhatItGotThen) {
  const Session session = tests::made_session();
  for (const SessionMatch match : {SessionMatch::strict, SessionMatch::by_key}) {
    const auto unit = *Unit::open(replay_link(session, match));
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
  const auto unit = *Unit::open(replay_link(tests::made_session(), SessionMatch::strict));
  const auto filter = unit->filter();
  EXPECT_FAILS(filter, ErrorCode::bad_data);
  EXPECT_THAT(filter.error().what,
              HasSubstr("the program sends 'get_filter' where the session has 'read_page'"));
}

TEST(Replay, ByKeyTakesAnyOrderAndRefusesWhatWasNeverAsked) {
  const auto unit = *Unit::open(replay_link(tests::made_session(), SessionMatch::by_key));
  ASSERT_OK(unit->start_stream(100));
  ASSERT_OK(unit->stop_stream());
  EXPECT_EQ(unit->read_calibration()->constants, sim::draw_unit(7).constants);
  EXPECT_EQ(unit->read_calibration()->constants, sim::draw_unit(7).constants) << "twice";
  EXPECT_FAILS(unit->filter(), ErrorCode::bad_data);
}

TEST(Replay, EndsWhereTheRecordingEnds) {
  Session session = tests::made_session();
  session.transfers.resize(2);
  const auto unit = *Unit::open(replay_link(session, SessionMatch::strict));
  EXPECT_FAILS(unit->read_calibration(), ErrorCode::device_unavailable);
}

TEST(Recorder, KeepsErrorsAndItsLimit) {
  auto transport = std::make_unique<mocks::InertTransport>(std::make_shared<ManualClock>());
  transport->to_read.push_back(fail(ErrorCode::io, "the endpoint stalled", "inert", "try again"));
  transport->to_read.push_back(Bytes(64, 1));
  Link link;
  link.clock = std::make_shared<ManualClock>();
  link.reports = std::move(transport);
  MemoryFiles files;
  SessionRecorder recorder(150);
  ASSERT_OK(recorder.begin(files, "s.zip"));
  recorder.attach(link);
  Bytes out(65);
  EXPECT_FAILS(link.reports->read(out, {}), ErrorCode::io);
  EXPECT_EQ(*link.reports->read(out, {}), 64U);
  EXPECT_TRUE(recorder.truncated());
  ASSERT_OK(recorder.finish());
  const Session session = *read_session(files, "s.zip");
  EXPECT_TRUE(session.truncated);
  ASSERT_EQ(session.transfers.size(), 1U);
  EXPECT_EQ(session.transfers[0].error->code, ErrorCode::io);
  EXPECT_EQ(parse_lines(to_lines(session.transfers)), session.transfers);
}

}  // namespace
}  // namespace sixpoint::device
