// --store PATH|postgresql://...: every command that touches the store takes it and opens it alike.
#pragma once

#include <string>

#include <CLI/App.hpp>

#include "db/store.h"
#include "station/cli/command.h"

namespace sixpoint::cli {

// The default is $SIXPOINT_STORE, else store.db in $XDG_DATA_HOME/sixpoint
// (~/.local/share/sixpoint).
CLI::Option* add_store_option(CLI::App& command, std::string& location);
std::string default_store();

// Makes the folder of the default store; another one must be there.
Result<db::Store> open_store(Context& context, const std::string& location);

// For reading only: no_input where there is no store yet, instead of an empty new one.
Result<db::Store> open_existing_store(Context& context, const std::string& location);

// Where a station keeps what it measured while the server of `location` was away: journal/ in
// $XDG_DATA_HOME/sixpoint (~/.local/share/sixpoint), one folder per server and database.
std::string journal_folder(const std::string& location);
bool is_on_server(const std::string& location);

}  // namespace sixpoint::cli
