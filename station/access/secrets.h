// Secrets: made, compared, and told apart from made-up ones.
//
//   const std::string token = random_hex(16);                       // 32 digits, 128 random bits
//   const std::string seal = keyed_hash(token, "a text to be known again");
//   const bool same = same_secret(seal, keyed_hash(token, "a text to be known again"));
//
// By OpenSSL's libcrypto. All functions may be called from any thread.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sixpoint::station {

// Lower-case hex digits of so many random bytes, from the operating system's generator.
std::string random_hex(std::size_t bytes);
// A random code that people can type: "K7QF-2M9X-TTWD", 60 random bits, no letter that looks like a
// digit.
std::string random_code();
// HMAC-SHA-256 (RFC 2104), lower-case hex digits.
std::string keyed_hash(std::string_view key, std::string_view text);
// scrypt (RFC 7914; N 2^15, r 8, p 1: 32 MiB and a tenth of a second) of a PIN, hex digits.
std::string pin_hash(std::string_view pin, std::string_view salt);
// Compares in a time that does not depend on where two texts differ.
bool same_secret(std::string_view a, std::string_view b);

}  // namespace sixpoint::station
