#include "device/session/session_recorder.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/made_links.h"
#include "expect_result.h"
#include "mocks/inert/inert.h"

namespace sixpoint::device {
namespace {

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

// Oracle: what was done. The channels of the link that was opened again are recorded too.
TEST(Recorder, KeepsFailedWritesAndEachAttemptToOpenTheDeviceAgain) {
  const auto clock = std::make_shared<ManualClock>();
  const auto broken = std::make_shared<tests::Break>();
  int attempts = 0;
  const auto inert_link = [&] {
    Link link;
    link.clock = clock;
    link.reports = std::make_unique<mocks::InertTransport>(clock);
    return link;
  };
  Link link = tests::breaking(inert_link(), broken);
  link.reopen = [&]() -> Result<Link> {
    if (++attempts == 1) {
      return fail(ErrorCode::device_unavailable, "no such device", {}, "plug it in");
    }
    return inert_link();
  };
  MemoryFiles files;
  SessionRecorder recorder;
  ASSERT_OK(recorder.begin(files, "s.zip"));
  recorder.attach(link);
  broken->left = 0;
  EXPECT_FAILS(link.reports->write(Bytes{1}, {}), ErrorCode::device_unavailable);
  EXPECT_FAILS(link.reopen(), ErrorCode::device_unavailable);
  const auto again = link.reopen();
  ASSERT_OK(again);
  EXPECT_OK(again->reports->write(Bytes{2}, {}));
  ASSERT_OK(recorder.finish());
  EXPECT_OK(again->reports->write(Bytes{3}, {})) << "the work goes on without the recorder";
  const auto session = read_session(files, "s.zip");
  ASSERT_OK(session);
  using Kind = SessionTransfer::Kind;
  struct Row {
    Kind kind;
    Bytes bytes;
    bool failed;
  };
  const std::vector<Row> rows = {{Kind::to_device, {1}, true},
                                 {Kind::reopened, {}, true},
                                 {Kind::reopened, {}, false},
                                 {Kind::to_device, {2}, false}};
  ASSERT_EQ(session->transfers.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(session->transfers[i].kind, rows[i].kind) << i;
    EXPECT_EQ(session->transfers[i].bytes, rows[i].bytes) << i;
    EXPECT_EQ(session->transfers[i].error.has_value(), rows[i].failed) << i;
  }
}

TEST(Recorder, WithoutABeginningItRecordsNothing) {
  Link link;
  link.clock = std::make_shared<ManualClock>();
  link.reports = std::make_unique<mocks::InertTransport>(std::make_shared<ManualClock>());
  const Transport* const before = link.reports.get();
  SessionRecorder recorder;
  recorder.attach(link);
  EXPECT_EQ(link.reports.get(), before);
  EXPECT_OK(recorder.finish());
  EXPECT_FALSE(recorder.truncated());
}

}  // namespace
}  // namespace sixpoint::device
