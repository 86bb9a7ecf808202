#include "db/servers/sqlite_indexes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string_view>

#include <fmt/format.h>
#include <sqlite3.h>

#include "base/error.h"

namespace sixpoint::db {
namespace {

constexpr std::size_t kMostFindings = 20;

using Key = std::array<std::uint64_t, 2>;

struct Finalizer {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Statement = std::unique_ptr<sqlite3_stmt, Finalizer>;

// Null where SQLite does not understand it.
Statement prepare(sqlite3& database, const std::string& sql) {
  sqlite3_stmt* statement = nullptr;
  sqlite3_prepare_v2(&database, sql.c_str(), static_cast<int>(sql.size()), &statement, nullptr);
  return Statement(statement);
}

std::string_view text_at(sqlite3_stmt& statement, int column) {
  const void* bytes = sqlite3_column_blob(&statement, column);
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(&statement, column));
  return bytes == nullptr ? std::string_view()
                          : std::string_view(static_cast<const char*>(bytes), size);
}

// The first column of every row; `of` is the first parameter, where there is one.
std::vector<std::string> names_of(sqlite3& database, const std::string& sql,
                                  const std::string& of = {}) {
  const Statement statement = prepare(database, sql);
  if (statement != nullptr && !of.empty()) {
    sqlite3_bind_text(statement.get(), 1, of.data(), static_cast<int>(of.size()), SQLITE_STATIC);
  }
  std::vector<std::string> names;
  while (statement != nullptr && sqlite3_step(statement.get()) == SQLITE_ROW) {
    names.emplace_back(text_at(*statement, 0));
  }
  return names;
}

// A name as SQL writes it.
std::string quoted_name(std::string_view name) {
  std::string text = "\"";
  for (const char c : name) {
    text += c == '"' ? std::string("\"\"") : std::string(1, c);
  }
  return text + '"';
}

// One word of SipHash (Aumasson and Bernstein, 2012).
void mix(std::array<std::uint64_t, 4>& v) {
  v[0] += v[1];
  v[2] += v[3];
  v[1] = std::rotl(v[1], 13) ^ v[0];
  v[3] = std::rotl(v[3], 16) ^ v[2];
  v[0] = std::rotl(v[0], 32);
  v[2] += v[1];
  v[0] += v[3];
  v[1] = std::rotl(v[1], 17) ^ v[2];
  v[3] = std::rotl(v[3], 21) ^ v[0];
  v[2] = std::rotl(v[2], 32);
}

std::uint64_t keyed_hash(const Key& key, std::string_view bytes) {
  std::array<std::uint64_t, 4> v = {key[0] ^ 0x736f6d6570736575, key[1] ^ 0x646f72616e646f6d,
                                    key[0] ^ 0x6c7967656e657261, key[1] ^ 0x7465646279746573};
  const std::uint64_t size = bytes.size();
  for (;;) {
    std::uint64_t word = 0;
    const bool last = bytes.size() < 8;
    std::memcpy(&word, bytes.data(), last ? bytes.size() : 8);
    word |= last ? size << 56 : 0;
    v[3] ^= word;
    mix(v);
    v[0] ^= word;
    if (last) {
      break;
    }
    bytes.remove_prefix(8);
  }
  v[2] ^= 0xff;
  mix(v);
  mix(v);
  mix(v);
  return v[0] ^ v[1] ^ v[2] ^ v[3];
}

void put_big_endian(std::string& out, std::uint64_t value) {
  for (int shift = 56; shift >= 0; shift -= 8) {
    out += static_cast<char>(value >> shift);
  }
}

// Adds a column's value so that the bytes of two entries order as SQLite orders the entries: NULL,
// then numbers, then texts byte by byte. A zero byte in a text is written as 0 255, its end as 0 0.
void put(std::string& out, sqlite3_stmt& statement, int column) {
  switch (sqlite3_column_type(&statement, column)) {
    case SQLITE_NULL:
      out += '\0';
      return;
    case SQLITE_INTEGER:
      out += '\1';
      put_big_endian(out, static_cast<std::uint64_t>(sqlite3_column_int64(&statement, column)) ^
                              (1ULL << 63U));
      return;
    default:
      break;
  }
  out += '\2';
  const std::string_view text = text_at(statement, column);
  if (text.find('\0') == std::string_view::npos) {
    out += text;
  } else {
    for (const char c : text) {
      out += c;
      if (c == '\0') {
        out += '\xff';
      }
    }
  }
  out += std::string_view("\0\0", 2);
}

// The entries of one index, as the table or the index says.
struct Entries {
  std::uint64_t count = 0;
  std::uint64_t sum = 0;
  void add(const Key& key, std::string_view entry) {
    ++count;
    sum += keyed_hash(key, entry);
  }
  bool operator==(const Entries&) const = default;
};

struct Index {
  std::string name;
  std::string columns;  // as SQL writes them, with a comma behind each
  std::size_t column_count = 0;
  Entries in_table;
};

std::vector<Index> indexes_of(sqlite3& database, const std::string& table) {
  std::vector<Index> indexes;
  for (std::string& name :
       names_of(database, "SELECT name FROM pragma_index_list(?) ORDER BY name", table)) {
    Index index;
    index.name = std::move(name);
    for (const std::string& column :
         names_of(database, "SELECT name FROM pragma_index_info(?)", index.name)) {
      index.columns += quoted_name(column) + ", ";
      ++index.column_count;
    }
    indexes.push_back(std::move(index));
  }
  return indexes;
}

// Reads the table once for all of its indexes. False where it cannot be read.
bool read_table(sqlite3& database, const std::string& table, const Key& key,
                std::vector<Index>& indexes) {
  std::string columns;
  for (const Index& index : indexes) {
    columns += index.columns;
  }
  columns += "rowid";
  const Statement statement =
      prepare(database, fmt::format("SELECT {} FROM {} NOT INDEXED", columns, quoted_name(table)));
  int result = statement == nullptr ? SQLITE_ERROR : sqlite3_step(statement.get());
  std::string entry;
  for (; result == SQLITE_ROW; result = sqlite3_step(statement.get())) {
    int column = 0;
    for (Index& index : indexes) {
      entry.clear();
      for (std::size_t i = 0; i < index.column_count; ++i) {
        put(entry, *statement, column++);
      }
      put(entry, *statement, sqlite3_column_count(statement.get()) - 1);  // the rowid
      index.in_table.add(key, entry);
    }
  }
  return result == SQLITE_DONE;
}

// What is wrong with one index; empty where nothing is.
std::string check_index(sqlite3& database, const std::string& table, const Key& key,
                        const Index& index) {
  const std::string columns = index.columns + "rowid";
  const Statement statement =
      prepare(database, fmt::format("SELECT {0} FROM {1} INDEXED BY {2} ORDER BY {0}", columns,
                                    quoted_name(table), quoted_name(index.name)));
  int result = statement == nullptr ? SQLITE_ERROR : sqlite3_step(statement.get());
  Entries entries;
  std::string entry;
  std::string previous;
  bool ordered = true;
  for (; result == SQLITE_ROW; result = sqlite3_step(statement.get())) {
    entry.clear();
    for (int i = 0; i < sqlite3_column_count(statement.get()); ++i) {
      put(entry, *statement, i);
    }
    entries.add(key, entry);
    ordered = ordered && (entries.count == 1 || previous < entry);
    previous.swap(entry);
  }
  if (result != SQLITE_DONE) {
    return "cannot be read";
  }
  return ordered && entries == index.in_table ? ""
                                              : "does not say what the table says: questions get "
                                                "wrong answers";
}

}  // namespace

std::vector<std::string> check_sqlite_indexes(sqlite3& database) {
  std::vector<std::string> findings;
  for (const std::string& said :
       names_of(database, fmt::format("PRAGMA quick_check({})", kMostFindings))) {
    if (said != "ok") {
      findings.push_back("SQLite finds damage: " + printable(said, 300));
    }
  }
  Key key{};
  sqlite3_randomness(sizeof key, key.data());
  for (const std::string& table :
       names_of(database, "SELECT name FROM sqlite_schema WHERE type = 'table' ORDER BY name")) {
    std::vector<Index> indexes = indexes_of(database, table);
    if (!indexes.empty() && !read_table(database, table, key, indexes)) {
      findings.push_back(fmt::format("the table {} cannot be read", printable(table, 80)));
      continue;
    }
    for (const Index& index : indexes) {
      if (const std::string wrong = check_index(database, table, key, index); !wrong.empty()) {
        findings.push_back(fmt::format("the index {} of {} {}", printable(index.name, 80),
                                       printable(table, 80), wrong));
      }
    }
  }
  findings.resize(std::min(findings.size(), kMostFindings));
  return findings;
}

}  // namespace sixpoint::db
