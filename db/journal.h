// What a station measured while its store's server was away.
//
//   SIXPOINT_ASSIGN(auto journal, Journal::open(env.files, "journal"));
//   SIXPOINT_CHECK(journal.add_run(run, captures));   // durable when it returns
//   SIXPOINT_CHECK(journal.catch_up(store));          // later
//
// A folder with one file per entry, NUMBER-ID.json: one line of JSON with the rows that the store
// would have added, in the form of an export (export_json.h). An entry is acknowledged when its
// file is on the medium under its name (written beside, synced, renamed, folder synced), so a power
// cut leaves it whole or not at all. catch_up() gives the entries to the store in the order of
// their numbers and removes each one after the store has acknowledged it. An entry that was given
// twice, because the power failed between the two, is stored once: the row's own content is its
// key.
//
// Several programs may use one folder. Entries of earlier versions ("sixpoint/journal-entry/1",
// the record with its own keys instead of rows) are read too.
#pragma once

#include <string>
#include <vector>

#include "db/store.h"

namespace sixpoint::db {

class Journal final : public RecordWriter {
 public:
  // Makes the folder when it is not there.
  static Result<Journal> open(FileSystem& files, const std::string& folder);

  // Durable when it returns. The same id as the store will give.
  Result<std::string> add(NewRows rows) override;

  Result<std::size_t> pending();
  // Whether the record of this id waits in `folder`, which need not be there.
  static Result<bool> holds(FileSystem& files, const std::string& folder, const std::string& id);

  // How many entries the store took. Stops at the first that it does not take, and leaves it and
  // all later ones: order stays. bad_data naming the file for an entry that is damaged.
  Result<std::size_t> catch_up(Store& store);

 private:
  Journal(FileSystem& files, std::string folder) : files_(&files), folder_(std::move(folder)) {}
  Result<std::vector<std::string>> entries();  // names in order
  Status give(const std::string& path, const Bytes& entry, Store& store);
  FileSystem* files_;
  std::string folder_;
};

}  // namespace sixpoint::db
