// What a station measured while its store's server was away.
//
// A folder with one file per entry, NUMBER-ID.json: one line of JSON with the record as the store
// would have got it. An entry is acknowledged when its file is on the medium under its name
// (written beside, synced, renamed, folder synced), so a power cut leaves it whole or not at all.
// catch_up() gives the entries to the store in the order of their numbers and removes each one
// after the store has acknowledged it. An entry that was given twice, because the power failed
// between the two, is stored once: the record's own content is its name in the store.
//
// Several programs may use one folder.
#pragma once

#include <string>
#include <vector>

#include "db/store.h"

namespace sixpoint::db {

class Journal final : public Keeper {
 public:
  // Makes the folder when it is not there.
  static Result<Journal> open(FileSystem& files, const std::string& folder);

  // Durable when they return. The same ids as the store will give.
  Result<std::string> add_constants(const ConstantsRecord& record,
                                    const std::string& model) override;
  Result<std::string> add_run(const RunRecord& run, const std::vector<Capture>& captures) override;
  Result<std::string> add_unit_write(const UnitWrite& write) override;
  Result<std::string> add_repair(const RepairRecord& repair) override;

  Result<std::size_t> pending();

  // How many entries the store took. Stops at the first that it does not take, and leaves it and
  // all later ones: order is kept. bad_data naming the file for an entry that is damaged.
  Result<std::size_t> catch_up(Store& store);

 private:
  Journal(FileSystem& files, std::string folder) : files_(&files), folder_(std::move(folder)) {}
  Result<std::string> append(const std::string& id, const nlohmann::ordered_json& entry);
  Result<std::vector<std::string>> entries();  // names in order
  FileSystem* files_;
  std::string folder_;
};

}  // namespace sixpoint::db
