#include "mocks/usb/usb_descriptors.h"

#include <algorithm>

#include <linux/hid.h>
#include <linux/usb/ch9.h>

#include "device/usb/usb_ids.h"
#include "device/wire/protocol.h"

namespace sixpoint::mocks {

namespace {

const Bytes kHidReports = {
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

std::uint8_t low(std::size_t word) { return static_cast<std::uint8_t>(word & 0xFFU); }
std::uint8_t high(std::size_t word) { return static_cast<std::uint8_t>((word >> 8U) & 0xFFU); }

void append(Bytes& out, const Bytes& bytes) { out.insert(out.end(), bytes.begin(), bytes.end()); }

tl::unexpected<Error> bad_descriptor(const char* what) {
  return fail(ErrorCode::bad_data, what, "configuration descriptor",
              "report this as a defect of the device");
}

// UTF-8 to UTF-16LE; what is no UTF-8 becomes U+FFFD.
void append_utf16(Bytes& out, std::string_view text) {
  const auto put = [&out](std::uint32_t unit) {
    out.push_back(static_cast<std::uint8_t>(unit & 0xFFU));
    out.push_back(static_cast<std::uint8_t>((unit >> 8U) & 0xFFU));
  };
  for (std::size_t at = 0; at < text.size();) {
    const auto lead = static_cast<std::uint8_t>(text[at++]);
    std::size_t more = 0;
    std::uint32_t point = lead;
    if (lead >= 0xF0U) {
      more = 3;
      point = lead & 0x07U;
    } else if (lead >= 0xE0U) {
      more = 2;
      point = lead & 0x0FU;
    } else if (lead >= 0xC0U) {
      more = 1;
      point = lead & 0x1FU;
    } else if (lead >= 0x80U) {
      point = 0xFFFDU;
    }
    while (more-- > 0) {
      if (at == text.size() || (static_cast<std::uint8_t>(text[at]) & 0xC0U) != 0x80U) {
        point = 0xFFFDU;
        break;
      }
      point = (point << 6U) | (static_cast<std::uint8_t>(text[at++]) & 0x3FU);
    }
    if (point >= 0x10000U) {
      put(0xD800U + (((point - 0x10000U) >> 10U) & 0x3FFU));
      put(0xDC00U + (point & 0x3FFU));
    } else {
      put(point);
    }
  }
}

}  // namespace

std::uint16_t little_endian(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes[at] | (bytes[at + 1] << 8U));
}

std::uint16_t UsbDescriptors::vendor_id() const { return little_endian(device, 8); }
std::uint16_t UsbDescriptors::product_id() const { return little_endian(device, 10); }
std::string UsbDescriptors::string_at(std::uint8_t index) const {
  const auto found = strings.find(index);
  return found == strings.end() ? std::string() : found->second;
}
std::string UsbDescriptors::serial() const { return string_at(device[16]); }

Bytes string_descriptor(const UsbDescriptors& descriptors, std::uint8_t index) {
  Bytes bytes = {0, USB_DT_STRING};
  if (index == 0) {
    bytes.push_back(kUsEnglish & 0xFFU);
    bytes.push_back(kUsEnglish >> 8U);
  } else {
    const auto found = descriptors.strings.find(index);
    if (found == descriptors.strings.end()) {
      return {};
    }
    append_utf16(bytes, found->second);
    bytes.resize(std::min<std::size_t>(bytes.size(), 254));  // bLength is one byte
  }
  bytes[0] = static_cast<std::uint8_t>(bytes.size());
  return bytes;
}

const UsbEndpoint* UsbConfiguration::endpoint(std::uint8_t address) const {
  const auto found =
      std::find_if(endpoints.begin(), endpoints.end(),
                   [address](const UsbEndpoint& endpoint) { return endpoint.address == address; });
  return found == endpoints.end() ? nullptr : &*found;
}

const UsbInterface* UsbConfiguration::interface(std::uint16_t number) const {
  const auto found =
      std::find_if(interfaces.begin(), interfaces.end(),
                   [number](const UsbInterface& interface) { return interface.number == number; });
  return found == interfaces.end() ? nullptr : &*found;
}

Result<UsbConfiguration> parse_configuration(std::span<const std::uint8_t> bytes) {
  UsbConfiguration configuration;
  if (bytes.size() < 9 || bytes[0] < 9 || bytes[1] != USB_DT_CONFIG ||
      little_endian(bytes, 2) != bytes.size()) {
    return bad_descriptor("the total length is not that of the descriptor");
  }
  configuration.value = bytes[5];
  configuration.attributes = bytes[7];
  const std::size_t interfaces = bytes[4];
  for (auto rest = bytes.subspan(bytes[0]); !rest.empty(); rest = rest.subspan(rest[0])) {
    if (rest.size() < 2 || rest[0] < 2 || rest[0] > rest.size()) {
      return bad_descriptor("a descriptor is longer than the configuration");
    }
    if (rest[1] == USB_DT_INTERFACE && rest[0] >= 9) {
      configuration.interfaces.push_back({rest[2], rest[5], rest[6], rest[7], {}});
    } else if (configuration.interfaces.empty()) {
      return bad_descriptor("a descriptor stands before the first interface");
    } else if (rest[1] == USB_DT_ENDPOINT && rest[0] >= 7) {
      configuration.endpoints.push_back({rest[2], static_cast<UsbEndpoint::Type>(rest[3] & 3U),
                                         little_endian(rest, 4),
                                         configuration.interfaces.back().number});
    } else if (rest[1] == HID_DT_HID && rest[0] >= 9) {
      configuration.interfaces.back().hid_descriptor.assign(rest.begin(), rest.begin() + rest[0]);
    }
  }
  if (configuration.interfaces.size() != interfaces) {
    return bad_descriptor("the number of interfaces is not that of the descriptors");
  }
  return configuration;
}

DescriptorBuilder::DescriptorBuilder(std::uint16_t product_id, std::string product,
                                     std::string serial) {
  constexpr std::uint16_t kVendor = device::kUsbVendorId;
  usb_.strings = {{1, "Sixpoint"}, {2, std::move(product)}, {3, std::move(serial)}};
  usb_.device = {18,
                 USB_DT_DEVICE,
                 0x00,
                 0x02,  // USB 2.0
                 0,
                 0,
                 0,
                 64,  // packets of endpoint 0
                 low(kVendor),
                 high(kVendor),
                 low(product_id),
                 high(product_id),
                 0x00,
                 0x01,
                 1,
                 2,
                 3,
                 1};
  constexpr std::uint8_t kSelfPowered = 0xC0;
  usb_.configuration = {9, USB_DT_CONFIG, 0, 0, 0, 1, 0, kSelfPowered, 50};
}

std::uint8_t DescriptorBuilder::add_string(const std::string& text) {
  if (text.empty()) {
    return 0;
  }
  const auto index = static_cast<std::uint8_t>(usb_.strings.size() + 1);
  usb_.strings[index] = text;
  return index;
}

std::uint8_t DescriptorBuilder::begin_interface(std::uint8_t device_class, std::uint8_t subclass,
                                                std::uint8_t protocol, const std::string& name) {
  const std::uint8_t number = usb_.configuration[4]++;
  append(usb_.configuration,
         {9, USB_DT_INTERFACE, number, 0, 2, device_class, subclass, protocol, add_string(name)});
  return number;
}

void DescriptorBuilder::add_endpoint(std::uint8_t address, UsbEndpoint::Type type,
                                     std::uint16_t max_packet, std::uint8_t interval) {
  append(usb_.configuration, {7, USB_DT_ENDPOINT, address, static_cast<std::uint8_t>(type),
                              low(max_packet), high(max_packet), interval});
}

void DescriptorBuilder::add_hid_interface(const std::string& name) {
  const std::uint8_t number = begin_interface(kHidClass, 0, 0, name);
  append(usb_.configuration, {9, HID_DT_HID, 0x11, 0x01, 0, 1, HID_DT_REPORT,
                              low(kHidReports.size()), high(kHidReports.size())});
  usb_.hid[number] = kHidReports;
  constexpr std::uint8_t kMillisecond = 4;  // 2^(4-1) microframes
  for (const std::uint8_t address : {device::kHidInEndpoint, device::kHidOutEndpoint}) {
    add_endpoint(address, UsbEndpoint::Type::interrupt, device::kReportBytes, kMillisecond);
  }
}

void DescriptorBuilder::add_bulk_interface(std::uint8_t device_class, std::uint8_t subclass,
                                           std::uint8_t protocol, std::uint8_t in_endpoint,
                                           std::uint8_t out_endpoint, const std::string& name) {
  begin_interface(device_class, subclass, protocol, name);
  add_endpoint(in_endpoint, UsbEndpoint::Type::bulk, kBulkPacketBytes, 0);
  add_endpoint(out_endpoint, UsbEndpoint::Type::bulk, kBulkPacketBytes, 0);
}

void DescriptorBuilder::add_storage_interface() {
  constexpr std::uint8_t kScsi = 6;
  constexpr std::uint8_t kBulkOnly = 0x50;
  add_bulk_interface(kStorageClass, kScsi, kBulkOnly, device::kStorageInEndpoint,
                     device::kStorageOutEndpoint, "Recordings");
}

UsbDescriptors DescriptorBuilder::take() {
  usb_.configuration[2] = low(usb_.configuration.size());
  usb_.configuration[3] = high(usb_.configuration.size());
  return std::move(usb_);
}

}  // namespace sixpoint::mocks
