// A device as udev finds it in sysfs.
#include <fmt/format.h>

#include "mocks/umockdev/umockdev_port.h"

namespace sixpoint::mocks {

namespace {

std::string hex(std::span<const std::uint8_t> bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text += fmt::format("{:02X}", byte);
  }
  return text;
}

}  // namespace

// As `udevadm info` names attributes. Without "N:" lines: they would make plain files of the nodes.
std::string UmockdevPort::describe(const std::string& path) {
  const UsbDescriptors& d = device_->descriptors();
  const PluggedNodes& nodes = nodes_;
  const std::string ids = fmt::format("{:04X}:{:04X}", d.vendor_id(), d.product_id());
  Bytes descriptors = d.device;
  descriptors.insert(descriptors.end(), d.configuration.begin(), d.configuration.end());
  const int speed_mbps = d.speed == UsbSpeed::high ? 480 : 12;

  std::string text = fmt::format(
      "P: {}\nE: DEVNAME={}\nE: DEVTYPE=usb_device\nE: DRIVER=usb\nE: SUBSYSTEM=usb\n"
      "E: BUSNUM={:03}\nE: DEVNUM={:03}\nE: MAJOR=189\nE: MINOR={}\nE: PRODUCT={:x}/{:x}/100\n"
      "A: busnum={}\nA: devnum={}\nA: idVendor={:04x}\nA: idProduct={:04x}\nA: speed={}\n"
      "A: bConfigurationValue={}\nA: bNumConfigurations=1\nA: bNumInterfaces={:2}\n"
      "A: bDeviceClass={:02x}\nA: manufacturer={}\nA: product={}\nA: serial={}\n"
      "H: descriptors={}\n\n",
      path, nodes.usb_node, nodes.bus, nodes.address, nodes.address - 1, d.vendor_id(),
      d.product_id(), nodes.bus, nodes.address, d.vendor_id(), d.product_id(), speed_mbps,
      configuration_.value, configuration_.interfaces.size(), d.device[4],
      d.string_at(d.device[14]), d.string_at(d.device[15]), d.serial(), hex(descriptors));
  paths_.push_back(path);
  for (const UsbInterface& interface : configuration_.interfaces) {
    const std::string child =
        fmt::format("{}/{}:{}.{}", path, nodes.port, configuration_.value, interface.number);
    const auto driver = drivers_.find(interface.number);
    text += fmt::format(
        "P: {}\nE: DEVTYPE=usb_interface\nE: SUBSYSTEM=usb\n{}"
        "A: bInterfaceNumber={:02x}\nA: bInterfaceClass={:02x}\nA: bInterfaceSubClass={:02x}\n"
        "A: bInterfaceProtocol={:02x}\nA: bAlternateSetting= 0\n\n",
        child, driver == drivers_.end() ? "" : fmt::format("E: DRIVER={}\n", driver->second),
        interface.number, interface.device_class, interface.subclass, interface.protocol);
    paths_.push_back(child);
    if (nodes.hidraw_node.empty() || interface.number != *hid_interface_) {
      continue;
    }
    const std::string hid = fmt::format("{}/0003:{}.{:04X}", child, ids, nodes.address);
    const std::string raw = fmt::format("{}/hidraw/{}", hid, nodes.hidraw_node.substr(5));
    text += fmt::format(
        "P: {}\nE: SUBSYSTEM=hid\nE: DRIVER=hid-generic\nE: HID_ID=0003:0000{:04X}:0000{:04X}\n"
        "E: HID_NAME={} {}\nE: HID_PHYS=usb-{}/input0\nE: HID_UNIQ={}\nH: report_descriptor={}\n\n",
        hid, d.vendor_id(), d.product_id(), d.string_at(d.device[14]), d.string_at(d.device[15]),
        nodes.port, d.serial(), hex(d.hid.at(interface.number)));
    text += fmt::format(
        "P: {}\nE: DEVNAME={}\nE: SUBSYSTEM=hidraw\nE: MAJOR=241\nE: MINOR={}\n"
        "L: device=../../../0003:{}.{:04X}\n\n",
        raw, nodes.hidraw_node, nodes.hidraw_node.substr(11), ids, nodes.address);
    paths_.push_back(hid);
    paths_.push_back(raw);
  }
  return text;
}

}  // namespace sixpoint::mocks
