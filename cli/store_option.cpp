#include "cli/store_option.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string_view>

#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "base/text/counted.h"
#include "cli/command.h"
#include "cli/people_text.h"
#include "db/records.h"
#include "gt3x/forms/model.h"
#include "repair/rescale/applying_constants.h"
#include "station/records/run_records.h"

namespace sixpoint::cli {

std::string data_folder() {
  // NOLINTBEGIN(concurrency-mt-unsafe): read once, before any thread is started.
  const char* data = std::getenv("XDG_DATA_HOME");
  if (data != nullptr && *data != '\0') {
    return std::string(data) + "/sixpoint";
  }
  const char* home = std::getenv("HOME");
  if (home == nullptr || *home == '\0') {
    // A service, or a shell that was cleaned: the folder that the system has for this user.
    const passwd* user = ::getpwuid(::getuid());
    home = user != nullptr ? user->pw_dir : "/nonexistent";
  }
  // NOLINTEND(concurrency-mt-unsafe)
  return std::string(home) + "/.local/share/sixpoint";
}

std::string default_store() {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): read once, before any thread is started.
  if (const char* chosen = std::getenv("SIXPOINT_STORE"); chosen != nullptr && *chosen != '\0') {
    return chosen;
  }
  return data_folder() + "/store.db";
}

namespace {

std::string place_of(const std::string& location) {
  return location.empty() ? default_store() : location;
}

bool is_on_server(const std::string& place) { return place.find("://") != std::string::npos; }

// host:port/database, and what the settings behind '?' say of these. Without user and password: a
// changed password must find the same journal.
std::string place_on_server(const std::string& address) {
  const std::size_t begin = address.find("://") + 3;
  const std::size_t settings = std::min(address.find('?', begin), address.size());
  const std::string place = address.substr(begin, settings - begin);
  std::string name = place.substr(place.rfind('@') + 1);  // npos + 1 is 0
  std::istringstream rest(address.substr(settings));
  for (std::string setting; std::getline(rest, setting, '&');) {
    setting.erase(0, setting.starts_with('?') ? 1 : 0);
    for (const std::string_view key : {"host=", "hostaddr=", "port=", "dbname="}) {
      if (setting.starts_with(key)) {
        name += "&" + setting;
      }
    }
  }
  return name;
}

// One name per store, also where it is named from another folder.
std::string store_name(const std::string& location) {
  const std::string place = place_of(location);
  if (is_on_server(place)) {
    return text_sha256(place_on_server(place)).substr(0, 16);
  }
  std::error_code error;
  const auto whole =
      std::filesystem::weakly_canonical(std::filesystem::absolute(place, error), error);
  return text_sha256(error ? place : whole.string()).substr(0, 16);
}

}  // namespace

std::string store_file(const std::string& location) {
  std::string place = place_of(location);
  return is_on_server(place) ? std::string() : place;
}

std::string run_folder_name(const std::string& location, const std::string& who) {
  return text_sha256(store_name(location) + "\n" + who).substr(0, 12);
}

std::string guard_folder(const std::string& location) {
  return data_folder() + "/station/memory-" + store_name(location);
}

std::string journal_folder(const std::string& location) {
  return data_folder() + "/journal/" + store_name(location);
}

std::string catch_up_line(const std::string& location) {
  return "sixpoint store catch-up" + (location.empty() ? "" : " --store " + bash_word(location));
}

std::vector<std::string> with_store(std::vector<std::string> words, const std::string& location) {
  if (!location.empty()) {
    words.insert(words.end(), {"--store", location});
  }
  return words;
}

namespace {

// The temporary folder is everybody's, and the name can be foreseen: another user may have made it.
bool is_nobody_elses(const std::string& folder) {
  struct stat there {};
  return ::lstat(folder.c_str(), &there) != 0 ||
         (S_ISDIR(there.st_mode) && there.st_uid == ::geteuid());
}

db::SavePlaces save_places(const std::string& location, LastResort last_resort) {
  db::SavePlaces places;
  places.journal = journal_folder(location);
  if (last_resort == LastResort::none) {
    return places;
  }
  places.last_resorts = last_resort_folders(location);
  return places;
}

}  // namespace

std::vector<std::string> last_resort_folders(const std::string& location) {
  const std::string name = "/sixpoint-journal-" + store_name(location);
  std::vector<std::string> folders = {"." + name};
  std::error_code error;
  if (const auto folder = std::filesystem::temp_directory_path(error); !error) {
    folders.push_back(folder.string() + name);
  }
  std::erase_if(folders, [](const std::string& folder) { return !is_nobody_elses(folder); });
  return folders;
}

Result<db::Saved> keep_records(Context& context, const std::string& location,
                               Result<db::Store>& store,
                               const std::function<Status(db::RecordWriter&)>& work,
                               LastResort last_resort) {
  const db::SavePlaces places = save_places(location, last_resort);
  auto kept = db::save(context.env.files, store, places, work);
  if (!kept || kept->in_store()) {
    if (kept && kept->caught_up > 0) {
      context.log().info("in the store now from this station's journal: {}",
                         counted(kept->caught_up, "entry"));
    }
    return kept;
  }
  // Without its hint: it would say to do the work again.
  context.log().warn(
      "{}", Error{kept->refusal->code, kept->refusal->what, kept->refusal->where, {}}.brief());
  if (kept->last_resort) {
    context.worsen(ErrorCode::io);
    context.log().warn(
        "nothing is lost: it is kept in {}; when the store can be written again, store it with '{} "
        "--journal {}'",
        kept->folder, catch_up_line(location), bash_word(kept->folder));
    return kept;
  }
  if (kept->refusal->code != ErrorCode::device_unavailable) {
    context.worsen(kept->refusal->code);
  }
  context.log().warn(
      "nothing is lost: it is kept in this station's journal {}, and goes into the store before "
      "the next one, or with '{}'",
      kept->folder, catch_up_line(location));
  return kept;
}

std::string kept_as(const db::Saved& kept, const std::string& id) {
  return fmt::format("{} as {}", kept.in_store() ? "stored" : "kept in the journal",
                     db::shown_id(id));
}

Json kept_to_json(const db::Saved& kept) {
  return {{"in", kept.in_store() ? "store" : "journal"},
          {"folder", text_or_null(kept.folder)},
          {"error", kept.refusal ? error_to_json(*kept.refusal) : Json(nullptr)}};
}

Result<std::string> warn_of_stored(Context& context, db::Store& store, const std::string& serial,
                                   calib::FilterConfiguration filter, const std::string& id) {
  SIXPOINT_ASSIGN(const auto history, store.constants_history(serial));
  std::string said = repair::said_of_stored(history, filter, id, context.env.clock.now());
  if (!said.empty()) {
    context.log().warn("{}", said);
  }
  return said;
}

Status write_constants(FileSystem& files, const std::string& path,
                       const calib::ConstantsRecord& record) {
  return path.empty() ? Status() : write_file(files, path, calib::to_json(record).dump(2) + "\n");
}

namespace {

Result<SavedConstants> save_in_store(Context& context, const std::string& location,
                                     Result<db::Store>& store, const calib::ConstantsRecord& record,
                                     const std::string& model, LastResort last_resort) {
  SavedConstants done;
  const auto work = [&](db::RecordWriter& writer) -> Status {
    SIXPOINT_ASSIGN(done.id, writer.add_constants(station::constants_row(record), model));
    return {};
  };
  SIXPOINT_ASSIGN(done.place, keep_records(context, location, store, work, last_resort));
  if (done.place.in_store()) {
    SIXPOINT_ASSIGN(done.said,
                    warn_of_stored(context, *store, record.serial, record.filter, done.id));
  }
  return done;
}

}  // namespace

Result<SavedConstants> save_constants(Context& context, FileSystem& files,
                                      const std::string& location, Result<db::Store>& store,
                                      const calib::ConstantsRecord& record,
                                      const std::string& model, const std::string& path,
                                      LastResort last_resort) {
  auto saved = save_in_store(context, location, store, record, model, last_resort);
  Status written = write_constants(files, path, record);
  if (!saved) {
    if (!written) {
      report_error(context, written.error());
    }
    return saved;
  }
  if (!written) {
    saved->file_problem = std::move(written).error();
  }
  return saved;
}

Result<SavedConstants> save_capture(Context& context, const Env& env, const std::string& location,
                                    Result<db::Store>& store, const station::CaptureReport& report,
                                    const std::string& path, LastResort last_resort) {
  calib::ConstantsOrigin origin;
  origin.sha256 = report.file_sha256;
  origin.file = db::storable_path(file_name_of(report.file));
  origin.kind = "calibration_file";
  SIXPOINT_ASSIGN(const auto record, calib::record_of(*report.solved, env.clock.now(), origin));
  return save_constants(context, env.files, location, store, record,
                        std::string(gt3x::model_of(record.serial)), path, last_resort);
}

CLI::Option* add_store_option(CLI::App& command, std::string& location) {
  return command.add_option(
      "--store", location,
      "the store: an SQLite file or postgresql://... (default: $SIXPOINT_STORE or " +
          std::string("~/.local/share/sixpoint/store.db)"));
}

std::string stored_serial(db::Store& store, const std::string& given) {
  return store.whole_key("units", given) ? given : gt3x::unit_serial(given);
}

bool store_exists(Context& context, const std::string& location) {
  const std::string path = place_of(location);
  return is_on_server(path) || context.env.files.info(path).has_value();
}

Result<std::string> place_of_new_store(Context& context, const std::string& location) {
  const std::string path = place_of(location);
  if (location.empty() && !is_on_server(path)) {
    SIXPOINT_CHECK(make_private_folders(context.env.files, folder_of(path)));
  }
  return path;
}

Result<db::Store> open_store(Context& context, const std::string& location) {
  SIXPOINT_ASSIGN(const std::string path, place_of_new_store(context, location));
  return db::Store::open(context.env, path);
}

void warn_without_store(Context& context, const Result<db::Store>& store) {
  if (!store) {
    context.log().warn("the store cannot be used now: {}; what is measured is kept in a journal",
                       store.error().brief());
  }
}

Result<db::Store> open_existing_store(Context& context, const std::string& location) {
  const std::string path = place_of(location);
  if (!store_exists(context, location)) {
    return fail(
        ErrorCode::no_input, "there is no store", path,
        "name one with --store, or make one with 'sixpoint jig' or 'sixpoint solve --save'");
  }
  // Opening it would make a store of an empty file; a store that was just made may still be in its
  // log alone.
  FileSystem& files = context.env.files;
  const auto is_empty = [&files](const std::string& name) {
    const auto info = files.info(name);
    return !info || (info->kind == FileKind::file && info->size == 0);
  };
  if (!is_on_server(path) && is_empty(path) && is_empty(path + "-wal")) {
    return fail(ErrorCode::bad_data, "this file is empty: it is no store", path,
                "if it was one, keep the file and restore the last backup");
  }
  auto store = db::Store::open_existing(context.env, path);
  if (store || store.error().code != ErrorCode::permission) {
    return store;
  }
  // It may not be written: what only reads it goes on, and a write says so.
  auto to_read = db::Store::open_to_read(context.env, path);
  const bool says_more = to_read || to_read.error().code == ErrorCode::configuration;
  return says_more ? std::move(to_read) : std::move(store);
}
}  // namespace sixpoint::cli
