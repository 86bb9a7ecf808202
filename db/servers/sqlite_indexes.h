// Do the indexes of an SQLite file say what its tables say? (Private to this room.)
//
//   const std::vector<std::string> wrong = check_sqlite_indexes(handle);
//
// First by SQLite's own check of its pages (quick_check). Then every table is read once without an
// index, and every index once in its order: its entries must stand in that order, and the two must
// be the same entries. That is what a question would be answered by either. (integrity_check asks
// every index for every row: five times slower, and it says no more.)
//
// Entries are compared as sums of a keyed hash of each one (SipHash-1-3, a new key each time, so
// that no one can prepare a difference that cancels out): no sorting, and no memory per row.
#pragma once

#include <string>
#include <vector>

struct sqlite3;

namespace sixpoint::db {

// One sentence for each that is wrong, the first 20.
std::vector<std::string> check_sqlite_indexes(sqlite3& database);

}  // namespace sixpoint::db
