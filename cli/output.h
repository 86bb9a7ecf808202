// Where a command writes: one rule for every output of every command (docs/outputs.md).
//
//   Outputs outputs(context, how, as_json);                 // how: --force
//   SIXPOINT_CHECK(outputs.input(recording));               // never written over
//   SIXPOINT_CHECK(outputs.file("--html", html));           // refused before the work begins
//   SIXPOINT_CHECK(write_file(outputs.files(), html, "a page"));  // and asked once more
//
// What a library writes through files() obeys the rule: AtomicFile asks files().placement(). An
// empty path is no output. One thread; files() for any number of them.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "cli/context.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

struct OutputOptions {
  bool force = false;  // replaces a file, but never one that holds measurements
};

// --force
void add_output_options(CLI::App& command, OutputOptions& options);

// An option that was an output and is only an input elsewhere: it is refused (64) and named is the
// one that took its place. It is not listed in --help.
void refuse_old_output(CLI::App& command, const char* name, const char* instead);

// What has the name that an output asks for. Told by content where it has one; a name that ends in
// .gt3x, .agdc or .agd is enough for a recording that is damaged.
enum class Target : std::uint8_t {
  nothing,
  plain,      // a regular file of no kind below
  recording,  // a zip archive: .gt3x, .agdc, a session too; or named as a recording
  database,   // an SQLite file: a store, an .agd; and the files that SQLite keeps beside it
  record,     // a file of a bundle, of an archive's plan, of a session's or a store's journal, of a
              // run or capture that is under way
  input,      // what this command reads
  folder,     // any
  device,     // of characters; standard output
  pipe,       // also one without a name: /dev/fd/63
  other,      // a disk, a socket
  lost_link,  // a symbolic link to nothing, or in a circle
};

// The rule. `link`: the name is a symbolic link to such a thing.
//
//   what has the name               without --force    with --force
//   nothing                         written            written
//   plain                           73, "--force"      replaced
//   plain, by a link                73, "--force"      what the link leads to is replaced
//   recording, database, record     73, another name   73, another name
//   input                           73, another name   73, another name
//   folder                          73, another name   73, another name
//   device, pipe, also by a link    written through    written through
//   other                           73, another name   73, another name
//   lost_link                       73, another name   73, another name
//
// "Written" is by a rename that replaces nothing: what comes to the name meanwhile stays.
Result<Placing> placing_of(Target target, bool force, const std::string& path);

// The rule for the folder of an output.
//
//   what has the name                    without --force    with --force
//   nothing                              made               made
//   nothing; *.gt3x, *.agdc or *.agd     64, a folder       64, a folder
//   an empty folder                      used               used
//   a bundle or the plan of an archive   73, another name   73, another name
//   another folder                       73, "--force"      used; its files by the rule above
//   anything else                        73, another name   73, another name
enum class FolderTarget : std::uint8_t {
  nothing,
  recording_name,
  empty,
  record,
  filled,
  no_folder
};
Status allow_folder(FolderTarget target, bool force, const std::string& path);

// What has the name `path`; `inputs` are those of the command.
Target look_at(FileSystem& files, const std::string& path, const std::vector<FileInfo>& inputs);
FolderTarget look_at_folder(FileSystem& files, const std::string& path);

class Outputs {
 public:
  // `json`: the command's answer is one JSON document on standard output.
  Outputs(Context& context, const OutputOptions& options, bool json);
  Outputs(const Outputs&) = delete;
  Outputs& operator=(const Outputs&) = delete;
  ~Outputs();

  // A file or folder that the command reads. One that is not there is no error here.
  Status input(const std::string& path);
  // Refuses what may not be written, and (64) two outputs of one name, and standard output for two
  // documents. `option` is for the message.
  Status file(std::string_view option, const std::string& path);
  // For a file that is read again or is a database: a device or a pipe is refused too.
  Status file_to_keep(std::string_view option, const std::string& path);
  // A new folder, whose files this command alone writes.
  Status folder(std::string_view option, const std::string& path);
  // A folder that the command goes on with (repair, archive run): it may hold anything but another
  // kind of record.
  Status working_folder(std::string_view option, const std::string& path);

  // The disk, with the rule. It lives as long as this object.
  FileSystem& files();
  Env env();

 private:
  class Files;
  Status take(std::string_view option, const std::string& path);

  Context& context_;
  bool json_;
  std::vector<std::string> taken_;
  std::unique_ptr<Files> files_;
};

}  // namespace sixpoint::cli
