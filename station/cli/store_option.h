// --store PATH|postgresql://...: every command that touches the store takes it and opens it alike.
#pragma once

#include <functional>
#include <string>

#include <CLI/App.hpp>

#include "db/keeping.h"
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

// Is there something already? A database on a server always is.
bool store_exists(Context& context, const std::string& location);
// The path of a store that is to be made; makes the folder of the default one.
Result<std::string> place_of_new_store(Context& context, const std::string& location);

// Where a station keeps what it measured when the store at `location` did not take it: journal/ in
// $XDG_DATA_HOME/sixpoint (~/.local/share/sixpoint), one folder per store.
std::string journal_folder(const std::string& location);

// Has `work` done on the store, or on the journal in its stead (db/keeping.h); `store` as
// open_store() gave it. Where the store did not take it, people are told why and where it is now,
// and the exit code is that of the refusal; a server that is away is part of the plan, and none.
Result<db::Kept> keep_records(Context& context, const std::string& location,
                              Result<db::Store>& store,
                              const std::function<Status(db::Keeper&)>& work);
// {"in": "store" | "journal", "folder", "error"}
Json kept_to_json(const db::Kept& kept);

}  // namespace sixpoint::cli
