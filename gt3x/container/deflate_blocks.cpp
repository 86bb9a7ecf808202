#include "gt3x/container/deflate_blocks.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace sixpoint::gt3x {
namespace {

constexpr std::size_t kMostCodeBits = 15;
constexpr std::size_t kEndOfBlock = 256;
constexpr std::size_t kMostLengthSymbols = 286;
constexpr std::size_t kMostDistanceSymbols = 30;

// Extra bits behind a symbol (RFC 1951, 3.2.5).
constexpr unsigned extra_bits_of_length(std::size_t symbol) {
  return symbol < 265 || symbol == 285 ? 0 : static_cast<unsigned>((symbol - 261) / 4);
}
constexpr unsigned extra_bits_of_distance(std::size_t symbol) {
  return symbol < 4 ? 0 : static_cast<unsigned>(symbol / 2 - 1);
}

// How many bits a code takes with its extra bits, and what comes behind it. One step may pass
// several literals and what follows them.
struct Step {
  enum class Kind : std::uint8_t { none, symbol, distance, end, longer };
  Kind kind = Kind::none;
  std::uint8_t bits = 0;
};

// The codes of one alphabet (RFC 1951, 3.2.2). Codes of up to `direct_bits` bits are looked up, the
// few longer ones are found bit by bit.
class Codes {
 public:
  static constexpr std::size_t kMostDirectBits = 13;

  explicit Codes(std::size_t direct_bits)
      : direct_bits_(direct_bits), direct_size_(std::size_t{1} << direct_bits) {}

  // False where the lengths make no prefix code. An incomplete one is taken: with one distance or
  // none it is legal, and what it leaves open is met as Kind::none.
  template <class StepOf>
  bool make(std::span<const std::uint8_t> lengths, StepOf step_of) {
    counts_.fill(0);
    for (const std::uint8_t length : lengths) {
      ++counts_[length];
    }
    counts_[0] = 0;
    std::array<std::uint32_t, kMostCodeBits + 2> next{};
    std::array<std::uint32_t, kMostCodeBits + 2> place{};
    for (std::size_t bits = 1; bits <= kMostCodeBits; ++bits) {
      next[bits + 1] = (next[bits] + counts_[bits]) << 1U;
      place[bits + 1] = place[bits] + counts_[bits];
      if (next[bits] + counts_[bits] > (1U << bits)) {
        return false;
      }
    }
    std::fill_n(direct_.begin(), direct_size_, Step{});
    for (std::size_t symbol = 0; symbol < lengths.size(); ++symbol) {
      const std::size_t length = lengths[symbol];
      if (length == 0) {
        continue;
      }
      const Step step = step_of(symbol, static_cast<unsigned>(length));
      const std::uint32_t code = reversed(next[length]++, length);
      sorted_[place[length]++] = step;
      if (length > direct_bits_) {
        direct_[code & (direct_size_ - 1)] = Step{Step::Kind::longer, 0};
        continue;
      }
      for (std::size_t at = code; at < direct_size_; at += std::size_t{1} << length) {
        direct_[at] = step;
        code_bits_[at] = static_cast<std::uint8_t>(length);
      }
    }
    return true;
  }

  // For an alphabet in which a literal is followed by a code of the same: one step passes as many
  // codes as lie whole within the bits that are looked up.
  void join_literals() {
    const std::array<Step, kMostDirect> single = direct_;
    for (std::size_t at = 0; at < direct_size_; ++at) {
      Step joined = single[at];
      std::size_t known = direct_bits_ - code_bits_[at];
      while (joined.kind == Step::Kind::symbol) {
        const std::size_t rest = at >> joined.bits;
        const Step next = single[rest];
        if (next.kind == Step::Kind::none || next.kind == Step::Kind::longer ||
            code_bits_[rest] > known) {
          break;
        }
        known -= code_bits_[rest];
        joined = {next.kind, static_cast<std::uint8_t>(joined.bits + next.bits)};
      }
      direct_[at] = joined;
    }
  }

  // `word`: the next bits of the stream, at least kMostCodeBits of them.
  Step step(std::uint64_t word) const {
    const Step found = direct_[word & (direct_size_ - 1)];
    return found.kind == Step::Kind::longer ? longer_step(word) : found;
  }

 private:
  static constexpr std::size_t kMostDirect = std::size_t{1} << kMostDirectBits;

  static std::uint32_t reversed(std::uint32_t code, std::size_t length) {
    std::uint32_t out = 0;
    for (std::size_t i = 0; i < length; ++i) {
      out |= ((code >> i) & 1U) << (length - 1 - i);
    }
    return out;
  }

  Step longer_step(std::uint64_t word) const {
    std::uint32_t code = 0;
    std::uint32_t first = 0;
    std::uint32_t place = 0;
    for (std::size_t bits = 1; bits <= kMostCodeBits; ++bits) {
      code = (code << 1U) | static_cast<std::uint32_t>((word >> (bits - 1)) & 1U);
      if (code >= first && code - first < counts_[bits]) {
        return sorted_[place + code - first];
      }
      place += counts_[bits];
      first = (first + counts_[bits]) << 1U;
    }
    return {};
  }

  std::array<std::uint16_t, kMostCodeBits + 1> counts_{};  // codes of each length
  std::array<Step, kMostLengthSymbols + 2> sorted_{};      // by length, then by symbol
  std::size_t direct_bits_;
  std::size_t direct_size_;
  std::array<Step, kMostDirect> direct_{};
  std::array<std::uint8_t, kMostDirect> code_bits_{};  // of the first code, without extra bits
};

class Walk {
 public:
  explicit Walk(std::span<const std::uint8_t> stream) : stream_(stream) {}

  std::optional<LastBlock> run() {
    for (;;) {
      LastBlock block;
      block.begin_bit = at_;
      const bool last = take(1) != 0;
      if (!pass_block(take(2)) || at_ > end()) {
        return std::nullopt;
      }
      if (last) {
        block.end_bit = at_;
        return block;
      }
    }
  }

 private:
  std::uint64_t end() const { return std::uint64_t{stream_.size()} * 8; }

  // The bits from at_ on, 57 at least; zeros behind the end.
  std::uint64_t word() const {
    const std::size_t byte = std::min<std::size_t>(at_ / 8, stream_.size());
    std::uint64_t bits = 0;
    if (stream_.size() - byte >= sizeof bits && std::endian::native == std::endian::little) {
      std::memcpy(&bits, stream_.data() + byte, sizeof bits);
    } else {
      for (std::size_t i = 0; i < sizeof bits && byte + i < stream_.size(); ++i) {
        bits |= std::uint64_t{stream_[byte + i]} << (8 * i);
      }
    }
    return bits >> (at_ % 8);
  }

  std::uint32_t take(unsigned count) {
    const std::uint64_t bits = word() & ((std::uint64_t{1} << count) - 1);
    at_ += count;
    return static_cast<std::uint32_t>(bits);
  }

  bool pass_block(std::uint32_t kind) {
    switch (kind) {
      case 0:
        return pass_stored();
      case 1:
        return make_fixed_codes() && pass_symbols();
      case 2:
        return read_codes() && pass_symbols();
      default:
        return false;
    }
  }

  bool pass_stored() {
    at_ = (at_ + 7) / 8 * 8;
    const std::uint32_t size = take(16);
    const std::uint32_t check = take(16);
    at_ += std::uint64_t{size} * 8;
    return (size ^ check) == 0xFFFF;
  }

  bool make_codes(std::span<const std::uint8_t> lengths, std::span<const std::uint8_t> distances) {
    const auto length_step = [](std::size_t symbol, unsigned bits) {
      const auto kind = symbol < kEndOfBlock    ? Step::Kind::symbol
                        : symbol == kEndOfBlock ? Step::Kind::end
                                                : Step::Kind::distance;
      return Step{kind, static_cast<std::uint8_t>(
                            bits + (symbol > kEndOfBlock ? extra_bits_of_length(symbol) : 0))};
    };
    const auto distance_step = [](std::size_t symbol, unsigned bits) {
      return Step{Step::Kind::symbol,
                  static_cast<std::uint8_t>(bits + extra_bits_of_distance(symbol))};
    };
    if (!lengths_.make(lengths, length_step) || !distances_.make(distances, distance_step)) {
      return false;
    }
    lengths_.join_literals();
    return true;
  }

  bool make_fixed_codes() {  // RFC 1951, 3.2.6
    std::array<std::uint8_t, kMostLengthSymbols + 2> lengths{};
    std::fill(lengths.begin(), lengths.begin() + 144, std::uint8_t{8});
    std::fill(lengths.begin() + 144, lengths.begin() + 256, std::uint8_t{9});
    std::fill(lengths.begin() + 256, lengths.begin() + 280, std::uint8_t{7});
    std::fill(lengths.begin() + 280, lengths.end(), std::uint8_t{8});
    std::array<std::uint8_t, kMostDistanceSymbols> distances{};
    distances.fill(5);
    return make_codes(lengths, distances);
  }

  bool read_codes() {  // RFC 1951, 3.2.7
    constexpr std::array<std::uint8_t, 19> kOrder = {16, 17, 18, 0, 8,  7, 9,  6, 10, 5,
                                                     11, 4,  12, 3, 13, 2, 14, 1, 15};
    const std::size_t length_count = take(5) + 257;
    const std::size_t distance_count = take(5) + 1;
    const std::size_t code_count = take(4) + 4;
    if (length_count > kMostLengthSymbols || distance_count > kMostDistanceSymbols) {
      return false;
    }
    std::array<std::uint8_t, kOrder.size()> code_lengths{};
    for (std::size_t i = 0; i < code_count; ++i) {
      code_lengths[kOrder[i]] = static_cast<std::uint8_t>(take(3));
    }
    std::array<std::uint8_t, kMostLengthSymbols + kMostDistanceSymbols> all{};
    if (!read_lengths(code_lengths, std::span(all).first(length_count + distance_count))) {
      return false;
    }
    return make_codes(std::span(all).first(length_count),
                      std::span(all).subspan(length_count, distance_count));
  }

  // The lengths of both alphabets, one behind the other, packed by `code_lengths`.
  bool read_lengths(std::span<const std::uint8_t> code_lengths, std::span<std::uint8_t> all) {
    constexpr unsigned kMostBits = 7;
    std::array<std::uint8_t, 1U << kMostBits> symbol_of{};
    std::array<std::uint8_t, 1U << kMostBits> bits_of{};
    std::uint32_t code = 0;
    for (unsigned bits = 1; bits <= kMostBits; ++bits, code <<= 1U) {
      for (std::size_t symbol = 0; symbol < code_lengths.size(); ++symbol) {
        if (code_lengths[symbol] != bits) {
          continue;
        }
        if (code >= (1U << bits)) {
          return false;
        }
        std::uint32_t turned = 0;
        for (unsigned i = 0; i < bits; ++i) {
          turned |= ((code >> i) & 1U) << (bits - 1 - i);
        }
        for (std::size_t at = turned; at < symbol_of.size(); at += std::size_t{1} << bits) {
          symbol_of[at] = static_cast<std::uint8_t>(symbol);
          bits_of[at] = static_cast<std::uint8_t>(bits);
        }
        ++code;
      }
    }
    for (std::size_t i = 0; i < all.size();) {
      const std::size_t at = word() & (symbol_of.size() - 1);
      const unsigned symbol = symbol_of[at];
      if (bits_of[at] == 0) {
        return false;
      }
      at_ += bits_of[at];
      if (symbol < 16) {
        all[i++] = static_cast<std::uint8_t>(symbol);
        continue;
      }
      if (symbol == 16 && i == 0) {
        return false;
      }
      const std::uint8_t repeated = symbol == 16 ? all[i - 1] : std::uint8_t{0};
      const std::size_t count = symbol == 16   ? 3 + take(2)
                                : symbol == 17 ? 3 + take(3)
                                               : 11 + take(7);
      if (count > all.size() - i) {
        return false;
      }
      std::fill_n(all.begin() + static_cast<std::ptrdiff_t>(i), count, repeated);
      i += count;
    }
    return true;
  }

  // Whether a code is a literal or a length cannot be foretold, so no branch depends on it.
  bool pass_symbols() {
    const Codes* codes = &lengths_;
    while (at_ < end()) {
      // 57 bits are there. A step among lengths takes 20 with its extra bits, a distance 28, one
      // follows the other.
      std::uint64_t bits = word();
      unsigned used = 0;
      for (int i = 0; i < 2; ++i) {
        const Step step = codes->step(bits);
        used += step.bits;
        bits >>= step.bits;
        if (step.kind == Step::Kind::end || step.kind == Step::Kind::none) {
          at_ += used;
          return step.kind == Step::Kind::end;
        }
        codes = step.kind == Step::Kind::distance ? &distances_ : &lengths_;
      }
      at_ += used;
    }
    return false;
  }

  std::span<const std::uint8_t> stream_;
  std::uint64_t at_ = 0;  // bit
  // Of lengths as many as the fastest cache holds: the more bits, the more literals in one step.
  Codes lengths_{Codes::kMostDirectBits};
  Codes distances_{9};
};

}  // namespace

std::optional<LastBlock> find_last_block(std::span<const std::uint8_t> stream) {
  return Walk(stream).run();
}

}  // namespace sixpoint::gt3x
