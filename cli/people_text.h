// What people read of the store: times by the clock on their wall, and lists in columns.
//
//   Columns list({"when", "unit", "verdict"});
//   list.row({local_time(run.started), run.serial, run.verdict});
//   context.out << list.text();  // "when                       unit  verdict\n2026-..."
//
//   next_step(context, as_json, {"repair", run.serial + ".gt3x", "-o", "repaired"});
//   // "next: sixpoint repair MOS2A45130007.gt3x -o repaired"
//   constants_text(document["constants"]);
//   // "sensitivity 230.996 229.644 223.038 LSB/g, zero 77.58 58.72 118.72 LSB"
//
// JSON has UTC (to_iso8601) and no columns.
#pragma once

#include <string>
#include <vector>

#include "base/time.h"
#include "cli/context.h"

namespace sixpoint::cli {

// "2026-11-23 20:53:03 +01:00": of the process's time zone ($TZ, else the machine's), without a
// fraction of a second. UTC with "+00:00" where the zone is not known.
std::string local_time(UtcTime time);

// Lines of columns under their names, each as wide as its widest text, two spaces apart; text() is
// empty without a row. Width is counted in characters, not bytes. A row has at most as many texts
// as there are names. Texts of others (names, reasons) come in by printable().
class Columns {
 public:
  explicit Columns(std::vector<std::string> names);
  void row(std::vector<std::string> texts);
  std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;  // the first: the names
};

// `constants` as calib::to_json() writes them; empty where it is not that.
std::string constants_text(const Json& constants);

// The address of a PostgreSQL store, also behind "--store=", without its password: what is printed or
// written is read by others. Any other word as it is.
std::string without_password(const std::string& word);

// One argument of a command line that people are told to give, as bash takes it: without a password,
// in quotes where it needs them, and what a terminal does not show as \xNN.
std::string bash_word(const std::string& given);

// The last line of a result: the command that people give next, on stderr. `words` are the command
// and its arguments, each as bash_word() has it. Nothing with --json.
void next_step(Context& context, bool as_json, const std::vector<std::string>& words);

// A path as an argument that is no option: "./-a" for "-a".
std::string path_word(const std::string& path);

// For next_step(): the paths that the user named, at most three of them.
std::vector<std::string> some_paths(const std::vector<std::string>& paths);

}  // namespace sixpoint::cli
