#include "mocks/usb/mass_storage.h"

#include <algorithm>
#include <array>

#include "device/usb/usb_ids.h"
#include "device/wire/payload.h"

namespace sixpoint::mocks {

namespace {

constexpr std::uint32_t kCommandSignature = 0x43425355;  // "USBC"
constexpr std::uint32_t kStatusSignature = 0x53425355;   // "USBS"
constexpr std::size_t kCommandBlockBytes = 31;
constexpr std::size_t kStatusBlockBytes = 13;

constexpr std::uint8_t kPassed = 0;
constexpr std::uint8_t kFailed = 1;
constexpr std::uint8_t kPhaseError = 2;

constexpr std::uint8_t kGetMaxLun = 0xFE;
constexpr std::uint8_t kBulkOnlyReset = 0xFF;

// SCSI operation codes.
enum Operation : std::uint8_t {
  kTestUnitReady = 0x00,
  kRequestSense = 0x03,
  kRead6 = 0x08,
  kWrite6 = 0x0A,
  kInquiry = 0x12,
  kModeSense6 = 0x1A,
  kStartStopUnit = 0x1B,
  kPreventAllow = 0x1E,
  kReadFormatCapacities = 0x23,
  kReadCapacity10 = 0x25,
  kRead10 = 0x28,
  kWrite10 = 0x2A,
  kVerify10 = 0x2F,
  kSynchronizeCache = 0x35,
  kModeSense10 = 0x5A,
  kServiceActionIn = 0x9E,
  kReportLuns = 0xA0,
  kRead12 = 0xA8,
  kWrite12 = 0xAA,
};
constexpr std::uint8_t kReadCapacity16 = 0x10;  // its service action
constexpr ScsiSense kBadCommand = {5, 0x20, 0};
constexpr ScsiSense kOutOfRange = {5, 0x21, 0};
constexpr ScsiSense kBadField = {5, 0x24, 0};
constexpr ScsiSense kWriteProtected = {7, 0x27, 0};
constexpr std::uint8_t kWriteProtectBit = 0x80;
constexpr std::uint32_t kFormatted = 0x02000000;

std::uint32_t big(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t width) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < width; ++i) {
    value = (value << 8U) | bytes[at + i];
  }
  return value;
}

void put_big32(Bytes& out, std::uint32_t value) {
  for (unsigned i = 4; i-- > 0;) {
    out.push_back(static_cast<std::uint8_t>((value >> (8 * i)) & 0xFFU));
  }
}

void put_padded(Bytes& out, std::string_view text, std::size_t width) {
  for (std::size_t i = 0; i < width; ++i) {
    out.push_back(static_cast<std::uint8_t>(i < text.size() ? text[i] : ' '));
  }
}

}  // namespace

struct MassStorage::Plan {
  std::uint8_t status = kPassed;
  std::uint64_t bytes = 0;
  std::function<Bytes(std::uint64_t, std::size_t)> source;

  static Plan passed() { return {}; }
  // An answer, cut to the command's allocation length.
  static Plan answer(Bytes bytes, std::size_t allocation) {
    bytes.resize(std::min(bytes.size(), allocation));
    Plan plan;
    plan.bytes = bytes.size();
    plan.source = [bytes = std::move(bytes)](std::uint64_t offset, std::size_t length) {
      const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(offset);
      return Bytes(begin, begin + static_cast<std::ptrdiff_t>(length));
    };
    return plan;
  }
};

void MassStorage::insert(std::shared_ptr<const BlockMedium> medium) {
  attention_ = attention_ || medium_ != nullptr;
  medium_ = std::move(medium);
}

void MassStorage::reset() {
  phase_ = Phase::command;
  source_ = nullptr;
}

UsbAnswer MassStorage::request(const SetupPacket& setup, std::uint8_t interface) {
  if (setup.index != interface || setup.value != 0) {
    return UsbAnswer::stall();
  }
  if (setup.request_type == 0xA1 && setup.request == kGetMaxLun && setup.length == 1) {
    return UsbAnswer::done({0});
  }
  if (setup.request_type == 0x21 && setup.request == kBulkOnlyReset && setup.length == 0) {
    reset();
    return UsbAnswer::done();
  }
  return UsbAnswer::stall();
}

UsbAnswer MassStorage::take(std::span<const std::uint8_t> bytes) {
  if (phase_ == Phase::data_out) {
    // The medium cannot be written: data are taken and dropped.
    moved_ += std::min<std::uint64_t>(bytes.size(), expected_ - moved_);
    if (moved_ == expected_ || bytes.size() % kBulkPacketBytes != 0 || bytes.empty()) {
      moved_ = 0;
      phase_ = Phase::status;
    }
    return UsbAnswer::done();
  }
  device::PayloadReader in(bytes);
  // A command block is valid and meaningful (bulk-only transport, 6.2), or everything stops.
  if (phase_ != Phase::command || bytes.size() != kCommandBlockBytes ||
      in.get<std::uint32_t>() != kCommandSignature || (bytes[13] & 0x0FU) != 0 ||
      (bytes[14] & 0x1FU) < 1 || (bytes[14] & 0x1FU) > 16) {
    phase_ = Phase::broken;
    return UsbAnswer::stall();
  }
  tag_ = in.get<std::uint32_t>();
  expected_ = in.get<std::uint32_t>();
  const bool towards_host = (bytes[12] & 0x80U) != 0;
  // Bytes behind the command's own length count as zero.
  std::array<std::uint8_t, 16> command{};
  std::copy_n(bytes.begin() + 15, bytes[14] & 0x1FU, command.begin());
  Plan plan = execute(command);

  status_ = plan.status;
  moved_ = 0;
  to_move_ = towards_host ? std::min(plan.bytes, expected_) : 0;
  source_ = std::move(plan.source);
  // The thirteen cases (6.7): what the device wants to move against what the host expects.
  if (plan.bytes > expected_ || (plan.bytes > 0 && !towards_host)) {
    status_ = kPhaseError;
  }
  ends_short_ = to_move_ < expected_;
  if (expected_ == 0) {
    phase_ = Phase::status;
  } else if (!towards_host) {
    phase_ = Phase::data_out;
  } else {
    phase_ = to_move_ > 0 ? Phase::data_in : Phase::stalled_in;
  }
  return UsbAnswer::done();
}

UsbAnswer MassStorage::give(std::size_t max_length) {
  switch (phase_) {
    case Phase::data_in: {
      const std::uint64_t left = to_move_ - moved_;
      if (left > max_length && max_length % kBulkPacketBytes != 0) {
        return {UsbAnswer::Kind::overflow, {}};
      }
      const auto now = static_cast<std::size_t>(std::min<std::uint64_t>(left, max_length));
      Bytes bytes = source_(moved_, now);
      moved_ += now;
      if (moved_ == to_move_) {
        // A short or empty packet ends the transfer for the host; where its buffer ended with the
        // last packet, only a stall can.
        const bool ended = now < max_length || now % kBulkPacketBytes != 0;
        phase_ = ends_short_ && !ended ? Phase::stalled_in : Phase::status;
      }
      return UsbAnswer::done(std::move(bytes));
    }
    case Phase::stalled_in:
      phase_ = Phase::status;
      return UsbAnswer::stall();
    case Phase::status:
      if (max_length < kStatusBlockBytes) {
        return {UsbAnswer::Kind::overflow, {}};
      }
      phase_ = Phase::command;
      return UsbAnswer::done(status_block());
    case Phase::broken:
      return UsbAnswer::stall();
    case Phase::command:
    case Phase::data_out:
      break;
  }
  return UsbAnswer::nothing_yet();
}

Bytes MassStorage::status_block() const {
  return device::payload_of(kStatusSignature, tag_, static_cast<std::uint32_t>(expected_ - moved_),
                            status_);
}

MassStorage::Plan MassStorage::refuse(ScsiSense sense) {
  sense_ = sense;
  Plan plan;
  plan.status = kFailed;
  return plan;
}

MassStorage::Plan MassStorage::read(std::uint64_t block, std::uint64_t count) {
  if (block + count > medium_->blocks()) {
    return refuse(kOutOfRange);
  }
  Plan plan;
  plan.bytes = count * kBlockBytes;
  plan.source = [medium = medium_, block](std::uint64_t offset, std::size_t length) {
    Bytes bytes(length);
    std::array<std::uint8_t, kBlockBytes> one{};
    for (std::size_t done = 0; done < length;) {
      medium->read(static_cast<std::uint32_t>(block + (offset + done) / kBlockBytes), one);
      const auto skip = static_cast<std::size_t>((offset + done) % kBlockBytes);
      const std::size_t part = std::min(kBlockBytes - skip, length - done);
      std::copy_n(one.begin() + static_cast<std::ptrdiff_t>(skip), part,
                  bytes.begin() + static_cast<std::ptrdiff_t>(done));
      done += part;
    }
    return bytes;
  };
  return plan;
}

MassStorage::Plan MassStorage::inquiry(std::span<const std::uint8_t> command) {
  const std::size_t allocation = big(command, 3, 2);
  Bytes answer;
  if ((command[1] & 1U) != 0) {
    if (command[2] == 0x00) {
      answer = {0, 0, 0, 2, 0x00, 0x80};
    } else if (command[2] == 0x80) {
      answer = {0, 0x80, 0, static_cast<std::uint8_t>(identity_.serial.size())};
      put_padded(answer, identity_.serial, identity_.serial.size() & 0xFFU);
    } else {
      return refuse(kBadField);
    }
    return Plan::answer(std::move(answer), allocation);
  }
  if (command[2] != 0) {
    return refuse(kBadField);
  }
  // A disk whose medium can change; SPC-2; 31 bytes follow the fifth.
  answer = {0x00, 0x80, 0x04, 0x02, 31, 0, 0, 0};
  put_padded(answer, identity_.vendor, 8);
  put_padded(answer, identity_.product, 16);
  put_padded(answer, identity_.revision, 4);
  return Plan::answer(std::move(answer), allocation);
}

MassStorage::Plan MassStorage::execute(std::span<const std::uint8_t> command) {
  // These answer whatever the state (SPC-2, 5.6.1).
  switch (command[0]) {
    case kInquiry:
      return inquiry(command);
    case kRequestSense: {
      const ScsiSense sense = std::exchange(sense_, {});
      return Plan::answer(
          {0x70, 0, sense.key, 0, 0, 0, 0, 10, 0, 0, 0, 0, sense.code, sense.qualifier, 0, 0, 0, 0},
          command[4]);
    }
    case kReportLuns:
      return Plan::answer({0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, big(command, 6, 4));
    default:
      break;
  }
  sense_ = {};
  if (attention_) {
    attention_ = false;
    ejected_ = false;
    constexpr ScsiSense kChanged = {6, 0x28, 0};
    return refuse(kChanged);
  }
  if (command[0] == kStartStopUnit) {
    const bool eject = (command[4] & 2U) != 0;
    if (eject) {
      ejected_ = (command[4] & 1U) == 0;
    }
    return Plan::passed();
  }
  if (command[0] == kPreventAllow) {
    return Plan::passed();
  }
  if (medium_ == nullptr || ejected_) {
    constexpr ScsiSense kNoMedium = {2, 0x3A, 0};
    return refuse(kNoMedium);
  }
  return execute_on_medium(command);
}

MassStorage::Plan MassStorage::execute_on_medium(std::span<const std::uint8_t> command) {
  switch (command[0]) {
    case kTestUnitReady:
    case kSynchronizeCache:
      return Plan::passed();
    case kModeSense6:
      return Plan::answer({3, 0, kWriteProtectBit, 0}, command[4]);
    case kModeSense10:
      return Plan::answer({0, 6, 0, kWriteProtectBit, 0, 0, 0, 0}, big(command, 7, 2));
    case kReadFormatCapacities:
      return capacity({0, 0, 0, 8}, medium_->blocks(), kFormatted | kBlockBytes, 12,
                      big(command, 7, 2));
    case kReadCapacity10:
      return capacity({}, medium_->blocks() - 1, kBlockBytes, 8, 8);
    case kServiceActionIn:
      if ((command[1] & 0x1FU) != kReadCapacity16) {
        return refuse(kBadField);
      }
      return capacity({0, 0, 0, 0}, medium_->blocks() - 1, kBlockBytes, 32, big(command, 10, 4));
    case kRead6:
      return read(big(command, 1, 3) & 0x1FFFFFU, command[4] == 0 ? 256 : command[4]);
    case kRead10:
      return read(big(command, 2, 4), big(command, 7, 2));
    case kRead12:
      return read(big(command, 2, 4), big(command, 6, 4));
    case kVerify10: {
      if ((command[1] & 2U) != 0) {
        return refuse(kBadField);
      }
      const Plan checked = read(big(command, 2, 4), big(command, 7, 2));
      return checked.status == kPassed ? Plan::passed() : checked;
    }
    case kWrite6:
    case kWrite10:
    case kWrite12:
      return refuse(kWriteProtected);
    default:
      return refuse(kBadCommand);
  }
}

// Number of blocks and block size, behind `begin`, zeros up to `size`.
MassStorage::Plan MassStorage::capacity(Bytes begin, std::uint32_t blocks,
                                        std::uint32_t block_bytes, std::size_t size,
                                        std::size_t allocation) {
  put_big32(begin, blocks);
  put_big32(begin, block_bytes);
  begin.resize(size, 0);
  return Plan::answer(std::move(begin), allocation);
}

UsbAnswer StorageUsbDevice::halting(UsbAnswer answer, std::uint8_t endpoint) {
  if (answer.kind == UsbAnswer::Kind::stall) {
    halt(endpoint);
  }
  if (storage_.needs_reset()) {
    halt(device::kStorageInEndpoint);
    halt(device::kStorageOutEndpoint);
  }
  return answer;
}

UsbAnswer StorageUsbDevice::take_storage(std::span<const std::uint8_t> bytes) {
  return halting(storage_.take(bytes), device::kStorageOutEndpoint);
}

UsbAnswer StorageUsbDevice::give_storage(std::size_t max_length) {
  return halting(storage_.give(max_length), device::kStorageInEndpoint);
}

bool StorageUsbDevice::may_clear_halt(std::uint8_t endpoint) {
  const bool of_storage =
      endpoint == device::kStorageInEndpoint || endpoint == device::kStorageOutEndpoint;
  return !of_storage || !storage_.needs_reset();
}

}  // namespace sixpoint::mocks
