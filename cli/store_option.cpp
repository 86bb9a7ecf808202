#include "station/cli/store_option.h"

#include <cstdlib>
#include <filesystem>
#include <span>

#include "base/sha256.h"

namespace sixpoint::cli {

namespace {

std::string data_folder() {
  // NOLINTBEGIN(concurrency-mt-unsafe): read once, before any thread is started.
  const char* data = std::getenv("XDG_DATA_HOME");
  if (data != nullptr && *data != '\0') {
    return std::string(data) + "/sixpoint";
  }
  const char* home = std::getenv("HOME");
  // NOLINTEND(concurrency-mt-unsafe)
  return std::string(home != nullptr ? home : ".") + "/.local/share/sixpoint";
}

}  // namespace

std::string default_store() {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): read once, before any thread is started.
  if (const char* chosen = std::getenv("SIXPOINT_STORE"); chosen != nullptr && *chosen != '\0') {
    return chosen;
  }
  return data_folder() + "/store.db";
}

namespace {

bool is_on_server(const std::string& place) { return place.find("://") != std::string::npos; }

// One name per store, whatever the folder from which it is named.
std::string journal_name(const std::string& location) {
  const std::string place = location.empty() ? default_store() : location;
  std::string name;
  if (is_on_server(place)) {
    // What follows the password, so that a changed password finds the same journal and none is
    // written to the disk.
    const std::size_t at = place.rfind('@');
    name = at == std::string::npos ? place.substr(place.find("://") + 3) : place.substr(at + 1);
  } else {
    std::error_code error;
    const auto whole = std::filesystem::weakly_canonical(place, error);
    name = error ? place : whole.string();
  }
  const auto digest =
      sha256(std::span(reinterpret_cast<const std::uint8_t*>(name.data()), name.size()));
  return to_hex(std::span(digest).first(8));
}

}  // namespace

std::string journal_folder(const std::string& location) {
  return data_folder() + "/journal/" + journal_name(location);
}

Result<db::Kept> keep_records(Context& context, const std::string& location,
                              Result<db::Store>& store,
                              const std::function<Status(db::Keeper&)>& work) {
  db::KeepingPlaces places;
  places.journal = journal_folder(location);
  const std::string name = "/sixpoint-journal-" + journal_name(location);
  places.last_resorts.push_back("." + name);
  std::error_code error;
  if (const auto folder = std::filesystem::temp_directory_path(error); !error) {
    places.last_resorts.push_back(folder.string() + name);
  }
  auto kept = db::keep(context.env.files, store, places, work);
  if (!kept || kept->in_store()) {
    if (kept && kept->caught_up > 0) {
      context.log().info("{} entries of this station's journal are in the store now",
                         kept->caught_up);
    }
    return kept;
  }
  context.log().warn("{}", kept->refusal->brief());
  if (kept->last_resort) {
    context.worsen(static_cast<int>(ErrorCode::io));
    context.log().warn(
        "nothing is lost: it is kept in {}; when there is space again, store it with 'sixpoint "
        "store catch-up --journal {}'",
        kept->folder, kept->folder);
    return kept;
  }
  if (kept->refusal->code != ErrorCode::device_unavailable) {
    context.worsen(static_cast<int>(kept->refusal->code));
  }
  context.log().warn(
      "nothing is lost: it is kept in this station's journal {}, and goes into the store before "
      "the next one, or with 'sixpoint store catch-up'",
      kept->folder);
  return kept;
}

Json kept_to_json(const db::Kept& kept) {
  return {{"in", kept.in_store() ? "store" : "journal"},
          {"folder", kept.in_store() ? Json(nullptr) : Json(kept.folder)},
          {"error", kept.refusal ? error_to_json(*kept.refusal) : Json(nullptr)}};
}

CLI::Option* add_store_option(CLI::App& command, std::string& location) {
  return command.add_option(
      "--store", location,
      "the store: an SQLite file or postgresql://... (default: $SIXPOINT_STORE or " +
          std::string("~/.local/share/sixpoint/store.db)"));
}

bool store_exists(Context& context, const std::string& location) {
  const std::string path = location.empty() ? default_store() : location;
  return is_on_server(path) || context.env.files.info(path).has_value();
}

Result<std::string> place_of_new_store(Context& context, const std::string& location) {
  const std::string path = location.empty() ? default_store() : location;
  if (location.empty() && !is_on_server(path)) {
    SIXPOINT_CHECK(context.env.files.make_folders(folder_of(path)));
  }
  return path;
}

Result<db::Store> open_store(Context& context, const std::string& location) {
  SIXPOINT_ASSIGN(const std::string path, place_of_new_store(context, location));
  return db::Store::open(context.env, path);
}

Result<db::Store> open_existing_store(Context& context, const std::string& location) {
  const std::string path = location.empty() ? default_store() : location;
  if (!store_exists(context, location)) {
    return fail(
        ErrorCode::no_input, "there is no store", path,
        "name one with --store, or make one with 'sixpoint jig' or 'sixpoint solve --save'");
  }
  return db::Store::open(context.env, path);
}

}  // namespace sixpoint::cli
