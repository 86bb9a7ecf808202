#include "station/page/own_address.h"

#include <algorithm>
#include <array>
#include <memory>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace sixpoint::station {

std::vector<MachineAddress> addresses_of_machine() {
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) {
    return {};
  }
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> all(first, ::freeifaddrs);
  std::vector<MachineAddress> found;
  for (const ifaddrs* each = first; each != nullptr; each = each->ifa_next) {
    if (each->ifa_addr == nullptr) {
      continue;
    }
    MachineAddress one;
    one.is_up = (each->ifa_flags & IFF_UP) != 0;
    one.is_loopback = (each->ifa_flags & IFF_LOOPBACK) != 0;
    one.is_v6 = each->ifa_addr->sa_family == AF_INET6;
    const void* bytes = nullptr;
    if (one.is_v6) {
      const auto& v6 = reinterpret_cast<const sockaddr_in6*>(each->ifa_addr)->sin6_addr;
      one.is_of_one_link = IN6_IS_ADDR_LINKLOCAL(&v6);
      bytes = &v6;
    } else if (each->ifa_addr->sa_family == AF_INET) {
      bytes = &reinterpret_cast<const sockaddr_in*>(each->ifa_addr)->sin_addr;
    }
    std::array<char, INET6_ADDRSTRLEN> text{};
    if (bytes != nullptr && ::inet_ntop(each->ifa_addr->sa_family, bytes, text.data(),
                                        static_cast<socklen_t>(text.size())) != nullptr) {
      one.address = text.data();
      found.push_back(std::move(one));
    }
  }
  return found;
}

std::string choose_address(std::span<const MachineAddress> addresses, bool with_v6) {
  for (const bool is_v6 : {false, true}) {
    const auto found = std::ranges::find_if(addresses, [is_v6](const MachineAddress& one) {
      return one.is_up && !one.is_loopback && !one.is_of_one_link && one.is_v6 == is_v6;
    });
    if (found != addresses.end() && (with_v6 || !is_v6)) {
      return found->address;
    }
  }
  return "127.0.0.1";
}

}  // namespace sixpoint::station
