// Moving whole stores: out as text, in again on either server, and a copy while others work.
//
//   SIXPOINT_ASSIGN(const auto out, export_json_lines(store, env.files, "plant.jsonl"));
//   SIXPOINT_ASSIGN(const auto in, import_json_lines(other, env.files, "plant.jsonl"));
//   const bool same = in.head == out.head;  // the same chain: nothing is lost
//
// JSON Lines (docs/store.md has the keys): the first line names the format, how many rows there are
// and the head of the chain; then every row in order, all attachments before the first row. CSV is
// an export for spreadsheets and is not read again.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "db/store.h"

namespace sixpoint::db {

struct ExchangeReport {
  std::int64_t rows = 0;   // in the store or file that was read
  std::int64_t added = 0;  // import: rows that the store did not have yet
  std::int64_t attachments = 0;
  std::string head;  // hex SHA-256 of the last row

  std::string brief() const;
  nlohmann::ordered_json to_json() const;  // rows, added, attachments, head
};

// The store as it is now, into `path` (whole or not at all).
Result<ExchangeReport> export_json_lines(Store& store, FileSystem& files, const std::string& path);

// One file TABLE.csv per table into `folder`, which is made, and attachments/SHA256 (RFC 4180,
// UTF-8, a header line; NULL is an empty field, an empty text is ""). Last store.json, the first
// line of a JSON Lines export, which says how many rows there must be and their head.
Result<ExchangeReport> export_csv(Store& store, FileSystem& files, const std::string& folder);

// Continues `store` with the rows of `path` in one transaction. The rows that both have must be the
// same: then the file may hold more, or no more, than the store. bad_data, naming the line, for
// CSV, another chain, a changed, missing or reordered row, a file that ends early; configuration
// for a file of a newer version. Nothing of a refused file stays.
Result<ExchangeReport> import_json_lines(Store& store, FileSystem& files, const std::string& path);

// Makes `path`, where nothing is yet, an SQLite store of what the JSON Lines in `input` hold: whole
// or not at all. The path is one of the real disk.
Result<ExchangeReport> import_into_new_file(Env& env, const std::string& input,
                                            const std::string& path);

// A store in an SQLite file `path` (replaced whole or not at all) with the same rows and head, made
// while others go on writing: by SQLite's online backup, or row by row from PostgreSQL. The path is
// one of the real disk. It is read back and its chain is checked before it takes its name.
Result<ExchangeReport> backup(Store& store, Env& env, const std::string& path);

}  // namespace sixpoint::db
