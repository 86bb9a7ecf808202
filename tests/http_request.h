// A request to a server as the bytes that a test wrote, where an HTTP client would write others.
#pragma once

#include <algorithm>
#include <array>
#include <string>

#include <sys/socket.h>
#include <unistd.h>

namespace sixpoint::tests {

// What the server at `address` (sockaddr_in, sockaddr_un) sends until it closes, or until that
// holds `enough`; empty where it cannot be reached.
template <typename Address>
std::string answer_to(const Address& address, const std::string& request,
                      const std::string& enough = {}) {
  const auto& to = reinterpret_cast<const sockaddr&>(address);
  const int fd = ::socket(to.sa_family, SOCK_STREAM, 0);
  std::string answer;
  if (::connect(fd, &to, sizeof(address)) == 0 &&
      ::send(fd, request.data(), request.size(), MSG_NOSIGNAL) ==
          static_cast<ssize_t>(request.size())) {
    std::array<char, 4096> some{};
    for (ssize_t n = 1; n > 0 && (enough.empty() || answer.find(enough) == std::string::npos);) {
      n = ::recv(fd, some.data(), some.size(), 0);
      answer.append(some.data(), static_cast<std::size_t>(std::max<ssize_t>(n, 0)));
    }
  }
  ::close(fd);
  return answer;
}

}  // namespace sixpoint::tests
