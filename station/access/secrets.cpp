#include "station/access/secrets.h"

#include <array>
#include <cstdint>
#include <new>
#include <stdexcept>
#include <vector>

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <openssl/rand.h>

namespace sixpoint::station {

namespace {

std::vector<unsigned char> random_bytes(std::size_t count) {
  std::vector<unsigned char> bytes(count);
  // It fails only where the operating system gives no random numbers: nothing can be secret then.
  if (RAND_bytes(bytes.data(), static_cast<int>(count)) != 1) {
    throw std::runtime_error("the operating system gives no random numbers");
  }
  return bytes;
}

template <class Bytes>
std::string hex_of(const Bytes& bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const unsigned char byte : bytes) {
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 15U];
  }
  return text;
}

}  // namespace

std::string random_hex(std::size_t bytes) { return hex_of(random_bytes(bytes)); }

std::string random_code() {
  constexpr std::string_view kLetters = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ";  // 32: five bits each
  std::string code;
  for (const unsigned char byte : random_bytes(12)) {
    if (code.size() == 4 || code.size() == 9) {
      code += '-';
    }
    code += kLetters[byte & 31U];
  }
  return code;
}

std::string keyed_hash(std::string_view key, std::string_view text) {
  std::array<unsigned char, 32> digest{};
  unsigned size = digest.size();
  // It fails only when memory is short.
  if (HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()),
           reinterpret_cast<const unsigned char*>(text.data()), text.size(), digest.data(),
           &size) == nullptr) {
    throw std::bad_alloc();
  }
  return hex_of(digest);
}

std::string pin_hash(std::string_view pin, std::string_view salt) {
  constexpr std::uint64_t kCost = 1U << 15U;
  constexpr std::uint64_t kMostMemory_bytes = 64U << 20U;
  std::array<unsigned char, 32> key{};
  if (EVP_PBE_scrypt(pin.data(), pin.size(), reinterpret_cast<const unsigned char*>(salt.data()),
                     salt.size(), kCost, 8, 1, kMostMemory_bytes, key.data(), key.size()) != 1) {
    throw std::bad_alloc();
  }
  return hex_of(key);
}

bool same_secret(std::string_view a, std::string_view b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace sixpoint::station
