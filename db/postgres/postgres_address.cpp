#include "db/postgres/postgres_address.h"

#include <map>
#include <memory>

#include <fmt/format.h>
#include <libpq-fe.h>

namespace sixpoint::db {
namespace {

void append_option(std::string& connection, std::string_view key, std::string_view value) {
  connection += fmt::format("{}{}='", connection.empty() ? "" : " ", key);
  for (const char c : value) {
    if (c == '\'' || c == '\\') {
      connection += '\\';
    }
    connection += c;
  }
  connection += '\'';
}

}  // namespace

Result<PostgresAddress> parse_postgres_address(const std::string& location) {
  // libpq's own message would quote parts of the location, and with them the password.
  const std::unique_ptr<PQconninfoOption, decltype(&PQconninfoFree)> options(
      PQconninfoParse(location.c_str(), nullptr), &PQconninfoFree);
  if (options == nullptr) {
    return fail(ErrorCode::usage, "this is no address of a PostgreSQL database",
                "--store postgresql://...",
                "write postgresql://USER@HOST:PORT/DATABASE, other characters in it as %XX");
  }
  std::map<std::string, std::string> given;
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option) {
    if (option->val != nullptr) {
      given[option->keyword] = option->val;
    }
  }
  // The rest of a password that was written with its @ or / as they are.
  if (given["host"].find('@') != std::string::npos ||
      given["dbname"].find_first_of("@/") != std::string::npos) {
    return fail(ErrorCode::usage, "the address has an @ or a / too many",
                "--store postgresql://...", "in a password, write @ as %40, / as %2F and : as %3A");
  }
  PostgresAddress address;
  address.password = given["password"];
  const auto part = [&](const char* key, const char* before) {
    return !given[key].empty() ? before + given[key] : std::string();
  };
  address.shown = fmt::format("postgresql://{}{}{}{}", part("user", ""),
                              part("host", !given["user"].empty() ? "@" : ""), part("port", ":"),
                              part("dbname", "/"));
  // A server that vanishes must be noticed: connecting gives up after 10 s, and an
  // answer that does not come while the network is dead after 20 s.
  given.try_emplace("connect_timeout", "10");
  given.try_emplace("keepalives_idle", "10");
  given.try_emplace("keepalives_interval", "5");
  given.try_emplace("keepalives_count", "2");
  given.try_emplace("tcp_user_timeout", "20000");
  given.try_emplace("fallback_application_name", "sixpoint");
  given["client_encoding"] = "UTF8";
  for (const auto& [key, value] : given) {
    if (value.empty()) {
      continue;
    }
    append_option(address.connection, key, value);
  }
  return address;
}

}  // namespace sixpoint::db
