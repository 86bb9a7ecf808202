// sixpoint doctor: is this machine ready?
#include <filesystem>

#include <fmt/format.h>

#include "db/journal.h"
#include "station/cli/command.h"
#include "station/cli/store_option.h"

namespace sixpoint::cli {
namespace {

// A week at 100 Hz is 280 MB; an archive repair writes several at a time.
constexpr std::uintmax_t kEnoughSpace_bytes = 2ULL << 30;

struct Options {
  std::string store;
  bool json = false;
};

struct Check {
  std::string name;
  bool ok = false;
  std::string hint;
};

Check check_store(const Options& options, Context& context) {
  const std::string path = options.store.empty() ? default_store() : options.store;
  if (path.find("://") == std::string::npos && !context.env.files.info(path)) {
    return {"store", true, fmt::format("{} is made at the first run", path)};
  }
  auto store = open_existing_store(context, options.store);
  if (!store) {
    return {"store", false, store.error().brief()};
  }
  const auto audit = store->audit();
  if (!audit) {
    return {"store", false, audit.error().brief()};
  }
  return {"store", audit->ok, audit->brief()};
}

// What was measured and is not in the store yet.
Check check_journal(const Options& options, Context& context) {
  const std::string folder = journal_folder(options.store);
  if (!context.env.files.info(folder)) {
    return {"journal", true, "nothing waits for the store"};
  }
  auto journal = db::Journal::open(context.env.files, folder);
  const auto pending = journal ? journal->pending() : Result<std::size_t>(fail(journal.error()));
  if (!pending) {
    return {"journal", false, pending.error().brief()};
  }
  return {"journal", *pending == 0,
          *pending == 0 ? std::string("nothing waits for the store")
                        : fmt::format("{} entries wait in {}: run 'sixpoint store catch-up'",
                                      *pending, folder)};
}

Check check_disk(const std::string& folder) {
  std::error_code error;
  const auto space = std::filesystem::space(folder, error);
  if (error) {
    return {"disk", false, fmt::format("{}: {}", folder, error.message())};
  }
  return {"disk", space.available >= kEnoughSpace_bytes,
          fmt::format("{} MiB free here; mended files need as much as the originals",
                      space.available >> 20)};
}

Check check_usb() {
  std::error_code error;
  const bool there = std::filesystem::is_directory("/dev/bus/usb", error);
  return {"usb", true,
          there ? "this version drives virtual units only; USB is not built yet"
                : "no USB on this machine, and this version drives virtual units only"};
}

void run(const Options& options, Context& context) {
  const std::vector<Check> checks = {
      {"version", true, "sixpoint " SIXPOINT_VERSION},
      check_store(options, context),
      check_journal(options, context),
      check_disk("."),
      check_usb(),
  };
  Json json = document("doctor");
  json["checks"] = Json::array();
  for (const Check& check : checks) {
    context.worsen(check.ok ? kExitPassed : kExitFailed);
    json["checks"].push_back({{"name", check.name}, {"ok", check.ok}, {"hint", check.hint}});
    if (!options.json) {
      context.out << fmt::format("{:<4} {:<8} {}\n", check.ok ? "ok" : "NO", check.name,
                                 printable(check.hint));
    }
  }
  if (options.json) {
    print_json(context, json);
  }
}

}  // namespace

void add_doctor(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("doctor", "Check that this machine is ready");
  auto options = std::make_shared<Options>();
  add_store_option(*command, options->store);
  command->add_flag("--json", options->json, "One JSON document on stdout");
  command->callback([options, &context] { run(*options, context); });
}

}  // namespace sixpoint::cli
