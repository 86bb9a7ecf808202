// What db/postgres gives to this room (base/parts/part.h), which loads it at the first store that
// is on such a server.
//
//   SIXPOINT_ASSIGN(const auto database, postgres->open("postgresql://ada@host/plant"));
//
// open() is open_postgres() of database.h. cannot_create where db/postgres does not load.
#pragma once

#include <memory>
#include <string>

#include "base/result.h"
#include "db/servers/database.h"

namespace sixpoint::db {

struct PostgresPart {
  Result<std::unique_ptr<Database>> (*open)(const std::string& location);
};

}  // namespace sixpoint::db
