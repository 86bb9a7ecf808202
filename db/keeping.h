// Keeping what was measured, whatever the store answers.
//
// A measurement cannot be made again when the unit is back at its customer. So the work of storing
// it is done on the store and, when that fails for whatever reason (its server is away, a wrong
// password, a full disk, a damaged file, an entry of the journal that it does not take), on the
// journal, which every later keep() and 'sixpoint store catch-up' empty in order. Where not even
// the journal's disk takes it, it is done on a journal in a folder of last resort.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "db/store.h"

namespace sixpoint::db {

struct KeepingPlaces {
  std::string journal;                    // a folder, made when it is needed
  std::vector<std::string> last_resorts;  // folders that are tried one after the other
};

struct Kept {
  // Where it is: empty for the store, else the folder of the journal.
  std::string folder;
  bool last_resort = false;      // `folder` is not one that a later keep() looks into
  std::optional<Error> refusal;  // of the store; of the journal's disk with `last_resort`
  std::size_t caught_up = 0;     // earlier entries of the journal that the store took before

  bool in_store() const { return folder.empty(); }
};

// `store` as Store::open() gave it, or its error. `work` adds the records; it may be called again
// with another keeper after it failed, and must then add at least what was not acknowledged (the
// same record twice is stored once). Fails only when no place took it: with `io` and the words of
// store and journal, or with bad_data for records that no store can take. What waits in the
// journal goes into the store before `work`, so that the order of the measurements is kept.
Result<Kept> keep(FileSystem& files, Result<Store>& store, const KeepingPlaces& places,
                  const std::function<Status(Keeper&)>& work);

}  // namespace sixpoint::db
