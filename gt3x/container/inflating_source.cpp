#include "gt3x/container/inflating_source.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>
#include <isa-l/crc.h>
#include <isa-l/igzip_lib.h>

#include "gt3x/container/piecewise_source.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::size_t kPackedPiece = std::size_t{256} * 1024;
// isa-l counts in 32 bits, and so does its CRC function.
constexpr std::size_t kLargestPiece = std::size_t{1} << 30;

class Inflate final : public ByteSource {
 public:
  explicit Inflate(std::unique_ptr<ByteSource> packed)
      : packed_(std::move(packed)), piece_(kPackedPiece), state_(new inflate_state) {
    isal_inflate_init(state_.get());
    state_->crc_flag = ISAL_DEFLATE;
  }

  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    const std::size_t wanted = std::min(out.size(), kLargestPiece);
    state_->next_out = out.data();
    state_->avail_out = static_cast<std::uint32_t>(wanted);
    while (state_->avail_out == wanted && state_->block_state != ISAL_BLOCK_FINISH) {
      if (state_->avail_in == 0 && !packed_ended_) {
        SIXPOINT_ASSIGN(const std::size_t count, packed_->read(piece_));
        state_->next_in = piece_.data();
        state_->avail_in = static_cast<std::uint32_t>(count);
        packed_ended_ = count == 0;
      }
      const bool had_input = state_->avail_in > 0;
      if (isal_inflate(state_.get()) != ISAL_DECOMP_OK) {
        return damaged("the packed data make no sense");
      }
      if (!had_input && packed_ended_ && state_->avail_out == wanted &&
          state_->block_state != ISAL_BLOCK_FINISH) {
        return damaged("the packed data end too early");
      }
    }
    return wanted - state_->avail_out;
  }

 private:
  static tl::unexpected<Error> damaged(const char* how) {
    return fail(ErrorCode::bad_data, how, {}, {});
  }

  std::unique_ptr<ByteSource> packed_;
  Bytes piece_;
  std::unique_ptr<inflate_state> state_;
  bool packed_ended_ = false;
};

// Counts and checks what passes.
class CheckedEntry final : public ByteSource {
 public:
  CheckedEntry(std::unique_ptr<ByteSource> bytes, const EntryFacts& facts)
      : bytes_(std::move(bytes)), facts_(facts) {}

  std::optional<std::uint64_t> size() const override { return facts_.size; }

  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    if (broken_) {
      return fail(*broken_);
    }
    auto count = bytes_->read(out.first(std::min(out.size(), kLargestPiece)));
    if (!count) {
      // The disk's own errors say where; those of the unpacking do not.
      if (!count.error().where.empty()) {
        broken_ = count.error();
        return fail(*broken_);
      }
      return damaged(count.error().what);
    }
    crc32_ = crc32_gzip_refl(crc32_, out.data(), *count);
    done_ += *count;
    if (done_ > facts_.size || (*count == 0 && done_ != facts_.size)) {
      return damaged(fmt::format("it should have {} bytes", facts_.size));
    }
    if (*count == 0 && crc32_ != facts_.crc32) {
      return damaged("its CRC does not hold");
    }
    return *count;
  }

 private:
  Result<std::size_t> damaged(const std::string& how) {
    broken_ = Error{ErrorCode::bad_data, "the entry is damaged: " + how, facts_.where,
                    "download the recording from the unit again, or fetch an undamaged copy"};
    return fail(*broken_);
  }

  std::unique_ptr<ByteSource> bytes_;
  EntryFacts facts_;
  std::uint64_t done_ = 0;
  std::uint32_t crc32_ = 0;
  std::optional<Error> broken_;
};

}  // namespace

std::unique_ptr<ByteSource> unpack_entry(std::unique_ptr<ByteSource> packed,
                                         const EntryFacts& facts) {
  if (facts.packing == Packing::deflate) {
    if (facts.points.packed_sizes.empty()) {
      packed = std::make_unique<Inflate>(std::move(packed));
    } else {
      packed = unpack_pieces(std::move(packed), facts.points, facts.size);
    }
  }
  return std::make_unique<CheckedEntry>(std::move(packed), facts);
}

}  // namespace sixpoint::gt3x
