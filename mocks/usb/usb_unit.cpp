#include "mocks/usb_unit.h"

#include <algorithm>

#include <fmt/format.h>

#include "base/memory_env.h"
#include "device/usb_ids.h"
#include "gt3x/recording.h"
#include "sim/recording.h"

namespace sixpoint::mocks {

namespace {

constexpr std::uint16_t kBulkPacketBytes = 512;  // high speed
// The largest log.bin of a volume; a unit's flash is smaller.
constexpr std::uint64_t kLongestLog = 1ULL << 30U;
constexpr int kEmptyRate_hz = 30;

constexpr std::uint8_t kClassRequestIn = 0xA1;
constexpr std::uint8_t kClassRequestOut = 0x21;
constexpr std::uint8_t kGetReport = 0x01;
constexpr std::uint8_t kSetReport = 0x09;
constexpr std::uint16_t kInputReport = 0x0100;
constexpr std::uint16_t kOutputReport = 0x0200;

void put16(Bytes& out, std::size_t value) {
  out.push_back(static_cast<std::uint8_t>(value & 0xFFU));
  out.push_back(static_cast<std::uint8_t>((value >> 8U) & 0xFFU));
}

void put_interface(Bytes& out, int number, std::uint8_t device_class, std::uint8_t subclass,
                   std::uint8_t protocol, std::uint8_t name) {
  const Bytes bytes = {
      9, 4, static_cast<std::uint8_t>(number), 0, 2, device_class, subclass, protocol, name};
  out.insert(out.end(), bytes.begin(), bytes.end());
}

void put_endpoint(Bytes& out, std::uint8_t address, UsbEndpoint::Type type, std::size_t max_packet,
                  std::uint8_t interval) {
  out.insert(out.end(), {7, 5, address, static_cast<std::uint8_t>(type)});
  put16(out, max_packet);
  out.push_back(interval);
}

// What info.txt and log.bin of one recording are, in a folder of the volume.
Status add_recording(std::vector<FatFile>& files, const std::string& folder, const Bytes& image) {
  MemoryFiles disk;
  SIXPOINT_ASSIGN(auto file, disk.create("recording.gt3x"));
  SIXPOINT_CHECK(file->write_at(0, image));
  SIXPOINT_ASSIGN(gt3x::Recording recording, gt3x::Recording::open(disk, "recording.gt3x"));
  const UtcTime start = recording.info().start().value_or(UtcTime{});
  for (const char* name : {"info.txt", "log.bin"}) {
    SIXPOINT_ASSIGN(auto entry, recording.open_entry(name));
    SIXPOINT_ASSIGN(Bytes content, gt3x::read_all(*entry, kLongestLog));
    files.push_back({folder + name, std::make_shared<const Bytes>(std::move(content)), start});
  }
  return {};
}

}  // namespace

const Bytes& hid_report_descriptor() {
  static const Bytes kDescriptor = {
      0x06, 0x00, 0xFF,  // usage page 0xFF00
      0x09, 0x01,        // usage 1
      0xA1, 0x01,        // collection (application)
      0x15, 0x00,        //   logical minimum 0
      0x26, 0xFF, 0x00,  //   logical maximum 255
      0x75, 0x08,        //   report size 8
      0x95, 0x40,        //   report count 64
      0x09, 0x01,        //   usage 1
      0x81, 0x02,        //   input (data, variable, absolute)
      0x09, 0x01,        //   usage 1
      0x91, 0x02,        //   output (data, variable, absolute)
      0xC0,              // end collection
  };
  return kDescriptor;
}

UsbDescriptors unit_descriptors(const sim::UnitTruth& truth) {
  UsbDescriptors usb;
  usb.device = {18, 1, 0x00, 0x02, 0, 0, 0, 64};
  put16(usb.device, device::kUsbVendorId);
  put16(usb.device, device::kMonitorProductId);
  put16(usb.device, 0x0100);
  usb.device.insert(usb.device.end(), {1, 2, 3, 1});
  usb.strings = {{1, "Sixpoint"}, {2, "Activity monitor"}, {3, truth.serial},
                 {4, "Commands"}, {5, "Downloads"},        {6, "Recordings"}};

  constexpr std::uint8_t kSelfPowered = 0xC0;
  usb.configuration = {9, 2, 0, 0, 3, 1, 0, kSelfPowered, 50};  // 100 mA to charge
  Bytes& out = usb.configuration;
  put_interface(out, device::kHidInterface, 3, 0, 0, 4);
  out.insert(out.end(), {9, 0x21, 0x11, 0x01, 0, 1, 0x22});
  put16(out, hid_report_descriptor().size());
  // Every 2^(4-1) microframes: 1 ms.
  put_endpoint(out, device::kHidInEndpoint, UsbEndpoint::Type::interrupt, device::kReportBytes, 4);
  put_endpoint(out, device::kHidOutEndpoint, UsbEndpoint::Type::interrupt, device::kReportBytes, 4);
  put_interface(out, device::kBulkInterface, 0xFF, 0, 0, 5);
  put_endpoint(out, device::kBulkInEndpoint, UsbEndpoint::Type::bulk, kBulkPacketBytes, 0);
  put_endpoint(out, device::kBulkOutEndpoint, UsbEndpoint::Type::bulk, kBulkPacketBytes, 0);
  put_interface(out, device::kStorageInterface, 8, 6, 0x50, 6);
  put_endpoint(out, device::kStorageInEndpoint, UsbEndpoint::Type::bulk, kBulkPacketBytes, 0);
  put_endpoint(out, device::kStorageOutEndpoint, UsbEndpoint::Type::bulk, kBulkPacketBytes, 0);
  out[2] = static_cast<std::uint8_t>(out.size() & 0xFFU);
  out[3] = static_cast<std::uint8_t>(out.size() >> 8U);
  usb.hid = {{device::kHidInterface, hid_report_descriptor()}};
  return usb;
}

Result<FatImage> unit_volume(const VirtualUnit& unit) {
  std::vector<FatFile> files;
  const auto& images = unit.recordings();
  const UtcTime date = unit.truth().calibrated;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const bool newest = i + 1 == images.size();
    SIXPOINT_CHECK(add_recording(files, newest ? "" : fmt::format("REC{:05}/", i + 1), images[i]));
  }
  if (images.empty()) {
    const std::string info =
        sim::recording_info(unit.truth(), date, date, kEmptyRate_hz).serialise();
    files.push_back({"info.txt", std::make_shared<const Bytes>(info.begin(), info.end()), date});
    files.push_back(
        {"log.bin",
         std::make_shared<const Bytes>(sim::log_preamble(unit.truth(), date, kEmptyRate_hz)),
         date});
  }
  return FatImage::make(files);
}

namespace {

ScsiIdentity scsi_identity(const sim::UnitTruth& truth) {
  return {.product = "Activity monitor", .serial = truth.serial};
}

}  // namespace

UsbUnit::UsbUnit(std::shared_ptr<PluggedUnit> plugged)
    : StorageUsbDevice(unit_descriptors(plugged->unit.truth()), plugged->clock,
                       scsi_identity(plugged->unit.truth())),
      plugged_(std::move(plugged)),
      bulk_(kBulkPacketBytes) {
  enumeration_seen_ = plugged_->faults.enumeration();
  show_recordings();
}

void UsbUnit::show_recordings() {
  const std::size_t count = plugged_->unit.recordings().size();
  if (recordings_shown_ == count) {
    return;
  }
  // Recordings that do not fit leave the volume as it was; the download has them all.
  if (auto volume = unit_volume(plugged_->unit)) {
    storage_.insert(std::make_shared<const FatImage>(*std::move(volume)));
  }
  recordings_shown_ = count;
}

std::optional<std::chrono::nanoseconds> UsbUnit::next_due() const {
  const std::lock_guard lock(plugged_->mutex);
  return plugged_->faults.next_due(plugged_->unit);
}

void UsbUnit::on_reset() {
  const std::lock_guard lock(plugged_->mutex);
  plugged_->unit.lose_cable();
  plugged_->faults.advance(plugged_->unit, plugged_->clock->elapsed());
  if (enumeration_seen_ != plugged_->faults.enumeration()) {
    enumeration_seen_ = plugged_->faults.enumeration();
    describe(unit_descriptors(plugged_->unit.truth()));
    storage_ = MassStorage(scsi_identity(plugged_->unit.truth()));
    recordings_shown_.reset();
    show_recordings();
  }
  bulk_.clear();
  storage_.reset();
}

void UsbUnit::on_plug(bool plugged) {
  const std::lock_guard lock(plugged_->mutex);
  plugged_->unplugged = !plugged;
}

bool UsbUnit::is_on_bus() const {
  const std::lock_guard lock(plugged_->mutex);
  FaultInjector& faults = plugged_->faults;
  faults.advance(plugged_->unit, plugged_->clock->elapsed());
  return faults.plugged() && faults.enumeration() == enumeration_seen_;
}

UsbAnswer UsbUnit::own_request(const SetupPacket& setup, std::span<const std::uint8_t> data) {
  if (setup.index == device::kStorageInterface) {
    return storage_.request(setup, device::kStorageInterface);
  }
  if (setup.index == device::kHidInterface) {
    if (setup.request_type == kClassRequestOut && setup.request == kSetReport &&
        setup.value == kOutputReport && data.size() == device::kReportBytes) {
      return take_reports(data);
    }
    if (setup.request_type == kClassRequestIn && setup.request == kGetReport &&
        setup.value == kInputReport) {
      return UsbAnswer::done(last_report_);
    }
  }
  return UsbAnswer::stall();
}

namespace {

UsbAnswer answer_of(CableEvent event) {
  switch (event.kind) {
    case CableEvent::Kind::data:
      return UsbAnswer::done(std::move(event.bytes));
    case CableEvent::Kind::stalled:
      return UsbAnswer::stall();
    case CableEvent::Kind::gone:
      return UsbAnswer::gone();
    case CableEvent::Kind::nothing:
      break;
  }
  return UsbAnswer::nothing_yet();
}

}  // namespace

UsbAnswer UsbUnit::take_reports(std::span<const std::uint8_t> bytes) {
  const std::lock_guard lock(plugged_->mutex);
  const auto now = plugged_->clock->elapsed();
  while (!bytes.empty()) {
    const std::size_t length = std::min(bytes.size(), device::kReportBytes);
    CableEvent event = plugged_->faults.write_report(plugged_->unit, bytes.first(length), now);
    if (event.kind == CableEvent::Kind::stalled || event.kind == CableEvent::Kind::gone) {
      return answer_of(std::move(event));
    }
    bytes = bytes.subspan(length);
  }
  return UsbAnswer::done();
}

UsbAnswer UsbUnit::give_report(std::size_t max_length) {
  const std::lock_guard lock(plugged_->mutex);
  UsbAnswer answer =
      answer_of(plugged_->faults.read_report(plugged_->unit, plugged_->clock->elapsed()));
  if (answer.kind == UsbAnswer::Kind::done) {
    last_report_ = answer.bytes;
    if (max_length < answer.bytes.size()) {
      return {UsbAnswer::Kind::overflow, {}};
    }
  }
  return answer;
}

UsbAnswer UsbUnit::take(const UsbEndpoint& endpoint, std::span<const std::uint8_t> bytes) {
  switch (endpoint.address) {
    case device::kHidOutEndpoint:
      return take_reports(bytes);
    case device::kStorageOutEndpoint: {
      if (storage_.is_idle()) {
        const std::lock_guard lock(plugged_->mutex);
        show_recordings();
      }
      return take_storage(bytes);
    }
    default:
      return UsbAnswer::done();  // the bulk OUT endpoint is not used (docs/protocol.md)
  }
}

UsbAnswer UsbUnit::give(const UsbEndpoint& endpoint, std::size_t max_length) {
  switch (endpoint.address) {
    case device::kHidInEndpoint:
      return give_report(max_length);
    case device::kStorageInEndpoint:
      return give_storage(max_length);
    default:
      break;
  }
  {
    const std::lock_guard lock(plugged_->mutex);
    VirtualUnit& unit = plugged_->unit;
    if (download_of_bulk_ != unit.downloads()) {
      bulk_.clear();
      download_of_bulk_ = unit.downloads();
    }
    if (bulk_.empty()) {
      UsbAnswer answer = answer_of(plugged_->faults.read_bulk(unit, plugged_->clock->elapsed()));
      if (answer.kind != UsbAnswer::Kind::done) {
        return answer;
      }
      bulk_.put(std::move(answer.bytes));
    }
  }
  return bulk_.next(max_length);
}

}  // namespace sixpoint::mocks
