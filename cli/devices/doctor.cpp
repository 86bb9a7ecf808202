// sixpoint doctor: is this machine ready?
#include <cerrno>
#include <cstring>
#include <filesystem>

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/magic.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include "base/text/counted.h"
#include "cli/command.h"
#include "cli/people_text.h"
#include "cli/store_option.h"
#include "db/journal.h"
#include "device/usb/discovery.h"
#include "device/usb/usb_errors.h"
#include "station/records/software.h"

namespace sixpoint::cli {
namespace {

// A week at 100 Hz is 280 MB; an archive repair writes several at a time.
constexpr std::uintmax_t kEnoughSpace_bytes = 2ULL << 30;

struct DoctorCommandOptions {
  std::string store;
  bool json = false;
};

struct Check {
  std::string name;
  bool ok = false;
  std::string hint;
  bool is_needed = true;  // else the machine is ready without it
};

// Why no file can be made in this folder; empty where one can. A file without a name is made where
// the disk has such files, and goes at once.
std::string why_no_file_in(const std::string& folder) {
  if (const int file = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, S_IRUSR | S_IWUSR);
      file >= 0) {
    ::close(file);
    return {};
  }
  if (errno != EOPNOTSUPP && errno != EISDIR) {
    return std::strerror(errno);
  }
  struct statfs disk {};
  const bool is_of_kernel = ::statfs(folder.c_str(), &disk) == 0 &&
                            (disk.f_type == PROC_SUPER_MAGIC || disk.f_type == SYSFS_MAGIC);
  return is_of_kernel                                 ? "it holds no files of users"
         : ::access(folder.c_str(), W_OK | X_OK) == 0 ? std::string()
                                                      : std::strerror(errno);
}

// Of a store that is not there yet. The folders of the default store are made with it.
Check check_place_of_store(const DoctorCommandOptions& options, Context& context) {
  const std::string path = options.store.empty() ? default_store() : options.store;
  std::string folder = folder_of(path);
  while (options.store.empty() && !context.env.files.info(folder) && folder != folder_of(folder)) {
    folder = folder_of(folder);
  }
  const bool leads_nowhere = context.env.files.link_info(path).has_value();
  const std::string why =
      leads_nowhere ? "it is a link that leads nowhere" : why_no_file_in(folder);
  return why.empty() ? Check{"store", true, fmt::format("{} is made at the first run", path)}
                     : Check{"store", false,
                             fmt::format("{} cannot be made: {}; name another place with --store",
                                         path, why)};
}

// Constants that were made while a clock was ahead come before all that are measured now. An hour: the
// clocks of two stations differ.
Result<std::string> constants_of_the_future(db::Store& store, UtcTime now) {
  SIXPOINT_ASSIGN(auto units, store.units_due(UtcTime::max()));
  std::erase_if(units, [&](const db::DueUnit& unit) {
    return !unit.last_constants || *unit.last_constants <= now + std::chrono::hours(1);
  });
  if (units.empty()) {
    return std::string();
  }
  const db::DueUnit& last = units.back();
  return fmt::format(
      "constants of {} are of a date in the future, those of {} of {}: a clock was ahead, or this "
      "one is behind; set it, else look at 'sixpoint history {}' and withdraw them",
      counted(units.size(), "unit"), printable(last.serial),
      to_iso8601(*last.last_constants).substr(0, 10), bash_word(last.serial));
}

Check check_store(const DoctorCommandOptions& options, Context& context) {
  if (!store_exists(context, options.store)) {
    return check_place_of_store(options, context);
  }
  // To write: one that can only be read takes no measurement.
  auto store = open_store(context, options.store);
  if (!store) {
    return {"store", false, store.error().brief()};
  }
  const auto audit = store->audit();
  if (!audit || !audit->ok) {
    return {"store", false, audit ? audit->brief() : audit.error().brief()};
  }
  const auto future = constants_of_the_future(*store, context.env.clock.now());
  if (!future || !future->empty()) {
    return {"store", false, future ? *future : future.error().brief()};
  }
  return {"store", true, audit->brief()};
}

// Are there measurements that the store did not take yet?
Check check_journal(const DoctorCommandOptions& options, Context& context) {
  const std::string own = journal_folder(options.store);
  std::vector<std::string> folders = last_resort_folders(options.store);
  folders.insert(folders.begin(), own);
  for (const std::string& folder : folders) {
    if (!context.env.files.info(folder)) {
      continue;
    }
    auto journal = db::Journal::open(context.env.files, folder);
    const auto pending = journal ? journal->pending() : Result<std::size_t>(fail(journal.error()));
    if (!pending) {
      return {"journal", false, pending.error().brief()};
    }
    if (*pending > 0) {
      return {"journal", false,
              fmt::format("{} {} in {}: run '{}{}'", counted(*pending, "entry"),
                          *pending == 1 ? "waits" : "wait", folder, catch_up_line(options.store),
                          folder == own ? "" : " --journal " + bash_word(folder))};
    }
  }
  return {"journal", true, "nothing waits for the store"};
}

Check check_disk(const std::string& folder) {
  std::error_code error;
  const auto space = std::filesystem::space(folder, error);
  if (error) {
    return {"disk", false, fmt::format("{}: {}", folder, error.message())};
  }
  return {"disk", space.available >= kEnoughSpace_bytes,
          fmt::format("{} MiB free here; repaired files need as much as the originals",
                      space.available >> 20)};
}

// A machine without USB passes: it can repair files and use virtual units.
Check check_usb() {
  std::error_code error;
  if (!std::filesystem::is_directory("/dev/bus/usb", error)) {
    return {"usb", true, "no USB on this machine; virtual units work"};
  }
  device::DiscoveryFilter every;
  every.product_ids.clear();
  const auto attached = device::attached_devices(every);
  if (!attached) {
    return {"usb", false, attached.error().brief()};
  }
  for (const device::AttachedDevice& one : *attached) {
    if (const Status access = device::check_access(one); !access) {
      return {"usb", false, access.error().brief()};
    }
  }
  return {"usb", true, fmt::format("{} of our devices plugged in", attached->size())};
}

// | rules     | user     | USB on this machine | line |
// |-----------|----------|---------------------|------|
// | installed | any      | any                 | ok   |
// | missing   | not root | yes                 | NO   |
// | missing   | not root | no                  | --   |
// | missing   | root     | any                 | --   |
//
// "--": this user needs them not yet, or not at all; exit code 0.
Check check_udev_rules() {
  std::error_code none;
  const bool is_needed = ::geteuid() != 0 && std::filesystem::is_directory("/dev/bus/usb", none);
  for (const char* rules : {device::kDetectionRules, device::kAccessRules}) {
    bool found = false;
    for (const char* folder : {"/etc/udev/rules.d/", "/run/udev/rules.d/", "/usr/lib/udev/rules.d/",
                               "/lib/udev/rules.d/"}) {
      std::error_code error;
      found = found || std::filesystem::exists(std::string(folder) + rules, error);
    }
    if (!found) {
      return {"udev", false,
              fmt::format("{} is not installed: without it only root can use units; it is in "
                          "packaging/udev",
                          rules),
              is_needed};
    }
  }
  return {"udev", true, "detection and access rules are installed"};
}

Status run_doctor(const DoctorCommandOptions& options, Context& context) {
  const std::vector<Check> checks = {
      {"version", true, station::software_name()},
      check_store(options, context),
      check_journal(options, context),
      check_disk("."),
      check_usb(),
      check_udev_rules(),
  };
  Json json = document("doctor");
  Json& list = json["checks"] = Json::array();
  std::string text;
  for (const Check& check : checks) {
    context.worsen(check.ok || !check.is_needed ? kExitPassed : kExitFailed);
    list.push_back({{"name", check.name}, {"ok", check.ok}, {"hint", check.hint}});
    const char* state = check.ok ? "ok" : check.is_needed ? "NO" : "--";
    text += fmt::format("{:<4} {:<8} {}\n", state, check.name, printable(check.hint));
  }
  return print_answer(context, options.json, json, text);
}

}  // namespace

void add_doctor(CLI::App& app, Context& context) {
  auto [command, options] = add_command<DoctorCommandOptions>(
      app, context, "doctor", "check that this machine is ready", run_doctor);
  add_store_option(command, options.store);
}

}  // namespace sixpoint::cli
