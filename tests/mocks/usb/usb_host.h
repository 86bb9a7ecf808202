// The host's side of a virtual USB device, written from the specifications.
#pragma once

#include <cstring>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/wire/payload.h"
#include "mocks/usb/usb_unit.h"

namespace sixpoint::mocks {

struct UsbHost {
  explicit UsbHost(VirtualUnitOptions options = {.truth = sim::draw_unit(7)})
      : clock(std::make_shared<ManualClock>()),
        plugged(std::make_shared<PluggedUnit>(std::move(options), clock)),
        usb(plugged) {
    usb.bus_reset();
  }
  UsbAnswer ask(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                std::uint16_t length, const Bytes& data = {}) {
    return usb.control({type, request, value, index, length}, data);
  }
  void configure() { ASSERT_EQ(ask(0x00, 9, 1, 0, 0).kind, UsbAnswer::Kind::done); }
  device::Message exchange(device::Command command, Bytes payload = {}) {
    const auto report =
        device::encode({device::ReportKind::request, ++sequence, command, {}, std::move(payload)});
    EXPECT_EQ(usb.out(0x01, report).kind, UsbAnswer::Kind::done);
    const UsbAnswer reply = usb.in(0x81, 64);
    EXPECT_EQ(reply.kind, UsbAnswer::Kind::done);
    const auto message = device::decode(reply.bytes);
    EXPECT_TRUE(message.has_value());
    return message.value_or(device::Message{});
  }

  std::shared_ptr<ManualClock> clock;
  std::shared_ptr<PluggedUnit> plugged;
  UsbUnit usb;
  std::uint16_t sequence = 0;
};

struct DiskAnswer {
  Bytes data;
  bool stalled = false;
  int status = -1;
  std::uint32_t residue = 0;
};

// A host's bulk-only transport, written from the specification.
struct UsbDisk {
  explicit UsbDisk(UsbDevice& device) : usb(device) {}
  Bytes command_block(const Bytes& command, std::uint32_t length, bool in) {
    Bytes block = {'U', 'S', 'B', 'C'};
    ++tag;
    for (const std::uint32_t value : {tag, length}) {
      for (unsigned i = 0; i < 4; ++i) {
        block.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
      }
    }
    block.insert(block.end(), {static_cast<std::uint8_t>(in ? 0x80 : 0), 0,
                               static_cast<std::uint8_t>(command.size())});
    block.insert(block.end(), command.begin(), command.end());
    block.resize(31, 0);
    return block;
  }
  DiskAnswer run(const Bytes& command, std::uint32_t length, bool in = true) {
    DiskAnswer answer;
    EXPECT_EQ(usb.out(0x03, command_block(command, length, in)).kind, UsbAnswer::Kind::done);
    if (length != 0 && in) {
      const UsbAnswer data = usb.in(0x83, length);
      answer.stalled = data.kind == UsbAnswer::Kind::stall;
      answer.data = data.bytes;
    } else if (length != 0) {
      EXPECT_EQ(usb.out(0x03, Bytes(length, 0xEE)).kind, UsbAnswer::Kind::done);
    }
    UsbAnswer status = usb.in(0x83, 13);
    if (status.kind == UsbAnswer::Kind::stall) {
      answer.stalled = true;
      usb.control({0x02, 1, 0, 0x83, 0}, {});
      status = usb.in(0x83, 13);
    }
    if (status.kind != UsbAnswer::Kind::done || status.bytes.size() != 13 ||
        std::memcmp(status.bytes.data(), "USBS", 4) != 0) {
      return answer;
    }
    EXPECT_EQ(status.bytes[4] | (status.bytes[5] << 8), static_cast<int>(tag & 0xFFFFU));
    for (unsigned i = 0; i < 4; ++i) {
      answer.residue |= static_cast<std::uint32_t>(status.bytes[8 + i]) << (8 * i);
    }
    answer.status = status.bytes[12];
    return answer;
  }
  Bytes sense() {
    const Bytes data = run({3, 0, 0, 0, 18, 0}, 18).data;
    return data.size() == 18 ? Bytes{data[2], data[12], data[13]} : Bytes{};
  }
  Bytes read(std::uint32_t block, std::uint16_t count) {
    const auto byte = [](std::uint32_t value, unsigned shift) {
      return static_cast<std::uint8_t>(value >> shift);
    };
    return run({0x28, 0, byte(block, 24), byte(block, 16), byte(block, 8), byte(block, 0), 0,
                byte(count, 8), byte(count, 0), 0},
               std::uint32_t{count} * 512)
        .data;
  }
  UsbDevice& usb;
  std::uint32_t tag = 0;
};

}  // namespace sixpoint::mocks
