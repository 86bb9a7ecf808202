#include "station/waiting_room.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <charconv>
#include <list>
#include <mutex>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

namespace sixpoint::station {

namespace {

using Clock = std::chrono::steady_clock;

struct Guest {
  int socket = -1;
  Clock::time_point until;
  std::string request;
  std::size_t whole_bytes = 0;  // 0: its head is not there yet
};

// What the head says of its body; 0 where it says nothing or nonsense, which the server refuses.
std::size_t announced_bytes(std::string_view head) {
  constexpr std::string_view kName = "\r\ncontent-length:";
  const auto found =
      std::search(head.begin(), head.end(), kName.begin(), kName.end(), [](char a, char b) {
        return (a >= 'A' && a <= 'Z' ? static_cast<char>(a - 'A' + 'a') : a) == b;
      });
  if (found == head.end()) {
    return 0;
  }
  std::string_view value = head.substr(static_cast<std::size_t>(found - head.begin()));
  value.remove_prefix(kName.size());
  value.remove_prefix(std::min(value.find_first_not_of(" \t"), value.size()));
  std::size_t bytes = 0;
  const auto read = std::from_chars(value.data(), value.data() + value.size(), bytes);
  return read.ec == std::errc() ? bytes : 0;
}

}  // namespace

struct WaitingRoom::Impl {
  Impl(const WaitingRoomOptions& its_options, Serve its_serve)
      : options(its_options), serve(std::move(its_serve)) {}

  void work();
  void let_in();
  // False when the guest has left the room, served or not.
  bool hear(Guest& guest);
  void wake() const {
    const std::uint64_t one = 1;
    static_cast<void>(!::write(bell, &one, sizeof(one)));
  }

  WaitingRoomOptions options;
  Serve serve;
  int bell = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  std::atomic<bool> stopping{false};
  std::mutex mutex;          // guards `arrived`
  std::vector<int> arrived;  // not yet seen by the thread
  std::list<Guest> guests;   // the thread's own, oldest first
  std::thread thread;
};

void WaitingRoom::Impl::let_in() {
  std::vector<int> sockets;
  {
    const std::lock_guard lock(mutex);
    sockets.swap(arrived);
  }
  for (const int socket : sockets) {
    guests.push_back({socket, Clock::now() + options.time_out, {}, 0});
  }
}

bool WaitingRoom::Impl::hear(Guest& guest) {
  std::array<char, 4096> some{};
  for (;;) {
    const ssize_t count = ::recv(guest.socket, some.data(), some.size(), MSG_DONTWAIT);
    if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) {
      return true;
    }
    if (count <= 0) {
      ::close(guest.socket);
      return false;
    }
    // Looked for in what is new, and the three letters before it.
    const std::size_t from = guest.request.size() < 3 ? 0 : guest.request.size() - 3;
    guest.request.append(some.data(), static_cast<std::size_t>(count));
    if (guest.whole_bytes == 0) {
      const std::size_t end = guest.request.find("\r\n\r\n", from);
      if (end != std::string::npos) {
        const std::size_t body = announced_bytes(std::string_view(guest.request).substr(0, end));
        guest.whole_bytes = end + 4 + (body <= options.most_body_bytes ? body : 0);
      } else if (guest.request.size() >= options.most_head_bytes) {
        guest.whole_bytes = guest.request.size();  // the answer says that it is too long
      }
    }
    if (guest.whole_bytes != 0 && guest.request.size() >= guest.whole_bytes) {
      serve(guest.socket, std::move(guest.request));
      return false;
    }
  }
}

void WaitingRoom::Impl::work() {
  std::vector<pollfd> sockets;
  while (!stopping) {
    let_in();
    const auto now = Clock::now();
    // All wait equally long, so the first to come is the first to go.
    while (!guests.empty() &&
           (guests.front().until <= now || guests.size() > options.most_connections)) {
      // It may have said everything in the meantime.
      if (hear(guests.front())) {
        ::close(guests.front().socket);
      }
      guests.pop_front();
    }
    sockets.assign(1, {bell, POLLIN, 0});
    for (const Guest& guest : guests) {
      sockets.push_back({guest.socket, POLLIN, 0});
    }
    const auto wait =
        guests.empty() ? std::chrono::milliseconds(1000)
                       : std::chrono::ceil<std::chrono::milliseconds>(guests.front().until - now);
    if (::poll(sockets.data(), sockets.size(), static_cast<int>(wait.count())) <= 0) {
      continue;
    }
    std::uint64_t rings = 0;
    static_cast<void>(!::read(bell, &rings, sizeof(rings)));
    auto socket = sockets.begin() + 1;
    for (auto guest = guests.begin(); guest != guests.end(); ++socket) {
      guest = socket->revents == 0 || hear(*guest) ? std::next(guest) : guests.erase(guest);
    }
  }
  let_in();
  for (const Guest& guest : guests) {
    ::close(guest.socket);
  }
  guests.clear();
}

WaitingRoom::WaitingRoom(const WaitingRoomOptions& options, Serve serve)
    : impl_(std::make_unique<Impl>(options, std::move(serve))) {
  impl_->thread = std::thread([this] { impl_->work(); });
}

WaitingRoom::~WaitingRoom() {
  stop();
  for (const int socket : impl_->arrived) {
    ::close(socket);
  }
  ::close(impl_->bell);
}

void WaitingRoom::enter(int socket) {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->arrived.push_back(socket);
  }
  impl_->wake();
}

void WaitingRoom::stop() {
  impl_->stopping = true;
  impl_->wake();
  if (impl_->thread.joinable()) {
    impl_->thread.join();
  }
}

}  // namespace sixpoint::station
