#include "device/session/session_recorder.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
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

}  // namespace
}  // namespace sixpoint::device
