// What the store records about files that were repaired: each file once, however often it is asked.
//
//   const RepairRecords made = records_of(store, reports, "sixpoint 1.0.0");
//   for (const auto& record : made.records) SIXPOINT_CHECK(store.add_repair(record));
//
// | report                                                       | record                         |
// |--------------------------------------------------------------|--------------------------------|
// | not `repaired`, or a dry run                                 | none                           |
// | a serial number or text that no store takes                  | none; named in `refused`       |
// | the store has a repair with this output and this input       | none: it is known              |
// | its constants are in the store                               | with their id                  |
// | its constants are of another store                           | without constants              |
#pragma once

#include <string>
#include <vector>

#include "db/store.h"
#include "repair/rescale/repair_file.h"
#include "repair/triage/file_tree.h"

namespace sixpoint::repair {

struct RepairRecords {
  std::vector<db::RepairRecord> records;  // what `store` does not know yet
  std::vector<RefusedPath> refused;       // repaired files that no store takes, and why
};

// The records are the same whenever this is called: they carry the time of the repair, and so their
// ids are the same. A store that does not answer knows nothing. `software`: the program that
// repaired the files, with its build.
RepairRecords records_of(db::Store& store, const std::vector<RepairReport>& reports,
                         const std::string& software);

}  // namespace sixpoint::repair
