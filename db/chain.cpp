#include "db/chain.h"

namespace sixpoint::db {
namespace {

void put_integer(Bytes& out, std::uint64_t value) {
  for (int shift = 56; shift >= 0; shift -= 8) {
    out.push_back(static_cast<std::uint8_t>(value >> shift));
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

}  // namespace

Sha256Digest chain_hash(std::span<const std::uint8_t> previous, std::string_view table,
                        std::int64_t seq, std::span<const Value> columns) {
  Bytes bytes(previous.begin(), previous.end());
  put_text(bytes, table);
  put(bytes, Value(seq));
  for (const Value& value : columns) {
    put(bytes, value);
  }
  return sha256(bytes);
}

}  // namespace sixpoint::db
