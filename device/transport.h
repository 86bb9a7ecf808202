// Bytes to and from one endpoint pair, and the list of ways to reach a device.
//
//   device::TransportRegistry links;
//   mocks::register_virtual(links);  // mocks/in_process/in_process.h
//   Result<device::Link> link = links.open("virtual:seed=7", env);
//
// A device is named by an address "SCHEME:REST": hid:SERIAL, usb:SERIAL, virtual:seed=7,
// replay:session.zip. Each scheme is one function that opens such an address. The program fills a
// TransportRegistry once.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/env.h"
#include "device/jig.h"
#include "device/scheme_table.h"

namespace sixpoint::device {

// One thread at a time, except cancel(). Time-outs are measured on the link's clock.
class Transport {
 public:
  virtual ~Transport() = default;
  // All of `bytes` or an error: device_unavailable when the device is gone, io when it did not take
  // them in time.
  virtual Status write(std::span<const std::uint8_t> bytes, std::chrono::nanoseconds time_out) = 0;
  // One report or one bulk transfer. 0: nothing came in time. `out` must hold what the endpoint may
  // send (kReportBytes, kBulkBlockBytes); longer transfers are bad_data.
  virtual Result<std::size_t> read(std::span<std::uint8_t> out,
                                   std::chrono::nanoseconds time_out) = 0;
  // Ends a read or write that waits in another thread; it answers device_unavailable.
  virtual void cancel() = 0;
};

// An open device: its channels and its clock.
struct Link {
  std::string address;                 // the string it was opened by
  std::unique_ptr<Transport> reports;  // never null
  std::unique_ptr<Transport> bulk;     // null when the device has no such interface
  // Time-outs and waits use this clock and no other. It is the machine's for hardware; a unit in
  // software brings its own, on which a minute passes at once. Never null.
  std::shared_ptr<Clock> clock;
  // The serial number that the device gave outside of the protocol (USB descriptor); empty where
  // there is none. WireUnit::open() refuses a unit that answers another one.
  std::string serial = {};
  // Opens the same address again after the device went away; it may be another unit then.
  // TransportRegistry::open() sets it where the opener did not.
  std::function<Result<Link>()> reopen = {};
  std::unique_ptr<Jig> jig;  // a jig that is part of the device (virtual units); mostly null
};

// Wraps a clock that outlives all links (the Env's) for Link::clock.
std::shared_ptr<Clock> borrow_clock(Clock& clock);

// What is said of an address that no registry knows.
tl::unexpected<Error> no_device(std::string_view address, const std::vector<std::string>& examples);

class TransportRegistry {
 public:
  using Opener = std::function<Result<Link>(std::string_view rest, Env& env)>;

  // Replaces an opener of the same scheme. `example` is shown to people.
  void add(std::string scheme, std::string example, Opener opener) {
    openers_.add(std::move(scheme), std::move(example), std::move(opener));
  }
  // usage when the string has no known scheme or its rest is malformed; device_unavailable,
  // permission or no_input when it cannot be reached. `env` outlives the link.
  Result<Link> open(std::string_view address, Env& env) const;
  std::vector<std::string> examples() const { return openers_.examples(); }
  bool knows(std::string_view address) const { return openers_.find(address).has_value(); }

 private:
  SchemeTable<Opener> openers_;
};

}  // namespace sixpoint::device
