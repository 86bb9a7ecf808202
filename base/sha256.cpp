#include "base/sha256.h"

#include <algorithm>
#include <new>

#include <openssl/evp.h>

#include "base/env.h"

namespace sixpoint {

struct Sha256::State {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  State() {
    // libcrypto fails here only when memory is short.
    if (context == nullptr || EVP_DigestInit_ex(context, EVP_sha256(), nullptr) != 1) {
      EVP_MD_CTX_free(context);
      throw std::bad_alloc();
    }
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() { EVP_MD_CTX_free(context); }
};

Sha256::Sha256() : state_(std::make_unique<State>()) {}
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;
Sha256::~Sha256() = default;

void Sha256::update(std::span<const std::uint8_t> bytes) {
  EVP_DigestUpdate(state_->context, bytes.data(), bytes.size());
}

void Sha256::update(std::string_view text) {
  EVP_DigestUpdate(state_->context, text.data(), text.size());
}

Sha256Digest Sha256::finish() {
  Sha256Digest digest{};
  unsigned int size = 0;
  EVP_DigestFinal_ex(state_->context, digest.data(), &size);
  EVP_DigestInit_ex(state_->context, nullptr, nullptr);
  return digest;
}

Sha256Digest sha256(std::span<const std::uint8_t> bytes) {
  Sha256 hash;
  hash.update(bytes);
  return hash.finish();
}

std::string text_sha256(std::string_view text) { return to_hex(sha256(as_bytes(text))); }

Result<Sha256Digest> file_digest(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(const auto file, files.open(path));
  Sha256 hash;
  // No more than the file has: clearing a MiB would cost more than hashing a small file.
  Bytes piece(std::clamp<std::uint64_t>(file->size(), 1, 1U << 20));
  std::uint64_t at = 0;
  while (true) {
    SIXPOINT_ASSIGN(const auto count, file->read_at(at, piece));
    if (count == 0) {
      return hash.finish();
    }
    hash.update(std::span(piece).first(count));
    at += count;
  }
}

Result<std::string> file_sha256(FileSystem& files, const std::string& path) {
  return file_digest(files, path).map([](const Sha256Digest& digest) { return to_hex(digest); });
}

}  // namespace sixpoint
