// What a USB device says about itself: descriptors as bytes on the wire, made and parsed.
//
//   DescriptorBuilder usb(device::kJigProductId, "Motorised jig", "J600001");
//   usb.add_hid_interface();
//   UsbDescriptors descriptors = usb.take();
//
// Sources: USB 2.0, chapter 9; HID 1.11, section 6.2. Plain functions, safe from any thread.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "base/env.h"

namespace sixpoint::mocks {

enum class UsbSpeed : std::uint8_t { low = 1, full = 2, high = 3 };  // Linux' numbers

inline constexpr std::uint8_t kHidClass = 3;
inline constexpr std::uint8_t kStorageClass = 8;
inline constexpr std::uint16_t kUsEnglish = 0x0409;     // the one language of the strings
inline constexpr std::uint16_t kBulkPacketBytes = 512;  // high speed

// The number of two bytes at `at`, the low one first, as all of USB has them.
std::uint16_t little_endian(std::span<const std::uint8_t> bytes, std::size_t at);

// All as bytes on the wire, but the strings, which are text (UTF-8).
struct UsbDescriptors {
  UsbSpeed speed = UsbSpeed::high;
  Bytes device;                       // 18 bytes
  Bytes configuration;                // the one configuration, with all that belongs to it
  std::map<std::uint8_t, Bytes> hid;  // report descriptors, by interface
  std::map<std::uint8_t, std::string> strings;  // by index, from 1

  std::uint16_t vendor_id() const;
  std::uint16_t product_id() const;
  std::string string_at(std::uint8_t index) const;  // empty where there is none
  std::string serial() const;                       // the text of iSerialNumber
};

// A string descriptor; index 0 is the table of languages. Empty where there is no such string.
Bytes string_descriptor(const UsbDescriptors& descriptors, std::uint8_t index);

struct UsbEndpoint {
  enum class Type : std::uint8_t { control = 0, isochronous = 1, bulk = 2, interrupt = 3 };
  std::uint8_t address = 0;  // with 0x80 for IN
  Type type = Type::control;
  std::uint16_t max_packet = 0;
  std::uint8_t interface = 0;
};
struct UsbInterface {
  std::uint8_t number = 0;
  std::uint8_t device_class = 0;
  std::uint8_t subclass = 0;
  std::uint8_t protocol = 0;
  Bytes hid_descriptor;  // 9 bytes; empty where it is none
};
// What a configuration descriptor says. bad_data when its lengths contradict each other.
struct UsbConfiguration {
  std::uint8_t value = 0;
  std::uint8_t attributes = 0;
  std::vector<UsbInterface> interfaces;
  std::vector<UsbEndpoint> endpoints;

  const UsbEndpoint* endpoint(std::uint8_t address) const;    // null where there is none
  const UsbInterface* interface(std::uint16_t number) const;  // the same
};
Result<UsbConfiguration> parse_configuration(std::span<const std::uint8_t> bytes);

// Makes the descriptors of one of the project's devices (device/usb/usb_ids.h): one configuration,
// self powered, 100 mA to charge. Interfaces are numbered in the order of the calls.
class DescriptorBuilder {
 public:
  DescriptorBuilder(std::uint16_t product_id, std::string product, std::string serial);

  // One input and one output report of 64 bytes without an id, on a vendor's usage page, every
  // millisecond; the endpoints are kHidInEndpoint and kHidOutEndpoint.
  void add_hid_interface(const std::string& name = {});
  void add_bulk_interface(std::uint8_t device_class, std::uint8_t subclass, std::uint8_t protocol,
                          std::uint8_t in_endpoint, std::uint8_t out_endpoint,
                          const std::string& name);
  // Mass storage (SCSI, bulk only) at kStorageInEndpoint and kStorageOutEndpoint.
  void add_storage_interface();

  UsbDescriptors take();

 private:
  std::uint8_t add_string(const std::string& text);  // 0: none
  std::uint8_t begin_interface(std::uint8_t device_class, std::uint8_t subclass,
                               std::uint8_t protocol, const std::string& name);
  void add_endpoint(std::uint8_t address, UsbEndpoint::Type type, std::uint16_t max_packet,
                    std::uint8_t interval);

  UsbDescriptors usb_;
};

}  // namespace sixpoint::mocks
