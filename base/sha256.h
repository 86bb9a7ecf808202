// SHA-256 (FIPS 180-4), by OpenSSL's libcrypto (sha256.cpp alone uses it).
//
//   text_sha256("abc");  // "ba7816bf..."
//   SIXPOINT_ASSIGN(const std::string file_hash, file_sha256(env.files, path));
//   Sha256 hash;
//   hash.update("a");
//   hash.update("bc");
//   to_hex(hash.finish());  // the same as the first
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "base/bytes.h"
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
// Of a text, in lower-case hex digits.
std::string text_sha256(std::string_view text);
class FileSystem;
// Of a whole file, read piece by piece; in lower-case hex digits.
Result<Sha256Digest> file_digest(FileSystem& files, const std::string& path);
Result<std::string> file_sha256(FileSystem& files, const std::string& path);

}  // namespace sixpoint
