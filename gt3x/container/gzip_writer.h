// A stream of bytes as a .gz file (RFC 1952), packed in pieces of 1 MiB on several threads.
//
//   GzipWriter gzip([&](std::span<const std::uint8_t> bytes) { return file.append(bytes); });
//   SIXPOINT_CHECK(gzip.append("1,0,0\r\n"));
//   SIXPOINT_CHECK(gzip.finish());
//
// The same bytes, however they are cut, give the same file, whatever the number of threads. One
// object belongs to one thread.
#pragma once

#include <string_view>

#include "gt3x/container/pack_line.h"

namespace sixpoint::gt3x {

class GzipWriter {
 public:
  explicit GzipWriter(PackLine::Sink sink, unsigned jobs = 1);

  Status append(std::string_view text);
  Status finish();

 private:
  Status begin();

  PackLine::Sink sink_;
  PackLine line_;
  Bytes piece_;
  bool begun_ = false;
  std::uint32_t crc32_ = 0;
  std::uint64_t size_ = 0;
};

}  // namespace sixpoint::gt3x
