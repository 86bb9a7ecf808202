#include "device/session/session_replay.h"

#include <algorithm>

#include <gmock/gmock.h>

#include "base/atomic_file.h"
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

TEST(Replay, OfTwoRequestsOfOneNameWhatDiffersIsNamed) {
  const auto said = [](const auto& change) {
    Session session = tests::made_session();
    const auto read_page = std::ranges::find_if(session.transfers, [](const auto& transfer) {
      const auto message = decode(transfer.bytes);
      return transfer.kind == SessionTransfer::Kind::to_device && message &&
             message->command == Command::read_page;
    });
    EXPECT_NE(read_page, session.transfers.end());
    Message request = decode(read_page->bytes).value();
    change(request);
    const Report report = encode(request);
    read_page->bytes.assign(report.begin(), report.end());
    const auto unit = *WireUnit::open(replay_link(session, SessionMatch::strict));
    const auto page = unit->read_calibration();
    return page ? std::string() : page.error().what;
  };
  EXPECT_EQ(said([](Message&) {}), "");
  EXPECT_THAT(said([](Message& request) { request.payload.at(0) ^= 1; }),
              testing::MatchesRegex("the program sends 'read_page' where the session has "
                                    "'read_page': byte 0 of its payload is 0x.., in the session "
                                    "0x.."));
  EXPECT_THAT(said([](Message& request) { request.payload.push_back(7); }),
              HasSubstr("of its payload is not there, in the session 0x07"));
  EXPECT_THAT(said([](Message& request) { request.sequence = 999; }),
              HasSubstr(", in the session 999"));
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

Bytes request(std::uint16_t sequence, Command command, Bytes payload = {}) {
  const Report report =
      encode({ReportKind::request, sequence, command, ReplyCode::ok, std::move(payload)});
  return {report.begin(), report.end()};
}

Bytes reply(std::uint16_t sequence, Command command, Bytes payload) {
  const Report report =
      encode({ReportKind::reply, sequence, command, ReplyCode::ok, std::move(payload)});
  return {report.begin(), report.end()};
}

// Written by hand: the unit goes away before its answer, is not there at the first attempt to open
// it again, and comes back.
Session session_with_a_pulled_cable() {
  using Kind = SessionTransfer::Kind;
  Identity identity;
  identity.serial = "MOS2A00000007";
  const Bytes who = encode_identity(identity);
  const Error gone{ErrorCode::device_unavailable, "it was unplugged", "hid:X", "plug it in again"};
  Session session;
  const auto add = [&](Kind kind, Bytes bytes, std::optional<Error> error = {}) {
    session.transfers.push_back({kind, SessionChannel::reports,
                                 std::chrono::milliseconds(10 * session.transfers.size()),
                                 std::move(bytes), std::move(error)});
  };
  add(Kind::to_device, request(0, Command::identify));
  add(Kind::from_device, reply(0, Command::identify, who));
  add(Kind::to_device, request(1, Command::get_filter));
  add(Kind::from_device, {}, gone);
  add(Kind::to_device, request(0, Command::identify), gone);
  add(Kind::reopened, {}, gone);
  add(Kind::reopened, {});
  add(Kind::to_device, request(0, Command::identify));
  add(Kind::from_device, reply(0, Command::identify, who));
  add(Kind::to_device, request(1, Command::get_filter));
  add(Kind::from_device, reply(1, Command::get_filter, encode_filter({})));
  return session;
}

TEST(Replay, ADeviceThatWentAwayAndCameBackDoesSoAgain) {
  for (const SessionMatch match : {SessionMatch::strict, SessionMatch::by_key}) {
    const auto unit = *WireUnit::open(replay_link(session_with_a_pulled_cable(), match));
    EXPECT_FAILS(unit->filter(), ErrorCode::device_unavailable);
    ASSERT_OK(unit->reconnect(std::chrono::seconds(10)));
    EXPECT_EQ(*unit->filter(), FilterState{});
  }
}

// Whoever opens a device again that is there, or that never came back, gets none.
TEST(Replay, TheDeviceIsOpenedAgainOnlyWhereItWas) {
  for (const SessionMatch match : {SessionMatch::strict, SessionMatch::by_key}) {
    Link link = replay_link(session_with_a_pulled_cable(), match);
    EXPECT_FAILS(link.reopen(), ErrorCode::device_unavailable);
  }
  // The session ends while the device is away.
  Session cut = session_with_a_pulled_cable();
  cut.transfers.resize(6);
  for (const SessionMatch match : {SessionMatch::strict, SessionMatch::by_key}) {
    const auto unit = *WireUnit::open(replay_link(cut, match));
    EXPECT_FAILS(unit->filter(), ErrorCode::device_unavailable);
    const Status away = unit->reconnect(std::chrono::seconds(1));
    EXPECT_FAILS(away, ErrorCode::device_unavailable);
    EXPECT_THAT(away.error().what, HasSubstr("did not come back"));
  }
  // The program goes on where the session opened the device again.
  Session opened = session_with_a_pulled_cable();
  opened.transfers.erase(opened.transfers.begin(), opened.transfers.begin() + 6);
  const Link link = replay_link(opened, SessionMatch::strict);
  const Status sent = link.reports->write(request(0, Command::identify), {});
  EXPECT_FAILS(sent, ErrorCode::bad_data);
  EXPECT_THAT(sent.error().what, HasSubstr("where the session has the device opened again"));
}

// The unit's clock is set by the recording's start: another time of day is the same request.
TEST(Replay, ARecordingMayStartAtAnotherTimeOfDay) {
  const auto start = [](std::uint16_t rate_hz, std::uint8_t time) {
    return Bytes{static_cast<std::uint8_t>(rate_hz), 0, time, time, time, time};
  };
  for (const SessionMatch match : {SessionMatch::strict, SessionMatch::by_key}) {
    Session session;
    session.transfers = {{SessionTransfer::Kind::to_device,
                          SessionChannel::reports,
                          {},
                          request(1, Command::start_recording, start(100, 1)),
                          {}},
                         {SessionTransfer::Kind::from_device,
                          SessionChannel::reports,
                          {},
                          reply(1, Command::start_recording, {7, 0}),
                          {}}};
    const Link link = replay_link(session, match);
    ASSERT_OK(link.reports->write(request(1, Command::start_recording, start(100, 2)), {}));
    Bytes out(kReportBytes);
    EXPECT_EQ(*link.reports->read(out, std::chrono::seconds(1)), kReportBytes);
    EXPECT_EQ(decode(out)->payload, (Bytes{7, 0}));
    // Another rate is another request.
    EXPECT_FAILS(replay_link(session, match)
                     .reports->write(request(1, Command::start_recording, start(30, 1)), {}),
                 ErrorCode::bad_data);
  }
}

// An answer after a divergence would be a guess: there is none, and the first reason stays.
TEST(Replay, AfterADivergenceNothingIsAnswered) {
  for (const SessionMatch match : {SessionMatch::strict, SessionMatch::by_key}) {
    const Link link = replay_link(tests::made_session(2), match);
    const Status sent = link.reports->write(Bytes{1, 2, 3}, {});
    EXPECT_FAILS(sent, ErrorCode::bad_data);
    EXPECT_THAT(sent.error().what, HasSubstr("3 bytes that are no request"));
    Bytes out(kReportBytes);
    const auto read = link.reports->read(out, std::chrono::seconds(1));
    EXPECT_FAILS(read, ErrorCode::bad_data);
    EXPECT_EQ(read.error().what, sent.error().what);
    const Status again = link.reports->write(request(0, Command::identify), {});
    EXPECT_FAILS(again, ErrorCode::bad_data);
    EXPECT_EQ(again.error().what, sent.error().what);
  }
}

TEST(Replay, AfterCancelThereIsNoDevice) {
  for (const SessionMatch match : {SessionMatch::strict, SessionMatch::by_key}) {
    const Link link = replay_link(tests::made_session(2), match);
    link.bulk->cancel();
    Bytes out(kReportBytes);
    EXPECT_FAILS(link.reports->write(request(0, Command::identify), {}),
                 ErrorCode::device_unavailable);
    EXPECT_FAILS(link.reports->read(out, std::chrono::seconds(1)), ErrorCode::device_unavailable);
  }
}

// Oracle: the times of the session. What comes later than the reader waits is there the next time.
TEST(Replay, AnAnswerComesWhenItCameThen) {
  const Bytes bytes{1, 2, 3};
  Session session;
  session.transfers = {{SessionTransfer::Kind::to_device, SessionChannel::bulk, {}, bytes, {}},
                       {SessionTransfer::Kind::from_device,
                        SessionChannel::bulk,
                        std::chrono::milliseconds(500),
                        Bytes{9, 8},
                        {}}};
  for (const SessionMatch match : {SessionMatch::strict, SessionMatch::by_key}) {
    const Link link = replay_link(session, match);
    ASSERT_OK(link.bulk->write(bytes, {}));
    Bytes out(10);
    EXPECT_EQ(*link.reports->read(out, std::chrono::milliseconds(100)), 0U) << "another channel";
    EXPECT_EQ(*link.bulk->read(out, std::chrono::milliseconds(100)), 0U);
    EXPECT_EQ(link.clock->elapsed(), std::chrono::milliseconds(200));
    EXPECT_EQ(*link.bulk->read(out, std::chrono::milliseconds(1000)), 2U);
    EXPECT_EQ(link.clock->elapsed(), std::chrono::milliseconds(500));
    EXPECT_EQ(out[0], 9);
  }
  const Link strict = replay_link(session, SessionMatch::strict);
  ASSERT_OK(strict.bulk->write(bytes, {}));
  Bytes out(10);
  EXPECT_EQ(*strict.bulk->read(out, std::chrono::seconds(1)), 2U);
  EXPECT_FAILS(strict.bulk->read(out, std::chrono::seconds(1)), ErrorCode::device_unavailable);
  EXPECT_FAILS(strict.bulk->write(bytes, {}), ErrorCode::device_unavailable);
}

// A transfer that failed then fails now, with the same kind of error.
TEST(Replay, AFailedTransferFailsAgain) {
  const Bytes bytes{1, 2, 3};
  const Error stall{ErrorCode::io, "the endpoint stalled", "hid:X", "try again"};
  Session session;
  session.transfers = {
      {SessionTransfer::Kind::to_device, SessionChannel::reports, {}, bytes, stall},
      {SessionTransfer::Kind::to_device, SessionChannel::reports, {}, bytes, {}},
      {SessionTransfer::Kind::from_device, SessionChannel::reports, {}, {}, stall},
      {SessionTransfer::Kind::from_device, SessionChannel::reports, {}, Bytes{4}, {}}};
  const Link link = replay_link(session, SessionMatch::strict);
  EXPECT_FAILS(link.reports->write(bytes, {}), ErrorCode::io);
  for (const SessionMatch match : {SessionMatch::strict, SessionMatch::by_key}) {
    const Link other = match == SessionMatch::strict ? Link{} : replay_link(session, match);
    Transport& reports = match == SessionMatch::strict ? *link.reports : *other.reports;
    ASSERT_OK(reports.write(bytes, {}));
    Bytes out(kReportBytes);
    EXPECT_FAILS(reports.read(out, std::chrono::seconds(1)), ErrorCode::io);
    EXPECT_EQ(*reports.read(out, std::chrono::seconds(1)), 1U);
    EXPECT_EQ(out[0], 4);
  }
}

TEST(Replay, TheAddressNamesTheFileAndTheMode) {
  MemoryEnv memory;
  ASSERT_OK(write_session(memory.files, "s.zip", tests::made_session(2)));
  ASSERT_OK(write_file(memory.files, "n.zip", "no session"));
  TransportRegistry links;
  register_replay(links);
  for (const char* address : {"replay:s.zip", "replay:s.zip,match=strict"}) {
    const auto unit = WireUnit::open(*links.open(address, memory.env));
    ASSERT_OK(unit);
    EXPECT_FAILS((*unit)->stop_stream(), ErrorCode::bad_data);
    EXPECT_TRUE((*unit)->jig()->turns_by_itself()) << "no person is asked";
    EXPECT_OK((*unit)->jig()->go_to(Pose::plus_x));
    EXPECT_OK(check_jig(*(*unit)->jig()));
  }
  EXPECT_OK((*WireUnit::open(*links.open("replay:s.zip,match=key", memory.env)))->stop_stream());
  const auto mode = links.open("replay:s.zip,match=fuzzy\x1b", memory.env);
  EXPECT_FAILS(mode, ErrorCode::usage);
  EXPECT_EQ(mode.error().what, "match=fuzzy\\x1b is neither strict nor key");
  EXPECT_FAILS(links.open("replay:none.zip", memory.env), ErrorCode::no_input);
  EXPECT_FAILS(links.open("replay:n.zip", memory.env), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::device
