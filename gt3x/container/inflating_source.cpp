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
constexpr std::size_t kLargestRead = std::size_t{1} << 30;

class Inflate final : public ByteSource {
 public:
  // `packed_size` may be wrong; 0 where nothing says it.
  Inflate(std::unique_ptr<ByteSource> packed, std::uint64_t packed_size)
      : packed_(std::move(packed)),
        piece_(packed_size == 0
                   ? kPackedPiece
                   : static_cast<std::size_t>(std::min<std::uint64_t>(packed_size, kPackedPiece))),
        state_(new inflate_state) {
    isal_inflate_init(state_.get());
    state_->crc_flag = ISAL_DEFLATE;
  }

  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    if (broken_ != nullptr) {
      return fail(ErrorCode::bad_data, broken_, {}, {});
    }
    const std::size_t wanted = std::min(out.size(), kLargestRead);
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
        return broken("the packed data make no sense", wanted);
      }
      if (!had_input && packed_ended_ && state_->avail_out == wanted &&
          state_->block_state != ISAL_BLOCK_FINISH) {
        return broken("the packed data end too early", wanted);
      }
    }
    return wanted - state_->avail_out;
  }

 private:
  // What was unpacked before the break comes out first.
  Result<std::size_t> broken(const char* how, std::size_t wanted) {
    broken_ = how;
    const std::size_t before = wanted - state_->avail_out;
    return before > 0 ? Result<std::size_t>(before) : fail(ErrorCode::bad_data, how, {}, {});
  }

  std::unique_ptr<ByteSource> packed_;
  Bytes piece_;
  std::unique_ptr<inflate_state> state_;
  bool packed_ended_ = false;
  const char* broken_ = nullptr;
};

// What is left of an entry with an index: of a damaged piece what comes before its damage, and all
// of the pieces behind it. Ends in an error where anything was lost.
class SalvagedPieces final : public ByteSource {
 public:
  SalvagedPieces(std::unique_ptr<ByteSource> packed, SyncPoints points, std::uint64_t size)
      : packed_(std::move(packed)), points_(std::move(points)), left_(size) {}

  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    while (taken_ == piece_.size()) {
      if (next_ == points_.packed_sizes.size()) {
        return lost_ == 0 ? Result<std::size_t>(std::size_t{0})
                          : fail(ErrorCode::bad_data,
                                 fmt::format("{} of its {} pieces make no sense from a place on",
                                             lost_, points_.packed_sizes.size()));
      }
      SIXPOINT_CHECK(take_next());
    }
    const std::size_t count = std::min(out.size(), piece_.size() - taken_);
    std::copy_n(piece_.begin() + static_cast<std::ptrdiff_t>(taken_), count, out.begin());
    taken_ += count;
    return count;
  }

 private:
  Status take_next() {
    Bytes packed(points_.packed_sizes[next_]);
    std::size_t filled = 0;
    while (filled < packed.size()) {
      SIXPOINT_ASSIGN(const std::size_t more, packed_->read(std::span(packed).subspan(filled)));
      if (more == 0) {
        break;
      }
      filled += more;
    }
    packed.resize(filled);
    piece_.resize(std::min<std::uint64_t>(points_.piece_size, left_));
    left_ -= piece_.size();
    taken_ = 0;
    const bool last = ++next_ == points_.packed_sizes.size();
    Bytes whole = packed;
    if (!unpack_piece(whole, last ? PiecePacker::Place::last : PiecePacker::Place::inner, piece_)) {
      ++lost_;
      piece_.resize(before_damage(std::move(packed)));
    }
    return {};
  }

  // Fills piece_ up to the damage; how many bytes.
  std::size_t before_damage(Bytes packed) {
    const std::uint64_t size = packed.size();
    Inflate bytes(std::make_unique<MemorySource>(std::move(packed)), size);
    std::size_t done = 0;
    while (done < piece_.size()) {
      const auto count = bytes.read(std::span(piece_).subspan(done));
      if (!count || *count == 0) {
        break;
      }
      done += *count;
    }
    return done;
  }

  std::unique_ptr<ByteSource> packed_;
  SyncPoints points_;
  std::uint64_t left_;    // bytes of the pieces behind piece_
  std::size_t next_ = 0;  // piece
  std::size_t lost_ = 0;  // pieces, or their ends
  Bytes piece_;
  std::size_t taken_ = 0;  // of it
};

// Counts and checks what passes.
class CheckedEntry final : public ByteSource {
 public:
  CheckedEntry(std::unique_ptr<ByteSource> bytes, const EntryFacts& facts)
      : bytes_(std::move(bytes)), facts_(facts) {}

  std::optional<std::uint64_t> size() const override {
    return facts_.size_known ? std::optional(facts_.size) : std::nullopt;
  }

  // From now on what is left is delivered, and its damage told.
  void salvage(const ArchiveLimits& limits, std::function<void(const EntryDamage&)> note) {
    limits_ = limits;
    note_ = std::move(note);
  }

  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    if (broken_) {
      return fail(*broken_);
    }
    if (ended_) {
      return std::size_t{0};
    }
    auto count = bytes_->read(out.first(std::min(out.size(), kLargestRead)));
    if (!count) {
      // The disk's own errors say where; those of the unpacking do not.
      if (!count.error().where.empty()) {
        broken_ = count.error();
        return fail(*broken_);
      }
      return damaged(Damage::broken_stream, count.error().what);
    }
    if (facts_.size_known && *count > facts_.size - done_) {
      const auto too_long = static_cast<std::size_t>(facts_.size - done_);
      done_ = facts_.size;
      return damaged(Damage::wrong_length, size_text(), too_long);
    }
    crc32_ = crc32_gzip_refl(crc32_, out.data(), *count);
    done_ += *count;
    if (!facts_.size_known && !limits_.allow(done_, facts_.packed_size)) {
      return damaged(Damage::refused, "it has more bytes than a recording can have");
    }
    return *count > 0 ? *count : end();
  }

 private:
  std::string size_text() const { return fmt::format("it should have {} bytes", facts_.size); }

  Result<std::size_t> end() {
    if (facts_.size_known && done_ != facts_.size) {
      return damaged(Damage::wrong_length, size_text());
    }
    if (!facts_.crc_known) {
      return damaged(Damage::no_crc, "nothing says which CRC it should have");
    }
    if (crc32_ != facts_.crc32) {
      return damaged(Damage::wrong_crc, "its CRC does not hold");
    }
    ended_ = true;
    return std::size_t{0};
  }

  // The error, or the end: `last` bytes more, and what was wrong told.
  Result<std::size_t> damaged(Damage kind, const std::string& how, std::size_t last = 0) {
    if (what_may_be_delivered(kind, note_ != nullptr) == Delivery::nothing) {
      broken_ = Error{ErrorCode::bad_data, "the entry is damaged: " + how, facts_.where,
                      hint_about(kind)};
      return fail(*broken_);
    }
    ended_ = true;
    note_({kind, done_, how});
    return last;
  }

  std::unique_ptr<ByteSource> bytes_;
  EntryFacts facts_;
  ArchiveLimits limits_;
  std::function<void(const EntryDamage&)> note_;
  std::uint64_t done_ = 0;
  std::uint32_t crc32_ = 0;
  bool ended_ = false;
  std::optional<Error> broken_;
};

}  // namespace

std::unique_ptr<ByteSource> unpack_entry(std::unique_ptr<ByteSource> packed,
                                         const EntryFacts& facts) {
  if (facts.packing == Packing::deflate) {
    if (facts.points.packed_sizes.empty()) {
      packed = std::make_unique<Inflate>(std::move(packed), facts.packed_size);
    } else {
      packed = unpack_pieces(std::move(packed), facts.points, facts.size);
    }
  }
  return std::make_unique<CheckedEntry>(std::move(packed), facts);
}

std::unique_ptr<ByteSource> salvage_entry(std::unique_ptr<ByteSource> packed,
                                          const EntryFacts& facts, const ArchiveLimits& limits,
                                          std::function<void(const EntryDamage&)> note) {
  if (facts.packing == Packing::deflate && facts.points.packed_sizes.empty()) {
    packed = std::make_unique<Inflate>(std::move(packed), facts.packed_size);
  } else if (facts.packing == Packing::deflate) {
    packed = std::make_unique<SalvagedPieces>(std::move(packed), facts.points, facts.size);
  }
  auto entry = std::make_unique<CheckedEntry>(std::move(packed), facts);
  entry->salvage(limits, std::move(note));
  return entry;
}

}  // namespace sixpoint::gt3x
