// Saving what was measured, in the store or beside it.
//
//   SIXPOINT_ASSIGN(const Saved saved,
//                   save(env.files, store, {"journal", {"/tmp/sixpoint"}},
//                        [&](RecordWriter& writer) -> Status {
//                          SIXPOINT_CHECK(writer.add_run(run, captures));
//                          return {};
//                        }));
//   saved.in_store();
//
// A measurement cannot be made again when the unit is back at its customer. So a store that does
// not take it is no reason to lose it:
//
// | the store                                | the journal  | the records go to               |
// |------------------------------------------|--------------|---------------------------------|
// | takes the journal's entries and the work | -            | the store                       |
// | fails: server away, wrong password, full | takes them   | the journal                     |
// | disk, damaged file, refuses an entry     |              |                                 |
// | fails                                    | fails        | the first last resort that      |
// |                                          |              | takes them, else error `io`     |
// | refuses the record itself                | refuses it   | nowhere: error `bad_data`       |
//
// Every later save() and 'sixpoint store catch-up' empty the journal, in order.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "db/store.h"

namespace sixpoint::db {

struct SavePlaces {
  std::string journal;                    // a folder, made when it is needed
  std::vector<std::string> last_resorts;  // folders that are tried one after the other
};

struct Saved {
  // Where it is: empty for the store, else the folder of the journal.
  std::string folder;
  bool last_resort = false;      // `folder` is not the one that a later save() empties
  std::optional<Error> refusal;  // of the store; with `last_resort`, of the journal's disk
  std::size_t caught_up = 0;     // earlier entries of the journal that the store took before

  bool in_store() const { return folder.empty(); }
};

// `store` as Store::open() gave it, or its error. `work` adds the records; it may be called again
// with another writer after it failed, and must then add at least what was not acknowledged (the
// same record twice is stored once). What waits in the journal goes into the store before `work`,
// so that the order of the measurements stays.
Result<Saved> save(FileSystem& files, Result<Store>& store, const SavePlaces& places,
                   const std::function<Status(RecordWriter&)>& work);

}  // namespace sixpoint::db
