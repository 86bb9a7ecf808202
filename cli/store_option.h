// --store PATH|postgresql://...: how every command names, opens and writes the store.
//
//   add_store_option(command, location);
//   SIXPOINT_ASSIGN(auto store, open_existing_store(context, location));  // to read
//   Result<db::Store> written = open_store(context, location);            // to write
//   SIXPOINT_ASSIGN(const auto saved, keep_records(context, location, written, add_the_records));
//
// A location is a path of an SQLite file or the address of a server; empty stands for the default:
// $SIXPOINT_STORE, else store.db in $XDG_DATA_HOME/sixpoint (~/.local/share/sixpoint;
// without $HOME that of the user's entry in passwd).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calib/constants.h"
#include "calib/solve.h"
#include "cli/context.h"
#include "db/save.h"
#include "station/capture/capture_run.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace sixpoint::cli {

CLI::Option* add_store_option(CLI::App& command, std::string& location);

// Opens the store and makes it where it is missing. Only the folder of the default store is made.
Result<db::Store> open_store(Context& context, const std::string& location);

// Says before the work that the store is away or cannot be made; what is measured is kept all the
// same (keep_records()).
void warn_without_store(Context& context, const Result<db::Store>& store);

// To read: no_input where there is no store, bad_data where the file is empty, so that a wrong name
// makes no empty one.
Result<db::Store> open_existing_store(Context& context, const std::string& location);

// The serial number as the store has it: as given where it knows such a unit, else in the capitals of
// a unit's (gt3x/forms/model.h).
std::string stored_serial(db::Store& store, const std::string& given);

// Is there a file? A store on a server always exists.
bool store_exists(Context& context, const std::string& location);
// The path of a store that is to be made; makes the folder of the default one.
Result<std::string> place_of_new_store(Context& context, const std::string& location);

// The user's folder for the program's data: $XDG_DATA_HOME/sixpoint (~/.local/share/sixpoint).
std::string data_folder();
// Of the store where none is named.
std::string default_store();
// The file of the store at `location`; empty for a store on a server.
std::string store_file(const std::string& location);
// Names the folder of a run under way: `who` (a unit, a station) and the store that it goes into.
std::string run_folder_name(const std::string& location, const std::string& who);

// The folder of the station's own memory (station/records/station_guard.h), one for each store.
std::string guard_folder(const std::string& location);

// The folder of the journal: it keeps what the store at `location` did not take. One folder per
// store, in journal/ of data_folder().
std::string journal_folder(const std::string& location);

// The command that stores what waits in that journal.
std::string catch_up_line(const std::string& location);

// For next_step(): the command's words, with --store where `location` was named.
std::vector<std::string> with_store(std::vector<std::string> words, const std::string& location);

// Where records go when not even the journal takes them. A command has nothing but its last resorts,
// ./sixpoint-journal-... and the same in the temporary folder; one that is another user's, or a link,
// is none. The station takes none: its temporary folder ends with it, and it keeps the run in its
// state folder and tries again.
enum class LastResort : std::uint8_t { folders, none };

// The folders of the last resorts of the store at `location`, in their order; each need not be there.
std::vector<std::string> last_resort_folders(const std::string& location);

// Calls `work` with the store, or with the journal where the store fails (db/save.h). `store` is
// the result of open_store().
//
//   where the records are     reported as       exit code
//   in the store              -                 0
//   journal, server is away   warning           0: this is planned for
//   journal, other reasons    warning           the store's error
//   journal of last resort    warning           74
Result<db::Saved> keep_records(Context& context, const std::string& location,
                               Result<db::Store>& store,
                               const std::function<Status(db::RecordWriter&)>& work,
                               LastResort last_resort = LastResort::folders);
// "stored as 3cb89c474fa2"; "kept in the journal as ..." where the store took nothing.
std::string kept_as(const db::Saved& kept, const std::string& id);
// {"in": "store" | "journal", "folder", "error"}
Json kept_to_json(const db::Saved& kept);

// Warns where constants that are in the store now are not those that apply, or where another set
// disagrees with them (said_of_stored() in repair/rescale/applying_constants.h). Returns the words.
Result<std::string> warn_of_stored(Context& context, db::Store& store, const std::string& serial,
                                   calib::FilterConfiguration filter, const std::string& id);

// Constants as a file (empty: none).
Status write_constants(FileSystem& files, const std::string& path,
                       const calib::ConstantsRecord& record);

// A set of constants that is in the store or in the journal.
struct SavedConstants {
  std::string id;
  db::Saved place;
  std::optional<Error> file_problem = std::nullopt;  // why their file was not written
  std::string said = {};                             // by warn_of_stored()
};
// Also written to the file `path` of `files`. Neither stops the other.
Result<SavedConstants> save_constants(Context& context, FileSystem& files,
                                      const std::string& location, Result<db::Store>& store,
                                      const calib::ConstantsRecord& record,
                                      const std::string& model, const std::string& path,
                                      LastResort last_resort = LastResort::folders);
// The same with those of a calibration file that was made just now, and the files of `env`.
Result<SavedConstants> save_capture(Context& context, const Env& env, const std::string& location,
                                    Result<db::Store>& store, const station::CaptureReport& report,
                                    const std::string& path,
                                    LastResort last_resort = LastResort::folders);

}  // namespace sixpoint::cli
