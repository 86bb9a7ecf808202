#include "db/keeping.h"

#include <fmt/format.h>

#include "db/journal.h"

namespace sixpoint::db {
namespace {

Status keep_in_store(FileSystem& files, Result<Store>& store, const std::string& folder,
                     const std::function<Status(Keeper&)>& work, Kept& kept) {
  if (!store) {
    return fail(store.error());
  }
  if (files.info(folder)) {
    SIXPOINT_ASSIGN(auto journal, Journal::open(files, folder));
    SIXPOINT_ASSIGN(kept.caught_up, journal.catch_up(*store));
  }
  return work(*store);
}

Status keep_in_folder(FileSystem& files, const std::string& folder,
                      const std::function<Status(Keeper&)>& work) {
  SIXPOINT_ASSIGN(auto journal, Journal::open(files, folder));
  return work(journal);
}

}  // namespace

Result<Kept> keep(FileSystem& files, Result<Store>& store, const KeepingPlaces& places,
                  const std::function<Status(Keeper&)>& work) {
  Kept kept;
  const Status stored = keep_in_store(files, store, places.journal, work, kept);
  if (stored) {
    return kept;
  }
  kept.refusal = stored.error();
  const Status journalled = keep_in_folder(files, places.journal, work);
  if (journalled) {
    kept.folder = places.journal;
    return kept;
  }
  if (journalled.error().code == ErrorCode::bad_data) {
    return fail(journalled.error());  // the record itself: no folder makes it better
  }
  for (const std::string& folder : places.last_resorts) {
    if (keep_in_folder(files, folder, work)) {
      kept.folder = folder;
      kept.last_resort = true;
      kept.refusal->what += fmt::format("; nor does the journal: {}", journalled.error().brief());
      return kept;
    }
  }
  return fail(ErrorCode::io,
              fmt::format("what was measured could not be kept anywhere: {}; {}",
                          kept.refusal->brief(), journalled.error().brief()),
              places.journal, "free some space on the disk or make the folder writable");
}

}  // namespace sixpoint::db
