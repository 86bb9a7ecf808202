#include <filesystem>
#include <stdexcept>

#include <sqlite3.h>

#include "place.h"

namespace sixpoint::db::tests {
namespace {

class SqlitePlace final : public Place {
 public:
  std::string location(const std::string& name) override { return folder_ / (name + ".db"); }
  void erase(const std::string& name) override { std::filesystem::remove(location(name)); }
  void tamper(const std::string& name, const std::string& sql) override {
    std::string all = "PRAGMA foreign_keys=OFF;";
    for (const char* table : {"units", "constants", "attachments", "runs", "repairs"}) {
      for (const char* change : {"update", "delete"}) {
        all += std::string("DROP TRIGGER IF EXISTS ") + table + "_no_" + change + ";";
      }
    }
    if (!statements(name, all + sql)) {
      throw std::runtime_error("cannot tamper: " + sql);
    }
  }
  bool statements(const std::string& name, const std::string& sql) override {
    sqlite3* handle = nullptr;
    const bool good = sqlite3_open(location(name).c_str(), &handle) == SQLITE_OK &&
                      sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK;
    sqlite3_close(handle);
    return good;
  }
  std::string empty_bytes() const override { return "x''"; }

 private:
  sixpoint::tests::TemporaryFolder folder_;
};

}  // namespace

std::unique_ptr<Place> make_place() { return std::make_unique<SqlitePlace>(); }

}  // namespace sixpoint::db::tests
