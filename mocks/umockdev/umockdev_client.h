// Memory of a program that umockdev mocks a device for, and the nodes it opens.
//
// Internal to the umockdev carrier (umockdev_*.cpp).
#pragma once

#include <algorithm>
#include <cstring>
#include <memory>
#include <span>
#include <string>

#include <umockdev.h>

#include "base/env.h"

namespace sixpoint::mocks {

struct UmockdevUnref {
  void operator()(UMockdevIoctlData* data) const { umockdev_ioctl_data_unref(data); }
  void operator()(UMockdevIoctlClient* client) const { g_object_unref(client); }
};
using ClientData = std::unique_ptr<UMockdevIoctlData, UmockdevUnref>;
using ClientReference = std::unique_ptr<UMockdevIoctlClient, UmockdevUnref>;

// Memory of the client that `parent` points to at `offset`; null where it cannot be read.
inline ClientData resolve(UMockdevIoctlData* parent, std::size_t offset, std::size_t length) {
  GError* error = nullptr;
  ClientData data(umockdev_ioctl_data_resolve(parent, offset, length, &error));
  if (error != nullptr) {
    g_error_free(error);
  }
  return data;
}

inline void update(UMockdevIoctlData* data, std::size_t offset,
                   std::span<const std::uint8_t> bytes) {
  // The library copies; its signature only lacks the const.
  umockdev_ioctl_data_update(data, offset, const_cast<guint8*>(bytes.data()),
                             static_cast<gint>(bytes.size()));
}

inline std::span<const std::uint8_t> bytes_of(const UMockdevIoctlData* data) {
  return {data->data, static_cast<std::size_t>(std::max(data->data_len, 0))};
}

template <class Plain>
Plain read_as(const UMockdevIoctlData* data) {
  Plain value{};
  std::memcpy(&value, data->data, std::min(sizeof(value), bytes_of(data).size()));
  return value;
}

template <class Plain>
void write_as(UMockdevIoctlData* data, const Plain& value) {
  update(data, 0, {reinterpret_cast<const std::uint8_t*>(&value), sizeof(value)});
}

// A named pipe in place of a device node. umockdev answers reads, writes and ioctls, but poll()
// goes to the file itself: this class decides when it is ready.
class PollNode {
 public:
  // Ready means readable (hidraw) or writable (usbfs).
  PollNode(const std::string& path, bool ready_means_readable);
  ~PollNode();
  PollNode(const PollNode&) = delete;
  PollNode& operator=(const PollNode&) = delete;

  bool ok() const { return fd_ >= 0; }
  const std::string& path() const { return path_; }
  void set_ready(bool ready);

 private:
  std::string path_;
  bool readable_;
  int fd_ = -1;
  bool has_byte_ = false;
};

}  // namespace sixpoint::mocks
