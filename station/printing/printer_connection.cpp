#include "station/printing/printer_connection.h"

#include <array>
#include <chrono>
#include <csignal>
#include <optional>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <fcntl.h>
#include <fmt/format.h>
#include <linux/sockios.h>
#include <poll.h>
#include <pthread.h>
#include <sys/ioctl.h>
#include <sys/stat.h>

namespace sixpoint::station {

namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using SystemError = boost::system::error_code;

constexpr std::chrono::milliseconds kSlice{50};  // between looks at the stop

// One label's way to the printer. Every step is asynchronous, so that a stop and the time-out are
// heard during each.
class Sending {
 public:
  Sending(const PrinterAddress& printer, const std::stop_token& stop, double time_out_s)
      : printer_(printer),
        stop_(stop),
        end_(std::chrono::steady_clock::now() +
             std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                 std::chrono::duration<double>(time_out_s))) {}

  Result<Sent> to_network(std::string_view zpl);
  Result<Sent> to_device(std::string_view zpl);

 private:
  // Runs what was begun to its end; an error where it failed or took too long.
  Status wait(const char* what) {
    while (!done_) {
      if (stop_.stop_requested()) {
        return fail_with("the program ends");
      }
      if (std::chrono::steady_clock::now() > end_) {
        return fail_with(fmt::format("it does not {} in time", what));
      }
      io_.restart();
      io_.run_one_for(kSlice);
    }
    const SystemError error = *std::exchange(done_, std::nullopt);
    if (error) {
      return fail_with(error.message());
    }
    return {};
  }
  tl::unexpected<Error> fail_with(const std::string& why) const {
    return fail(ErrorCode::device_unavailable, why, printer_.text(),
                "switch it on, and look at its paper and its cable");
  }
  auto step() {
    return [this](const SystemError& error, auto&&...) { done_ = error; };
  }
  Result<Sent> wait_until_taken(tcp::socket& socket);

  const PrinterAddress& printer_;
  const std::stop_token& stop_;
  const std::chrono::steady_clock::time_point end_;
  asio::io_context io_;
  std::optional<SystemError> done_;
};

Result<Sent> Sending::to_network(std::string_view zpl) {
  tcp::resolver resolver(io_);
  tcp::resolver::results_type found;
  resolver.async_resolve(printer_.host, std::to_string(printer_.port),
                         [&](const SystemError& error, const tcp::resolver::results_type& all) {
                           found = all;
                           done_ = error;
                         });
  SIXPOINT_CHECK(wait("get an address"));
  tcp::socket socket(io_);
  asio::async_connect(socket, found, step());
  SIXPOINT_CHECK(wait("answer"));
  asio::async_write(socket, asio::buffer(zpl), step());
  SIXPOINT_CHECK(wait("take the label"));
  SystemError error;
  socket.shutdown(tcp::socket::shutdown_send, error);
  if (error) {
    return fail_with(error.message());
  }
  return wait_until_taken(socket);
}

// A printer that closes with bytes unread resets the connection: the next read says so.
Result<Sent> Sending::wait_until_taken(tcp::socket& socket) {
  std::array<char, 256> answer{};
  socket.async_read_some(asio::buffer(answer), step());
  for (;;) {
    io_.restart();
    io_.run_one_for(kSlice);
    if (done_) {
      const SystemError error = *std::exchange(done_, std::nullopt);
      if (error == asio::error::eof) {
        return Sent::taken;
      }
      if (error) {
        return fail_with(error.message());
      }
      socket.async_read_some(asio::buffer(answer), step());
    }
    if (stop_.stop_requested() || std::chrono::steady_clock::now() > end_) {
      int unsent = 0;
      if (::ioctl(socket.native_handle(), SIOCOUTQ, &unsent) == 0 && unsent == 0) {
        return Sent::unconfirmed;
      }
      return fail_with(stop_.stop_requested() ? "the program ends"
                                              : "it does not take the label in time");
    }
  }
}

Result<Sent> Sending::to_device(std::string_view zpl) {
  const int fd = ::open(printer_.device.c_str(), O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
  if (fd < 0) {
    return fail_with(errno == ENXIO
                         ? "no program reads this pipe"
                         : SystemError(errno, boost::system::system_category()).message());
  }
  asio::posix::stream_descriptor device(io_);
  struct stat info {};
  if (::fstat(fd, &info) != 0 || !(S_ISCHR(info.st_mode) || S_ISFIFO(info.st_mode))) {
    ::close(fd);
    return fail_with("this is no printer, and labels would be written into it");
  }
  SystemError error;
  device.assign(fd, error);
  if (error) {
    ::close(fd);
    return fail_with(error.message());
  }
  asio::async_write(device, asio::buffer(zpl), step());
  SIXPOINT_CHECK(wait("take the label"));
  // poll() knows every device; the library's own wait refuses those that are always ready, as
  // /dev/null is.
  for (;;) {
    pollfd ready{fd, POLLOUT, 0};
    if (::poll(&ready, 1, static_cast<int>(kSlice.count())) < 0 && errno != EINTR) {
      return fail_with(SystemError(errno, boost::system::system_category()).message());
    }
    if ((ready.revents & (POLLERR | POLLHUP | POLLNVAL)) != 0) {
      return fail_with("it went away");
    }
    if ((ready.revents & POLLOUT) != 0) {
      return Sent::taken;
    }
    if (stop_.stop_requested() || std::chrono::steady_clock::now() > end_) {
      return fail_with(stop_.stop_requested() ? "the program ends"
                                              : "it does not take the label in time");
    }
  }
}

// While it lives, a reader that goes is an error of a write and no signal of this thread.
class NoBrokenPipe {
 public:
  NoBrokenPipe() {
    sigset_t pending;
    sigpending(&pending);
    was_pending_ = sigismember(&pending, SIGPIPE) == 1;
    sigemptyset(&broken_pipe_);
    sigaddset(&broken_pipe_, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &broken_pipe_, &before_);
  }
  NoBrokenPipe(const NoBrokenPipe&) = delete;
  NoBrokenPipe& operator=(const NoBrokenPipe&) = delete;
  ~NoBrokenPipe() {
    const timespec at_once{};
    if (!was_pending_) {
      sigtimedwait(&broken_pipe_, nullptr, &at_once);
    }
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }

 private:
  sigset_t broken_pipe_{};
  sigset_t before_{};
  bool was_pending_ = false;
};

}  // namespace

Result<Sent> send_label(const PrinterAddress& printer, std::string_view zpl,
                        const std::stop_token& stop, double time_out_s) {
  const NoBrokenPipe no_broken_pipe;
  Sending sending(printer, stop, time_out_s);
  return printer.device.empty() ? sending.to_network(zpl) : sending.to_device(zpl);
}

}  // namespace sixpoint::station
