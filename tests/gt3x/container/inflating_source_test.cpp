#include "gt3x/container/inflating_source.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include "base/random.h"
#include "expect_result.h"
#include "gt3x/container/piece_packer.h"

namespace sixpoint::gt3x {
namespace {

// Oracle: zlib, another implementation, packs and computes the CRC.
Bytes deflated(const Bytes& bytes, int level, int strategy) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, level, Z_DEFLATED, -15, 9, strategy), Z_OK);
  Bytes packed(deflateBound(&stream, bytes.size()) + 100);
  stream.next_in = const_cast<Bytef*>(bytes.data());  // NOLINT: zlib's interface
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = packed.data();
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

EntryFacts facts_of(const Bytes& bytes) {
  EntryFacts facts;
  facts.packing = Packing::deflate;
  facts.size = bytes.size();
  facts.crc32 = static_cast<std::uint32_t>(crc32(0, bytes.data(), static_cast<uInt>(bytes.size())));
  facts.where = "f:log.bin";
  return facts;
}

Result<Bytes> unpacked(const Bytes& packed, const EntryFacts& facts, std::size_t piece_size) {
  const auto source = unpack_entry(std::make_unique<MemorySource>(packed), facts);
  EXPECT_EQ(source->size(), facts.size);
  Bytes all;
  Bytes piece(piece_size);
  for (;;) {
    SIXPOINT_ASSIGN(const std::size_t count, source->read(piece));
    if (count == 0) {
      return all;
    }
    all.insert(all.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(count));
  }
}

Bytes some_bytes(std::size_t size, int kinds) {
  Random random(size);
  Bytes bytes(size);
  for (auto& byte : bytes) {
    byte = static_cast<std::uint8_t>(random.below(static_cast<std::uint64_t>(kinds)));
  }
  return bytes;
}

TEST(InflatingSource, ReadsWhatZlibPackedInPiecesOfEverySize) {
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{1}, std::size_t{70'000}, std::size_t{1'000'000}}) {
    for (const int kinds : {1, 5, 256}) {
      const Bytes bytes = some_bytes(size, kinds);
      for (const int strategy : {Z_DEFAULT_STRATEGY, Z_FIXED, Z_HUFFMAN_ONLY}) {
        for (const int level : {0, 1, 6, 9}) {
          const Bytes packed = deflated(bytes, level, strategy);
          const auto whole = unpacked(packed, facts_of(bytes), 1U << 20);
          ASSERT_OK(whole);
          ASSERT_EQ(*whole, bytes) << size << " " << kinds << " " << strategy << " " << level;
        }
      }
      for (const std::size_t piece : {std::size_t{7}, std::size_t{4096}}) {
        if (size <= 70'000) {
          EXPECT_EQ(
              unpacked(deflated(bytes, 6, Z_DEFAULT_STRATEGY), facts_of(bytes), piece).value(),
              bytes);
        }
      }
    }
  }
}

TEST(InflatingSource, StoredBytesPass) {
  const Bytes bytes = some_bytes(5000, 256);
  EntryFacts facts = facts_of(bytes);
  facts.packing = Packing::store;
  EXPECT_EQ(unpacked(bytes, facts, 100).value(), bytes);
}

// Whatever happens to the packed bytes: the right bytes, or an error; never other bytes.
TEST(InflatingSource, EveryTruncationAndEveryFlippedBitIsAnError) {
  const Bytes bytes = some_bytes(600, 40);
  const Bytes packed = deflated(bytes, 6, Z_DEFAULT_STRATEGY);
  const EntryFacts facts = facts_of(bytes);
  for (std::size_t size = 0; size < packed.size(); ++size) {
    SCOPED_TRACE(size);
    EXPECT_FAILS(unpacked(Bytes(packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(size)),
                          facts, 256),
                 ErrorCode::bad_data);
  }
  std::size_t errors = 0;
  for (std::size_t bit = 0; bit < packed.size() * 8; ++bit) {
    Bytes damaged = packed;
    damaged[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    const auto result = unpacked(damaged, facts, 256);
    errors += result ? 0 : 1;
    // The last byte has bits behind the end of the stream, which mean nothing.
    EXPECT_TRUE(!result || (*result == bytes && bit / 8 + 1 == packed.size())) << bit;
  }
  EXPECT_GT(errors, packed.size() * 8 - 8);
}

TEST(InflatingSource, WrongSizeAndWrongCrcAreSaidAndStaySaid) {
  const Bytes bytes = some_bytes(600, 40);
  const Bytes packed = deflated(bytes, 6, Z_DEFAULT_STRATEGY);
  EntryFacts facts = facts_of(bytes);
  facts.crc32 ^= 1U;
  const auto source = unpack_entry(std::make_unique<MemorySource>(packed), facts);
  Bytes piece(1000);
  ASSERT_EQ(source->read(piece).value(), 600U);
  for (int i = 0; i < 2; ++i) {
    const auto end = source->read(piece);
    ASSERT_FALSE(end);
    EXPECT_EQ(end.error().where, "f:log.bin");
    EXPECT_NE(end.error().what.find("CRC"), std::string::npos);
  }
  facts = facts_of(bytes);
  for (const std::uint64_t size : {std::uint64_t{599}, std::uint64_t{601}}) {
    SCOPED_TRACE(size);
    facts.size = size;
    EXPECT_FAILS(unpacked(packed, facts, 256), ErrorCode::bad_data);
  }
}

// What is left of an entry is its beginning, whatever its packed bytes lost; the damage is told
// once.
TEST(InflatingSource, SalvageGivesTheBeginningAndTellsTheDamageOnce) {
  const Bytes bytes = some_bytes(600, 40);
  const Bytes packed = deflated(bytes, 6, Z_DEFAULT_STRATEGY);
  std::size_t most = 0;
  for (std::size_t size = 0; size <= packed.size(); ++size) {
    std::vector<EntryDamage> told;
    const auto source = salvage_entry(
        std::make_unique<MemorySource>(
            Bytes(packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(size))),
        facts_of(bytes), ArchiveLimits{}, [&](const EntryDamage& one) { told.push_back(one); });
    const auto left = read_all(*source, 1000);
    ASSERT_OK(left);
    ASSERT_LE(left->size(), bytes.size());
    EXPECT_TRUE(std::equal(left->begin(), left->end(), bytes.begin())) << size;
    EXPECT_GE(left->size(), most) << size;
    most = left->size();
    Bytes more(10);
    EXPECT_EQ(source->read(more).value(), 0U);
    if (size == packed.size()) {
      EXPECT_TRUE(told.empty());
      EXPECT_EQ(*left, bytes);
    } else {
      ASSERT_EQ(told.size(), 1U) << size;
      EXPECT_EQ(told[0].kind, Damage::broken_stream);
      EXPECT_EQ(told[0].bytes, left->size());
    }
  }
}

// Oracle: the bytes before they were packed. Bytes all over the stream are changed, one at a time:
// the pieces that do not hold the change come out as they were.
TEST(InflatingSource, SalvageGoesOnBehindADamagedPiece) {
  constexpr std::size_t kPieceSize = 3000;
  const Bytes bytes = some_bytes(4 * kPieceSize + 500, 60);
  EntryFacts facts = facts_of(bytes);
  facts.points.piece_size = kPieceSize;
  Bytes stream;
  PiecePacker packer;
  for (std::size_t at = 0; at < bytes.size(); at += kPieceSize) {
    const bool last = at + kPieceSize >= bytes.size();
    Bytes packed;
    packer.pack(std::span(bytes).subspan(at, std::min(kPieceSize, bytes.size() - at)),
                last ? PiecePacker::Place::last : PiecePacker::Place::inner, packed);
    facts.points.packed_sizes.push_back(static_cast<std::uint32_t>(packed.size()));
    stream.insert(stream.end(), packed.begin(), packed.end());
  }
  const auto salvaged = [&](const Bytes& packed, std::vector<EntryDamage>& damages) {
    const auto source = salvage_entry(std::make_unique<MemorySource>(packed), facts, {},
                                      [&](const EntryDamage& one) { damages.push_back(one); });
    return read_all(*source, 1U << 20).value();
  };
  std::vector<EntryDamage> none;
  ASSERT_EQ(salvaged(stream, none), bytes);
  EXPECT_TRUE(none.empty());
  std::size_t went_on = 0;
  std::size_t begin = 0;  // of a piece in the stream
  for (std::size_t piece = 0; piece < facts.points.packed_sizes.size(); ++piece) {
    const std::size_t end = begin + facts.points.packed_sizes[piece];
    for (std::size_t at = begin; at < end; at += 7) {
      SCOPED_TRACE(at);
      Bytes damaged = stream;
      damaged[at] ^= 0x24U;
      std::vector<EntryDamage> damages;
      const Bytes got = salvaged(damaged, damages);
      ASSERT_EQ(damages.size(), 1U);
      ASSERT_NE(damages[0].kind, Damage::none);
      const std::size_t before = piece * kPieceSize;
      ASSERT_GE(got.size(), before);
      ASSERT_TRUE(std::equal(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(before),
                             got.begin()));
      const std::size_t behind = bytes.size() - std::min(bytes.size(), before + kPieceSize);
      ASSERT_GE(got.size(), before + behind);
      ASSERT_TRUE(std::equal(bytes.end() - static_cast<std::ptrdiff_t>(behind), bytes.end(),
                             got.end() - static_cast<std::ptrdiff_t>(behind)));
      went_on += damages[0].kind == Damage::broken_stream && behind > 0 ? 1U : 0U;
    }
    begin = end;
  }
  EXPECT_GT(went_on, 20U) << "changes that break a piece's stream";
  // Cut off: what is there.
  std::vector<EntryDamage> damages;
  const Bytes half =
      salvaged(Bytes(stream.begin(), stream.begin() + facts.points.packed_sizes[0]), damages);
  EXPECT_EQ(half, Bytes(bytes.begin(), bytes.begin() + kPieceSize));
  ASSERT_EQ(damages.size(), 1U);
}

TEST(InflatingSource, SalvageOfMoreBytesThanSaidIsCutOff) {
  const Bytes bytes = some_bytes(600, 40);
  EntryFacts facts = facts_of(bytes);
  facts.size = 500;
  Damage told = Damage::none;
  const auto source =
      salvage_entry(std::make_unique<MemorySource>(deflated(bytes, 6, Z_DEFAULT_STRATEGY)), facts,
                    ArchiveLimits{}, [&](const EntryDamage& one) { told = one.kind; });
  EXPECT_EQ(read_all(*source, 1000).value().size(), 500U);
  EXPECT_EQ(told, Damage::wrong_length);
}

}  // namespace
}  // namespace sixpoint::gt3x
