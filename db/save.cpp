#include "db/save.h"

#include <fmt/format.h>

#include "db/journal.h"

namespace sixpoint::db {
namespace {

using Work = std::function<Status(RecordWriter&)>;

Status save_in_store(FileSystem& files, Result<Store>& store, const std::string& folder,
                     const Work& work, std::size_t& caught_up) {
  if (!store) {
    return fail(store.error());
  }
  if (files.info(folder)) {
    SIXPOINT_ASSIGN(auto journal, Journal::open(files, folder));
    SIXPOINT_ASSIGN(caught_up, journal.catch_up(*store));
  }
  return work(*store);
}

Status save_in_folder(FileSystem& files, const std::string& folder, const Work& work) {
  SIXPOINT_ASSIGN(auto journal, Journal::open(files, folder));
  return work(journal);
}

}  // namespace

Result<Saved> save(FileSystem& files, Result<Store>& store, const SavePlaces& places,
                   const Work& work) {
  Saved saved;
  const Status stored = save_in_store(files, store, places.journal, work, saved.caught_up);
  if (stored) {
    return saved;
  }
  saved.refusal = stored.error();
  const Status journalled = save_in_folder(files, places.journal, work);
  if (journalled) {
    saved.folder = places.journal;
    return saved;
  }
  if (journalled.error().code == ErrorCode::bad_data) {
    return fail(journalled.error());  // the record itself: no folder makes it better
  }
  for (const std::string& folder : places.last_resorts) {
    const bool was_there = files.info(folder).has_value();
    const Status kept = save_in_folder(files, folder, work);
    if (!kept && !was_there) {
      static_cast<void>(files.remove(folder));  // made for nothing; it stays where it holds a file
    }
    if (kept) {
      saved.folder = folder;
      saved.last_resort = true;
      saved.refusal->what += fmt::format("; the journal {} cannot be written either: {}",
                                         journalled.error().where, journalled.error().what);
      return saved;
    }
  }
  return fail(ErrorCode::io,
              fmt::format("what was measured could not be kept anywhere: {}; {}",
                          saved.refusal->brief(), journalled.error().brief()),
              places.journal, "free some space on the disk or make the folder writable");
}

}  // namespace sixpoint::db
