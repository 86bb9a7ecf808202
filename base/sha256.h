// SHA-256 (FIPS 180-4), by OpenSSL's libcrypto: names a file, a capture or a row for good.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "base/result.h"

namespace sixpoint {

using Sha256Digest = std::array<std::uint8_t, 32>;

class Sha256 {
 public:
  Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;
  ~Sha256();
  void update(std::span<const std::uint8_t> bytes);
  void update(std::string_view text);
  Sha256Digest finish();  // and begins anew

 private:
  struct State;
  std::unique_ptr<State> state_;
};

Sha256Digest sha256(std::span<const std::uint8_t> bytes);
class FileSystem;
// Of a whole file, read piece by piece; in lower-case hex digits.
Result<std::string> file_sha256(FileSystem& files, const std::string& path);
std::string to_hex(std::span<const std::uint8_t> bytes);  // lower case

}  // namespace sixpoint
