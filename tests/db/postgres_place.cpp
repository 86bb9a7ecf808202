#include <set>
#include <stdexcept>

#include <libpq-fe.h>

#include "place.h"
#include "postgres_server.h"

namespace sixpoint::db::tests {
namespace {

bool run(const std::string& location, const std::string& sql) {
  PGconn* connection = ::PQconnectdb(location.c_str());
  ::PQsetNoticeProcessor(
      connection, [](void*, const char*) {}, nullptr);
  PGresult* result = ::PQexec(connection, sql.c_str());
  const auto status = ::PQresultStatus(result);
  ::PQclear(result);
  ::PQfinish(connection);
  return status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK;
}

class PostgresPlace final : public Place {
 public:
  PostgresPlace() : number_(++places) {}
  ~PostgresPlace() override {
    for (const std::string& name : made_) {
      drop(name);
    }
  }
  std::string location(const std::string& name) override {
    return made_.insert(name).second ? server().make_database(own(name))
                                     : server().location(own(name));
  }
  void erase(const std::string& name) override {
    drop(name);
    made_.erase(name);
  }
  void tamper(const std::string& name, const std::string& sql) override {
    if (!run(server().superuser(own(name)), "SET session_replication_role = replica; " + sql)) {
      throw std::runtime_error("cannot tamper: " + sql);
    }
  }
  bool statements(const std::string& name, const std::string& sql) override {
    return run(location(name), sql);
  }
  std::string empty_bytes() const override { return "''::bytea"; }

 private:
  std::string own(const std::string& name) const {
    return "store_" + std::to_string(number_) + "_" + name;
  }
  void drop(const std::string& name) {
    run(server().superuser("postgres"), "DROP DATABASE IF EXISTS " + own(name) + " WITH (FORCE)");
  }
  static inline int places = 0;
  int number_;
  std::set<std::string> made_;
};

}  // namespace

std::unique_ptr<Place> make_place() { return std::make_unique<PostgresPlace>(); }

}  // namespace sixpoint::db::tests
