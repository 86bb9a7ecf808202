// What the store is told about files that were mended: each once, however often it is told.
#pragma once

#include <string>
#include <vector>

#include "db/store.h"
#include "repair/file_tree.h"
#include "repair/repair_file.h"

namespace sixpoint::repair {

struct RepairRecords {
  std::vector<db::RepairRecord> records;  // what `store` does not know yet
  std::vector<RefusedPath> refused;       // mended files that no store can keep, and why
};

// Of the reports that say `repaired` and wrote a file. A file whose output and input the store
// knows is left out. Constants that another store named are not named. The records are the same
// whenever this is called: they carry the time of the repair, and so their ids are the same. A
// store that does not answer knows nothing. `software`: what mended the files, with its build.
RepairRecords records_of(db::Store& store, const std::vector<RepairReport>& reports,
                         const std::string& software);

}  // namespace sixpoint::repair
