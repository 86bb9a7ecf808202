// The location of a PostgreSQL store, taken apart by libpq.
//
//   SIXPOINT_ASSIGN(const auto address, parse_postgres_address("postgresql://ada:x@host/plant"));
//   address.shown;   // "postgresql://ada@host/plant": for messages, without the password
#pragma once

#include <string>

#include "base/result.h"

namespace sixpoint::db {

struct PostgresAddress {
  std::string connection;  // key='value' ..., with the password
  std::string shown;       // postgresql://user@host:port/name
  std::string password;
};

// usage for what is no such location; the message never holds the password.
Result<PostgresAddress> parse_postgres_address(const std::string& location);

}  // namespace sixpoint::db
