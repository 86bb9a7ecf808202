#include "station/cli/store_option.h"

#include <cstdlib>

namespace sixpoint::cli {

std::string default_store() {
  // NOLINTBEGIN(concurrency-mt-unsafe): read once, before any thread is started.
  if (const char* chosen = std::getenv("SIXPOINT_STORE"); chosen != nullptr && *chosen != '\0') {
    return chosen;
  }
  const char* data = std::getenv("XDG_DATA_HOME");
  if (data != nullptr && *data != '\0') {
    return std::string(data) + "/sixpoint/store.db";
  }
  const char* home = std::getenv("HOME");
  // NOLINTEND(concurrency-mt-unsafe)
  return std::string(home != nullptr ? home : ".") + "/.local/share/sixpoint/store.db";
}

CLI::Option* add_store_option(CLI::App& command, std::string& location) {
  return command.add_option("--store", location,
                            "the store: an SQLite file or postgresql://... (default: $SIXPOINT_STORE or " +
                                std::string("~/.local/share/sixpoint/store.db)"));
}

Result<db::Store> open_store(Context& context, const std::string& location) {
  const std::string path = location.empty() ? default_store() : location;
  if (location.empty()) {
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
