#include "mocks/usb/usb_unit.h"

#include <algorithm>

#include <fmt/format.h>

#include "base/memory_env.h"
#include "device/usb/usb_ids.h"
#include "gt3x/recording.h"
#include "sim/recording.h"

namespace sixpoint::mocks {

namespace {

// The largest log.bin of a volume; a unit's flash is smaller.
constexpr std::uint64_t kLongestLog = 1ULL << 30U;
constexpr int kEmptyRate_hz = 30;

constexpr std::uint8_t kClassRequestIn = 0xA1;
constexpr std::uint8_t kClassRequestOut = 0x21;
constexpr std::uint8_t kGetReport = 0x01;
constexpr std::uint8_t kSetReport = 0x09;
constexpr std::uint16_t kInputReport = 0x0100;
constexpr std::uint16_t kOutputReport = 0x0200;

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
        sim::recording_info(unit.truth(), date, date, kEmptyRate_hz, unit.battery_mv()).serialise();
    files.push_back({"info.txt", std::make_shared<const Bytes>(info.begin(), info.end()), date});
    files.push_back(
        {"log.bin",
         std::make_shared<const Bytes>(sim::log_preamble(unit.truth(), date, kEmptyRate_hz)),
         date});
  }
  return FatImage::make(files);
}

namespace {

UsbDescriptors unit_descriptors(const sim::UnitTruth& truth) {
  DescriptorBuilder usb(device::kMonitorProductId, "Activity monitor", truth.serial);
  usb.add_hid_interface("Commands");
  usb.add_bulk_interface(0xFF, 0, 0, device::kBulkInEndpoint, device::kBulkOutEndpoint,
                         "Downloads");
  usb.add_storage_interface();
  return usb.take();
}

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
