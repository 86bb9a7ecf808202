// What db/postgres gives to this room (base/parts/part.h). Private to the two.
#pragma once

#include <memory>
#include <string>

#include "base/result.h"
#include "db/servers/database.h"

namespace sixpoint::db {

struct PostgresPart {
  Result<std::unique_ptr<Database>> (*open)(const std::string& location);  // open_postgres()
};

}  // namespace sixpoint::db
