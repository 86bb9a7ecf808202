#include "mocks/umockdev/umockdev_client.h"

#include <filesystem>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace sixpoint::mocks {

PollNode::PollNode(const std::string& path, bool ready_means_readable)
    : path_(path), readable_(ready_means_readable) {
  std::error_code ignored;
  std::filesystem::create_directories(std::filesystem::path(path).parent_path(), ignored);
  ::unlink(path.c_str());
  if (::mkfifo(path.c_str(), 0600) == 0) {
    fd_ = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  }
  if (fd_ >= 0) {
    // One page is one slot: a single byte fills it, and poll() answers "not writable".
    ::fcntl(fd_, F_SETPIPE_SZ, 4096);
    set_ready(false);
  }
}

PollNode::~PollNode() {
  if (fd_ >= 0) {
    ::close(fd_);
  }
  ::unlink(path_.c_str());
}

void PollNode::set_ready(bool ready) {
  const bool byte = ready == readable_;
  if (byte == has_byte_) {
    return;
  }
  std::uint8_t one = 0;
  const ssize_t count = byte ? ::write(fd_, &one, 1) : ::read(fd_, &one, 1);
  has_byte_ = count == 1 ? byte : has_byte_;
}

}  // namespace sixpoint::mocks
