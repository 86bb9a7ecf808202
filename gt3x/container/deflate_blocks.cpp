#include "gt3x/container/deflate_blocks.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <new>

#include <zlib.h>

namespace sixpoint::gt3x {
namespace {

// How far a match reaches back (RFC 1951, 2).
constexpr std::size_t kWindow = 32'768;
// libdeflate ends a block after 300,000 bytes, or 5,000 later where nothing but that would follow
// (its deflate_compress.c). A larger last block is found from the front.
constexpr std::size_t kMostUnpacked = 320 * std::size_t{1024};
// Fewer bytes of agreement prove nothing.
constexpr std::size_t kLeastUnpacked = 1024;
constexpr std::size_t kMostHeaderBits = 3 + 14 + 19 * 3;

// Of four lengths of 3 bits each: the share, in 128ths, of all words that codes of these lengths
// begin. A whole code has 128.
constexpr auto kSharesOfFour = [] {
  std::array<std::uint16_t, 4096> shares{};
  for (std::size_t four = 0; four < shares.size(); ++four) {
    for (unsigned i = 0; i < 4; ++i) {
      const std::size_t length = (four >> (3 * i)) & 7;
      shares[four] = static_cast<std::uint16_t>(shares[four] + (length > 0 ? 128U >> length : 0));
    }
  }
  return shares;
}();

// The bits from `at` on, 57 at least; zeros behind the end.
std::uint64_t bits_at(std::span<const std::uint8_t> stream, std::uint64_t at) {
  const std::size_t byte = std::min<std::size_t>(at / 8, stream.size());
  std::uint64_t bits = 0;
  if (stream.size() - byte >= sizeof bits && std::endian::native == std::endian::little) {
    std::memcpy(&bits, stream.data() + byte, sizeof bits);
  } else {
    for (std::size_t i = 0; i < sizeof bits && byte + i < stream.size(); ++i) {
      bits |= std::uint64_t{stream[byte + i]} << (8 * i);
    }
  }
  return bits >> (at % 8);
}

// Whether a last block with codes of its own could begin here, by the first 74 bits: `word` are
// those from here on. Of a thousand places that do not, one looks as if.
bool could_begin(std::span<const std::uint8_t> stream, std::uint64_t at, std::uint64_t word) {
  constexpr unsigned kMostCounted = 29;  // beyond the least number of lengths, of distances
  if (((word >> 3) & 31) > kMostCounted || ((word >> 8) & 31) > kMostCounted) {
    return false;
  }
  const unsigned lengths = static_cast<unsigned>((word >> 13) & 15) + 4;
  std::uint64_t rest = bits_at(stream, at + 17) & ((std::uint64_t{1} << (3 * lengths)) - 1);
  unsigned share = 0;
  for (; rest != 0; rest >>= 12U) {
    share += kSharesOfFour[rest & 4095];
  }
  return share == 128;
}

// What zlib says where it stopped.
struct Stop {
  std::uint64_t unused_bits;  // of the last byte taken
  bool in_last;               // the block is the last
  bool at_its_end;
};
Stop stop_of(const z_stream& zlib) {
  const auto said = static_cast<unsigned>(zlib.data_type);
  return {said & 63, (said & 64) != 0, (said & 128) != 0};
}

// zlib's inflate only reads what it is given, its interface is older than const.
Bytef* given(const std::uint8_t* bytes) { return const_cast<Bytef*>(bytes); }

}  // namespace

LastBlockFinder::LastBlockFinder() : zlib_(std::make_unique<z_stream>()), unpacked_(kMostUnpacked) {
  if (inflateInit2(zlib_.get(), -MAX_WBITS) != Z_OK) {
    throw std::bad_alloc();
  }
}

LastBlockFinder::~LastBlockFinder() { inflateEnd(zlib_.get()); }

// Sets zlib at `bit` and lets it read the header of a block.
bool LastBlockFinder::header_at(std::span<const std::uint8_t> stream, std::uint64_t bit) {
  inflateReset(zlib_.get());
  std::size_t byte = bit / 8;
  if (const int passed = static_cast<int>(bit % 8); passed > 0) {
    inflatePrime(zlib_.get(), 8 - passed, stream[byte++] >> passed);
  }
  zlib_->next_in = given(stream.data() + byte);
  zlib_->avail_in = static_cast<uInt>(stream.size() - byte);
  zlib_->next_out = unpacked_.data();
  zlib_->avail_out = static_cast<uInt>(unpacked_.size());
  return inflate(zlib_.get(), Z_TREES) == Z_OK;
}

// How many bytes the block has whose header was read, where it is the last and ends the stream.
std::optional<std::size_t> LastBlockFinder::unpack_rest(std::span<const std::uint8_t> before) {
  inflateSetDictionary(zlib_.get(), before.data(), static_cast<uInt>(before.size()));
  const int answer = inflate(zlib_.get(), Z_BLOCK);
  const Stop stop = stop_of(*zlib_);
  if (answer != Z_OK || !stop.in_last || !stop.at_its_end || zlib_->avail_in != 0) {
    return std::nullopt;
  }
  return unpacked_.size() - zlib_->avail_out;
}

std::optional<LastBlock> LastBlockFinder::block_at(std::span<const std::uint8_t> stream,
                                                   std::span<const std::uint8_t> bytes,
                                                   std::uint64_t bit) {
  // How many bytes does not depend on what lies before them, which is only known when their number
  // is.
  static constexpr std::array<std::uint8_t, kWindow> kAnything{};
  if (!header_at(stream, bit)) {
    return std::nullopt;
  }
  const auto size = unpack_rest(kAnything);
  if (!size || *size < kLeastUnpacked || *size > bytes.size()) {
    return std::nullopt;
  }
  const auto own = bytes.last(*size);
  const auto before = bytes.first(bytes.size() - *size);
  if (!header_at(stream, bit) ||
      unpack_rest(before.last(std::min(before.size(), kWindow))) != size ||
      !std::equal(own.begin(), own.end(), unpacked_.begin())) {
    return std::nullopt;
  }
  return LastBlock{bit, std::uint64_t{stream.size()} * 8 - stop_of(*zlib_).unused_bits};
}

std::optional<LastBlock> LastBlockFinder::from_the_end(std::span<const std::uint8_t> stream,
                                                       std::span<const std::uint8_t> bytes) {
  constexpr unsigned kAtOnce = 32;  // a header's first 17 bits lie behind each of them in a word
  const std::uint64_t end = std::uint64_t{stream.size()} * 8;
  // No block is larger packed than stored.
  const std::uint64_t most = std::uint64_t{kMostUnpacked} * 8 + kMostHeaderBits;
  const std::uint64_t least = end > most ? end - most : 0;
  for (std::uint64_t at = end / kAtOnce + 1; at-- > least / kAtOnce;) {
    const std::uint64_t word = bits_at(stream, at * kAtOnce);
    // 1: the last; 01: codes of its own, their second bit first.
    std::uint32_t begins = static_cast<std::uint32_t>(word & ~(word >> 1) & (word >> 2));
    while (begins != 0) {
      const unsigned bit = kAtOnce - 1 - static_cast<unsigned>(std::countl_zero(begins));
      begins ^= 1U << bit;
      if (could_begin(stream, at * kAtOnce + bit, word >> bit)) {
        if (const auto found = block_at(stream, bytes, at * kAtOnce + bit)) {
          return found;
        }
      }
    }
  }
  return std::nullopt;
}

std::optional<LastBlock> LastBlockFinder::from_the_front(std::span<const std::uint8_t> stream) {
  inflateReset(zlib_.get());
  zlib_->next_in = given(stream.data());
  zlib_->avail_in = static_cast<uInt>(stream.size());
  LastBlock block;
  for (;;) {
    zlib_->next_out = unpacked_.data();
    zlib_->avail_out = static_cast<uInt>(unpacked_.size());
    const int answer = inflate(zlib_.get(), Z_BLOCK);
    if (answer != Z_OK) {
      return std::nullopt;
    }
    const Stop stop = stop_of(*zlib_);
    if (!stop.at_its_end) {
      continue;
    }
    const std::uint64_t bit = std::uint64_t{zlib_->total_in} * 8 - stop.unused_bits;
    if (stop.in_last) {
      block.end_bit = bit;
      return (bit + 7) / 8 == stream.size() ? std::optional(block) : std::nullopt;
    }
    block.begin_bit = bit;
  }
}

std::optional<LastBlock> LastBlockFinder::find(std::span<const std::uint8_t> stream,
                                               std::span<const std::uint8_t> bytes) {
  const auto found = from_the_end(stream, bytes);
  return found ? found : from_the_front(stream);
}

}  // namespace sixpoint::gt3x
