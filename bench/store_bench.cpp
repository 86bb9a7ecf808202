// The store at its size: how fast rows come in, one file's constants are found, the recall list is
// made and the chain is verified; what many writers do to each other.
//
//   store_bench [--constants N] [--repairs N] [--store PLACE] [--writers N] [--seconds S]
//               [--postgres 1]
//
// --postgres 1 starts a PostgreSQL of its own on loopback, with fsync on, and measures on that.
//
// Baselines, named in the output: for the audit, a full scan of the same tables by SQLite's own
// library, and SHA-256 alone over as many bytes; for the writers, one writer alone.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <thread>

#include <fmt/format.h>
#include <sqlite3.h>

#include "base/env.h"
#include "base/random.h"
#include "db/history.h"
#include "db/postgres_server.h"
#include "db/store.h"

namespace {

using namespace sixpoint;

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

template <class T>
T need(Result<T> result) {
  if (!result) {
    std::cerr << result.error().brief() << '\n';
    std::exit(1);
  }
  return *std::move(result);
}
void need(const Status& status) {
  if (!status) {
    std::cerr << status.error().brief() << '\n';
    std::exit(1);
  }
}

std::string serial_of(std::uint64_t unit) { return fmt::format("MOS2A{:08}", unit); }
std::string id_of(const char* kind, std::uint64_t number) {
  return fmt::format("{}{:030}", kind, number);
}

constexpr std::uint64_t kSetsPerUnit = 10;
constexpr std::string_view kDocument =
    R"({"serial":"MOS2A45130450","filter":"current","constants":{"sensitivity_g_per_lsb":)"
    R"([0.00379,0.0036,0.00404],"zero_lsb":[61.2,4.1,61.7],"positive_lsb":[326,287,303],)"
    R"("negative_lsb":[-201,-268,-192]},"method":"jig","made_from":{"sha256":"00"}})";

// Rows straight into the chain: a history of years in a minute.
void fill(db::Store& store, std::uint64_t constants, std::uint64_t repairs) {
  db::Database& database = store.database();
  std::uint64_t rows = 0;
  std::optional<db::Transaction> transaction;
  std::optional<db::HistoryWriter> writer;
  const auto add = [&](const char* table, const db::Row& row) {
    if (rows++ % 200'000 == 0) {
      if (writer) {
        need(writer->finish());
        need(transaction->commit());
      }
      transaction.emplace(need(db::Transaction::writing(database)));
      writer.emplace(need(db::HistoryWriter::open(database)));
    }
    need(writer->append(db::table(table), row));
  };
  const std::string document(kDocument);
  for (std::uint64_t i = 0; i < constants; ++i) {
    if (i % kSetsPerUnit == 0) {
      add("units", {serial_of(i / kSetsPerUnit), "wGT3X-BT", std::int64_t{1}});
    }
    add("constants",
        {id_of("c0", i), serial_of(i / kSetsPerUnit), "current", static_cast<std::int64_t>(i),
         "jig", db::Value(), document, db::Value(), db::Value()});
  }
  const std::string hash(64, 'a');
  for (std::uint64_t i = 0; i < repairs; ++i) {
    const std::uint64_t set = i % constants;
    add("repairs",
        {id_of("f0", i), serial_of(set / kSetsPerUnit), static_cast<std::int64_t>(i),
         fmt::format("/archive/{:08}.gt3x", i), fmt::format("{:064x}", i),
         fmt::format("{:064x}", i + (1ULL << 60)), "store", id_of("c0", set), "{}", db::Value()});
  }
  need(writer->finish());
  need(transaction->commit());
}

void report_audit(db::Store& store, const std::string& path) {
  db::AuditReport audit;
  const double ours_s = seconds_of([&] { audit = need(store.audit()); });
  fmt::print("audit verify: {} rows in {:.2f} s, {:.0f} rows/s, ok {}\n", audit.rows, ours_s,
             static_cast<double>(audit.rows) / ours_s, audit.ok);
  if (path.find("://") != std::string::npos) {
    return;
  }
  std::uint64_t bytes = 0;
  const double scan_s = seconds_of([&] {
    sqlite3* handle = nullptr;
    sqlite3_open(path.c_str(), &handle);
    for (const db::Table& table : db::tables()) {
      sqlite3_stmt* statement = nullptr;
      const std::string sql = fmt::format("SELECT * FROM {} ORDER BY seq", table.name);
      sqlite3_prepare_v2(handle, sql.c_str(), -1, &statement, nullptr);
      while (sqlite3_step(statement) == SQLITE_ROW) {
        for (int i = 0; i < sqlite3_column_count(statement); ++i) {
          bytes += static_cast<std::uint64_t>(sqlite3_column_bytes(statement, i)) + 9;
        }
      }
      sqlite3_finalize(statement);
    }
    sqlite3_close(handle);
  });
  const double hash_s = seconds_of([&] {
    Sha256 hash;
    const Bytes row(static_cast<std::size_t>(bytes / static_cast<std::uint64_t>(audit.rows)), 7);
    for (std::int64_t i = 0; i < audit.rows; ++i) {
      hash.update(row);
      static_cast<void>(hash.finish());
    }
  });
  fmt::print("  baseline: plain SQLite scan {:.2f} s + SHA-256 alone {:.2f} s; ratio {:.2f}\n",
             scan_s, hash_s, ours_s / (scan_s + hash_s));
}

void report_lookups(db::Store& store, std::uint64_t constants, std::uint64_t repairs) {
  Random random(3);
  std::vector<double> times_s;
  for (int i = 0; i < 2000; ++i) {
    const std::string serial = serial_of(random.below(constants / kSetsPerUnit));
    times_s.push_back(seconds_of([&] {
      if (need(store.constants_history(serial)).constants.empty()) {
        std::exit(1);
      }
    }));
  }
  std::sort(times_s.begin(), times_s.end());
  fmt::print("constants of one file: median {:.3f} ms, 99 % {:.3f} ms\n", times_s[1000] * 1e3,
             times_s[1980] * 1e3);
  times_s.clear();
  for (int i = 0; i < 2000; ++i) {
    const std::string hash = fmt::format("{:064x}", random.below(repairs) + (1ULL << 60));
    times_s.push_back(seconds_of([&] {
      if (!need(store.repair_of_output(hash))) {
        std::exit(1);
      }
    }));
  }
  std::sort(times_s.begin(), times_s.end());
  fmt::print("repair of one file: median {:.3f} ms, 99 % {:.3f} ms\n", times_s[1000] * 1e3,
             times_s[1980] * 1e3);
  for (std::uint64_t i = 0; i < 100; ++i) {
    need(store.withdraw_constants(id_of("c0", random.below(constants)), "bench", "bench"));
  }
  std::size_t files = 0;
  const double recall_s = seconds_of([&] { files = need(store.recall_list()).size(); });
  fmt::print("recall list: {} files of 100 withdrawn sets in {:.3f} s\n", files, recall_s);
}

// Rows per second that `count` processes' worth of connections add together; none lost or doubled.
double write_for(const std::string& place, int count, int seconds) {
  std::int64_t before = 0;
  {
    auto store = need(db::Store::open(posix_env(), place));
    before = need(store.audit()).rows;
  }
  std::vector<std::thread> threads;
  std::atomic<std::int64_t> added = 0;
  std::atomic<std::int64_t> failed = 0;
  const auto run = posix_env().clock.now().time_since_epoch().count();
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(seconds);
  for (int writer = 0; writer < count; ++writer) {
    threads.emplace_back([&, writer] {
      auto store = need(db::Store::open(posix_env(), place));
      for (int i = 0; std::chrono::steady_clock::now() < end; ++i) {
        db::RepairRecord repair;
        repair.serial = serial_of(static_cast<std::uint64_t>(writer));
        repair.input = fmt::format("{}-{}-{}", run, writer, i);
        repair.document = "{}";
        ++(store.add_repair(repair) ? added : failed);
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  auto store = need(db::Store::open(posix_env(), place));
  const auto audit = need(store.audit());
  fmt::print("{} writers for {} s: {} rows acknowledged, {} stored, {} refused, chain ok {}\n",
             count, seconds, added.load(), audit.rows - before, failed.load(), audit.ok);
  return static_cast<double>(added) / seconds;
}

}  // namespace

int main(int argc, char** argv) {
  std::uint64_t constants = 100'000;
  std::uint64_t repairs = 1'000'000;
  int writers = 16;
  int seconds = 10;
  std::string place;
  std::unique_ptr<db::tests::PostgresServer> server;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string_view name = argv[i];
    const auto number = std::strtoull(argv[i + 1], nullptr, 10);
    if (name == "--constants") {
      constants = std::max<std::uint64_t>(number, kSetsPerUnit);
    } else if (name == "--repairs") {
      repairs = std::max<std::uint64_t>(number, 1);
    } else if (name == "--writers") {
      writers = static_cast<int>(number);
    } else if (name == "--seconds") {
      seconds = static_cast<int>(number);
    } else if (name == "--postgres" && number == 1) {
      if (const std::string missing = db::tests::PostgresServer::missing(); !missing.empty()) {
        std::cerr << missing << '\n';
        return 1;
      }
      server = std::make_unique<db::tests::PostgresServer>();
      place = server->make_database("filled");
    } else if (name == "--store") {
      place = argv[i + 1];
    }
  }
  std::string folder = std::filesystem::temp_directory_path() / "sixpoint-bench-XXXXXX";
  if (::mkdtemp(folder.data()) == nullptr) {
    return 1;
  }
  const bool own = place.empty();
  if (own) {
    place = folder + "/store.db";
  }
  {
    auto store = need(db::Store::open(posix_env(), place));
    const double fill_s = seconds_of([&] { fill(store, constants, repairs); });
    const auto rows = static_cast<double>(constants + constants / kSetsPerUnit + repairs);
    fmt::print("filled: {} constants, {} repairs in {:.1f} s, {:.0f} rows/s\n", constants, repairs,
               fill_s, rows / fill_s);
    report_audit(store, place);
    report_lookups(store, constants, repairs);
  }
  if (own) {
    place = folder + "/writers.db";
  } else if (server != nullptr) {
    place = server->make_database("writers");
  }
  const double one = write_for(place, 1, std::max(1, seconds / 4));
  const double many = write_for(place, writers, seconds);
  fmt::print("  {:.0f} rows/s; baseline: one writer alone {:.0f} rows/s; ratio {:.2f}\n", many, one,
             many / one);
  std::filesystem::remove_all(folder);
}
