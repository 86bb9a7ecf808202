#include "gt3x/container/piece_packer.h"

#include <array>
#include <memory>
#include <new>

#include <libdeflate.h>

namespace sixpoint::gt3x {
namespace {

constexpr int kLevel = 6;
// An empty block with fixed codes that is the last of its stream.
constexpr std::array<std::uint8_t, 2> kEmptyLastBlock = {0x03, 0x00};
// Length and complement of a stored block without bytes.
constexpr std::array<std::uint8_t, 4> kEmptyStored = {0x00, 0x00, 0xFF, 0xFF};

// Takes the mark of the last block away and puts an empty stored block behind it.
void open_end(Bytes& stream, const LastBlock& last) {
  stream[last.begin_bit / 8] ^= static_cast<std::uint8_t>(1U << (last.begin_bit % 8));
  // Three bits of header, all zero as the unused bits of the last byte are, and zeros up to a whole
  // byte; then a length of 0 and its complement.
  stream.resize((last.end_bit + 3 + 7) / 8);
  stream.insert(stream.end(), kEmptyStored.begin(), kEmptyStored.end());
}

}  // namespace

PiecePacker::PiecePacker() : compressor_(libdeflate_alloc_compressor(kLevel)) {
  if (compressor_ == nullptr) {
    throw std::bad_alloc();
  }
}

PiecePacker::~PiecePacker() { libdeflate_free_compressor(compressor_); }

void PiecePacker::pack(std::span<const std::uint8_t> piece, Place place, Bytes& packed) {
  packed.resize(libdeflate_deflate_compress_bound(compressor_, piece.size()));
  packed.resize(libdeflate_deflate_compress(compressor_, piece.data(), piece.size(), packed.data(),
                                            packed.size()));
  if (place == Place::inner) {
    // libdeflate wrote the stream: it is one.
    open_end(packed, finder_.find(packed, piece).value());
  }
}

bool unpack_piece(Bytes& packed, PiecePacker::Place place, std::span<std::uint8_t> piece) {
  if (place == PiecePacker::Place::inner) {
    packed.insert(packed.end(), kEmptyLastBlock.begin(), kEmptyLastBlock.end());
  }
  const std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)> unpacker(
      libdeflate_alloc_decompressor(), &libdeflate_free_decompressor);
  if (unpacker == nullptr) {
    throw std::bad_alloc();
  }
  std::size_t used = 0;
  return libdeflate_deflate_decompress_ex(unpacker.get(), packed.data(), packed.size(),
                                          piece.data(), piece.size(), &used,
                                          nullptr) == LIBDEFLATE_SUCCESS &&
         used == packed.size();
}

}  // namespace sixpoint::gt3x
