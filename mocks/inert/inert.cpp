#include "mocks/inert/inert.h"

#include <algorithm>

namespace sixpoint::mocks {

Status InertTransport::write(std::span<const std::uint8_t> bytes,
                             std::chrono::nanoseconds /*time_out*/) {
  written.emplace_back(bytes.begin(), bytes.end());
  if (on_write) {
    on_write(bytes);
  }
  return {};
}

Result<std::size_t> InertTransport::read(std::span<std::uint8_t> out,
                                         std::chrono::nanoseconds time_out) {
  if (to_read.empty()) {
    clock_->sleep(time_out);
    return 0;
  }
  const Result<Bytes> next = std::move(to_read.front());
  to_read.pop_front();
  SIXPOINT_CHECK(next);
  const std::size_t count = std::min(next->size(), out.size());
  std::copy_n(next->begin(), count, out.begin());
  return count;
}

Status InertJig::go_to(device::Pose pose) {
  poses.push_back(pose);
  return next_status;
}

Status InertJig::stop() {
  ++stops;
  return {};
}

Status InertJig::release() {
  ++releases;
  return {};
}

Status TamperingTransport::write(std::span<const std::uint8_t> bytes,
                                 std::chrono::nanoseconds time_out) {
  Bytes copy(bytes.begin(), bytes.end());
  for (int times = on_write_ ? on_write_(copy) : 1; times > 0; --times) {
    SIXPOINT_CHECK(inner_->write(copy, time_out));
  }
  return {};
}

Result<std::size_t> TamperingTransport::read(std::span<std::uint8_t> out,
                                             std::chrono::nanoseconds time_out) {
  Bytes bytes;
  if (!again_.empty()) {
    bytes = std::move(again_.front());
    again_.pop_front();
  } else {
    bytes.resize(out.size());
    SIXPOINT_ASSIGN(const std::size_t count, inner_->read(bytes, time_out));
    bytes.resize(count);
    if (count == 0) {
      return 0;
    }
    const int times = on_read_ ? on_read_(bytes) : 1;
    if (times == 0) {
      return 0;
    }
    for (int i = 1; i < times; ++i) {
      again_.push_back(bytes);
    }
  }
  const std::size_t count = std::min(bytes.size(), out.size());
  std::copy_n(bytes.begin(), count, out.begin());
  return count;
}

}  // namespace sixpoint::mocks
