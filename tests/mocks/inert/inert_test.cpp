#include "mocks/inert/inert.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint::mocks {
namespace {

using device::Pose;

TEST(Inert, RecordsItsCalls) {
  const auto clock = std::make_shared<ManualClock>();
  InertTransport transport(clock);
  transport.to_read.push_back(Bytes{1, 2, 3});
  transport.to_read.push_back(fail(ErrorCode::io, "as set", "test", "none needed"));
  std::array<std::uint8_t, 64> buffer{};
  EXPECT_EQ(*transport.read(buffer, std::chrono::seconds(1)), 3U);
  EXPECT_FAILS(transport.read(buffer, std::chrono::seconds(1)), ErrorCode::io);
  EXPECT_EQ(*transport.read(buffer, std::chrono::seconds(1)), 0U);
  EXPECT_EQ(clock->elapsed(), std::chrono::seconds(1));
  ASSERT_OK(transport.write(Bytes{9}, std::chrono::seconds(1)));
  EXPECT_EQ(transport.written, (std::vector<Bytes>{{9}}));
  InertJig jig;
  ASSERT_OK(jig.go_to(Pose::minus_y));
  EXPECT_EQ(jig.poses, (std::vector<Pose>{Pose::minus_y}));
}

}  // namespace
}  // namespace sixpoint::mocks
