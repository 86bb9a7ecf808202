#include "db/audit.h"

#include <algorithm>
#include <future>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "db/history.h"
#include "db/store.h"

namespace sixpoint::db {
namespace {

constexpr std::size_t kMostFindings = 20;

// Damaged, or a table that is not there: the servers call that an error of the statement.
bool is_finding(const Error& error) {
  return error.code == ErrorCode::bad_data || error.code == ErrorCode::internal;
}

class Audit {
 public:
  Audit(Database& database, Bytes earlier_head)
      : database_(database),
        earlier_head_(std::move(earlier_head)),
        found_earlier_head_(earlier_head_.empty() || earlier_head_ == previous_) {}

  Status check_attachments() {
    // Attachments are named by their content.
    SIXPOINT_CHECK(
        for_each_attachment(database_, [&](const std::string& name, const Bytes& bytes) -> Status {
          if (to_hex(sha256(bytes)) != name) {
            add(fmt::format("attachment {} was changed", printable(name, 70)));
          }
          return {};
        }));
    // The chain holds their names; the databases' own keys may have been switched off.
    SIXPOINT_ASSIGN(
        const auto lost,
        database_.query(fmt::format("SELECT captures.sha256 FROM captures LEFT JOIN attachments "
                                    "ON attachments.sha256 = captures.sha256 WHERE "
                                    "attachments.sha256 IS NULL ORDER BY captures.seq LIMIT {}",
                                    kMostFindings)));
    for (const Row& capture : lost) {
      add(fmt::format("attachment {} was removed", printable(text_of(capture[0]), 70)));
    }
    return {};
  }

  // What questions are answered by.
  Status take_findings(Result<std::vector<std::string>> of_indexes) {
    SIXPOINT_ASSIGN(auto wrong, std::move(of_indexes));
    for (std::string& finding : wrong) {
      add(std::move(finding));
    }
    return {};
  }

  Status check_rows() {
    return for_each_history_row(database_, [&](const HistoryRow& row) {
      check(row);
      return Status();
    });
  }

  // What cannot be read is a finding; other errors say nothing about the history.
  Status take_unreadable(const Status& read, const std::string& what) {
    if (read || !is_finding(read.error())) {
      return read;
    }
    add(fmt::format("{} cannot be read: {}", what, read.error().what));
    return {};
  }
  std::int64_t last_seq() const { return last_seq_; }

  Result<AuditReport> report() {
    const auto head = read_head(database_);
    if (!head && !is_finding(head.error())) {
      return fail(head.error());  // no answer says nothing about the rows
    }
    if (!head || head->rows != last_seq_ || head->hash != previous_) {
      add("the head does not name the last row: rows at the end were removed or added");
    }
    if (!found_earlier_head_) {
      add(
          fmt::format("the head {} that was written down is no row of this chain: the history was "
                      "written anew, or this is another store",
                      to_hex(earlier_head_)));
    }
    report_.head = to_hex(previous_);
    report_.ok = report_.findings.empty();
    return std::move(report_);
  }

 private:
  void check(const HistoryRow& row) {
    if (row.seq != last_seq_ + 1) {
      add(row.seq > last_seq_ ? fmt::format("rows {} to {} are missing", last_seq_ + 1, row.seq - 1)
                              : fmt::format("row {} is there twice", row.seq));
    }
    const Sha256Digest hash = hasher_.hash(previous_, *row.table, row.seq, row.columns);
    if (!std::ranges::equal(hash, row.hash)) {
      add(fmt::format("{} does not fit the chain: it, or one before it, was changed",
                      name_of(row)));
    }
    // Go on from what is written, so that one changed row is one finding and not all that follow.
    previous_.assign(row.hash.begin(), row.hash.end());
    found_earlier_head_ = found_earlier_head_ || previous_ == earlier_head_;
    last_seq_ = row.seq;
    ++report_.rows;
  }

  void add(std::string finding) {
    if (report_.findings.size() < kMostFindings) {
      report_.findings.push_back(std::move(finding));
    }
  }

  Database& database_;
  Bytes earlier_head_;
  ChainHasher hasher_;
  Bytes previous_ = Bytes(32, 0);
  bool found_earlier_head_;
  std::int64_t last_seq_ = 0;
  AuditReport report_;
};

}  // namespace

std::string AuditReport::brief() const {
  return ok ? fmt::format("{} rows, nothing touched, head {}", rows, head)
            : fmt::format("{} rows, {} findings, the first: {}", rows, findings.size(),
                          findings.empty() ? "" : findings.front());
}

nlohmann::ordered_json AuditReport::to_json() const {
  return {{"ok", ok}, {"rows", rows}, {"head", head}, {"findings", findings}};
}

Result<AuditReport> Store::audit(const std::string& earlier_head) {
  const auto head = from_hex(earlier_head);
  if (!earlier_head.empty() && (!head || head->size() != 32)) {
    return fail(ErrorCode::usage, "the head is no hash", printable(earlier_head, 70),
                "give the 64 digits that an earlier 'audit verify' printed");
  }
  SIXPOINT_ASSIGN(const auto transaction, Transaction::reading(*database_));
  Audit audit(*database_, *head);
  // Beside the chain, which takes about as long.
  auto indexes = std::async(std::launch::async, [this] { return database_->check_indexes(); });
  SIXPOINT_CHECK(audit.take_unreadable(audit.check_attachments(), "what is attached"));
  const Status rows = audit.check_rows();
  SIXPOINT_CHECK(audit.take_unreadable(rows, fmt::format("what follows row {}", audit.last_seq())));
  SIXPOINT_CHECK(audit.take_unreadable(audit.take_findings(indexes.get()), "an index"));
  return audit.report();
}

nlohmann::ordered_json StoreHead::to_json() const { return {{"rows", rows}, {"head", head}}; }

Result<StoreHead> Store::head() {
  SIXPOINT_ASSIGN(const Head head, read_head(*database_));
  return StoreHead{head.rows, to_hex(head.hash)};
}

}  // namespace sixpoint::db
