// Whether the store's history is what was written: Store::audit() (store.h).
//
//   SIXPOINT_ASSIGN(const AuditReport report, store.audit());
//   report.brief();   // "1042 rows, nothing touched, head 3f2a..."
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace sixpoint::db {

// The end of the chain, to be written down elsewhere: who has it can ask later whether the
// history up to there is still the same.
struct StoreHead {
  std::int64_t rows = 0;
  std::string head;  // hex SHA-256 of the last row

  nlohmann::ordered_json to_json() const;  // rows, head
};

struct AuditReport {
  bool ok = false;
  std::int64_t rows = 0;
  std::string head;                   // hex SHA-256 of the last row
  std::vector<std::string> findings;  // what is wrong, the first 20

  std::string brief() const;
  bool usable() const { return ok; }
  nlohmann::ordered_json to_json() const;  // ok, rows, head, findings
};

}  // namespace sixpoint::db
