#include "db/chain.h"

namespace sixpoint::db {
namespace {

void put_integer(Bytes& out, std::uint64_t value) {
  const std::size_t at = out.size();
  out.resize(at + 8);
  for (std::size_t i = 0; i < 8; ++i) {
    out[at + i] = static_cast<std::uint8_t>(value >> (56 - 8 * i));
  }
}

void put_text(Bytes& out, std::string_view text) {
  out.push_back(2);
  put_integer(out, text.size());
  out.insert(out.end(), text.begin(), text.end());
}

void put(Bytes& out, const Value& value) {
  if (const auto* integer = std::get_if<std::int64_t>(&value)) {
    out.push_back(1);
    put_integer(out, static_cast<std::uint64_t>(*integer));
  } else if (const auto* text = std::get_if<std::string>(&value)) {
    put_text(out, *text);
  } else {
    out.push_back(0);
  }
}

// How many of the columns count: those of version 1, and added ones up to the last that is set.
std::span<const Value> counted(const Table& table, std::span<const Value> columns,
                               std::size_t skipped) {
  std::size_t count = columns.size();
  while (count > 0 && table.columns[count - 1 + skipped].since > table.since &&
         std::holds_alternative<std::monostate>(columns[count - 1])) {
    --count;
  }
  return columns.first(count);
}

}  // namespace

Sha256Digest ChainHasher::finish(std::span<const Value> columns) {
  for (const Value& value : columns) {
    put(bytes_, value);
  }
  sha256_.update(bytes_);
  return sha256_.finish();
}

Sha256Digest ChainHasher::hash(std::span<const std::uint8_t> previous, const Table& table,
                               std::int64_t seq, std::span<const Value> columns) {
  bytes_.assign(previous.begin(), previous.end());
  put_text(bytes_, table.name);
  bytes_.push_back(1);
  put_integer(bytes_, static_cast<std::uint64_t>(seq));
  return finish(counted(table, columns, 0));
}

std::string ChainHasher::identifier(const Table& table,
                                    std::span<const Value> columns_without_key) {
  bytes_.clear();
  put_text(bytes_, table.name);
  bytes_.push_back(1);
  put_integer(bytes_, 0);
  const Sha256Digest digest = finish(counted(table, columns_without_key, 1));
  return to_hex(std::span(digest).first(16));
}

}  // namespace sixpoint::db
