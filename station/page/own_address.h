// By which address other machines reach this one, where the page listens on all of its addresses.
//
//   const std::string host = choose_address(addresses_of_machine(), /*with_v6=*/false);
//
// | an address of the machine                     | chosen                                      |
// |-----------------------------------------------|---------------------------------------------|
// | of an interface that is down, or of loopback  | never                                       |
// | IPv4                                          | the first                                   |
// | IPv6, of one link alone (fe80::)              | never: it needs the interface's name        |
// | IPv6                                          | the first, where `with_v6` and no IPv4 is   |
// | none of these                                 | 127.0.0.1: the page opens here at least     |
#pragma once

#include <span>
#include <string>
#include <vector>

namespace sixpoint::station {

struct MachineAddress {
  std::string address;  // as people write it, without brackets
  bool is_up = false;   // its interface
  bool is_loopback = false;
  bool is_v6 = false;
  bool is_of_one_link = false;
};

// In the order of the system. Empty where it does not say.
std::vector<MachineAddress> addresses_of_machine();

std::string choose_address(std::span<const MachineAddress> addresses, bool with_v6);

}  // namespace sixpoint::station
