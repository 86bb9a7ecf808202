// Mocks that do nothing by themselves: they return what a test sets, and record their calls.
//
//   InertTransport transport(clock);
//   transport.to_read.push_back(Bytes{1, 2, 3});
//   SIXPOINT_ASSIGN(const auto bytes, transport.read(buffer, std::chrono::seconds(1)));  // 3
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <vector>

#include "device/jig.h"
#include "device/transport.h"

namespace sixpoint::mocks {

// Reads come from `to_read`, in order; an empty list is "nothing came in time", and time passes on
// the clock. Errors may stand in the list.
class InertTransport final : public device::Transport {
 public:
  explicit InertTransport(std::shared_ptr<Clock> clock) : clock_(std::move(clock)) {}
  Status write(std::span<const std::uint8_t> bytes, std::chrono::nanoseconds time_out) override;
  Result<std::size_t> read(std::span<std::uint8_t> out, std::chrono::nanoseconds time_out) override;
  void cancel() override { ++cancels; }

  std::deque<Result<Bytes>> to_read;
  std::vector<Bytes> written;
  std::function<void(std::span<const std::uint8_t>)> on_write;  // may fill to_read
  int cancels = 0;

 private:
  std::shared_ptr<Clock> clock_;
};

class InertJig final : public device::Jig {
 public:
  std::string name() const override { return "inert"; }
  bool turns_by_itself() const override { return by_itself; }
  Status go_to(device::Pose pose) override;
  Result<device::JigPosition> position() override { return next_position; }
  Status stop() override;
  Status release() override;

  bool by_itself = true;
  Result<device::JigPosition> next_position = device::JigPosition{};
  Status next_status;
  std::vector<device::Pose> poses;
  int stops = 0;
  int releases = 0;
};

// Passes everything through two functions. They may change the bytes, and return how many times
// they are delivered: 0 loses them, 2 delivers them twice.
class TamperingTransport final : public device::Transport {
 public:
  using Tamper = std::function<int(Bytes& bytes)>;
  TamperingTransport(std::unique_ptr<device::Transport> inner, Tamper on_write, Tamper on_read)
      : inner_(std::move(inner)), on_write_(std::move(on_write)), on_read_(std::move(on_read)) {}
  Status write(std::span<const std::uint8_t> bytes, std::chrono::nanoseconds time_out) override;
  Result<std::size_t> read(std::span<std::uint8_t> out, std::chrono::nanoseconds time_out) override;
  void cancel() override { inner_->cancel(); }

 private:
  std::unique_ptr<device::Transport> inner_;
  Tamper on_write_;
  Tamper on_read_;
  std::deque<Bytes> again_;
};

}  // namespace sixpoint::mocks
