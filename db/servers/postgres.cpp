#include "base/parts/part.h"
#include "db/servers/database.h"
#include "db/servers/postgres_part.h"

extern "C" [[gnu::weak]] const sixpoint::db::PostgresPart sixpoint_part_postgres;

namespace sixpoint::db {

Result<std::unique_ptr<Database>> open_postgres(const std::string& location) {
  SIXPOINT_ASSIGN(const PostgresPart* postgres, part("postgres", &sixpoint_part_postgres));
  return postgres->open(location);
}

}  // namespace sixpoint::db
