#include "station/cli/store_option.h"

#include <cstdlib>
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

bool is_on_server(const std::string& location) {
  return (location.empty() ? default_store() : location).find("://") != std::string::npos;
}

std::string journal_folder(const std::string& location) {
  const std::string place = location.empty() ? default_store() : location;
  // Named by what follows the password, so that a changed password finds the same journal and none
  // is written to the disk.
  const std::size_t at = place.rfind('@');
  const std::string_view server = at == std::string::npos
                                      ? std::string_view(place).substr(place.find("://") + 3)
                                      : std::string_view(place).substr(at + 1);
  const auto digest =
      sha256(std::span(reinterpret_cast<const std::uint8_t*>(server.data()), server.size()));
  return data_folder() + "/journal/" + to_hex(std::span(digest).first(8));
}

CLI::Option* add_store_option(CLI::App& command, std::string& location) {
  return command.add_option(
      "--store", location,
      "the store: an SQLite file or postgresql://... (default: $SIXPOINT_STORE or " +
          std::string("~/.local/share/sixpoint/store.db)"));
}

Result<db::Store> open_store(Context& context, const std::string& location) {
  const std::string path = location.empty() ? default_store() : location;
  if (location.empty() && !is_on_server(path)) {
    SIXPOINT_CHECK(context.env.files.make_folders(folder_of(path)));
  }
  return db::Store::open(context.env, path);
}

Result<db::Store> open_existing_store(Context& context, const std::string& location) {
  const std::string path = location.empty() ? default_store() : location;
  if (path.find("://") == std::string::npos && !context.env.files.info(path)) {
    return fail(
        ErrorCode::no_input, "there is no store", path,
        "name one with --store, or make one with 'sixpoint jig' or 'sixpoint solve --save'");
  }
  return db::Store::open(context.env, path);
}

}  // namespace sixpoint::cli
