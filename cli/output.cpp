#include "cli/output.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>

#include <CLI/App.hpp>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "base/forwarding_files.h"
#include "repair/archive/record_folder.h"

namespace sixpoint::cli {

void add_output_options(CLI::App& command, OutputOptions& options) {
  command.add_flag("--force", options.force,
                   "replace a file that an output names; never a recording, a store, a bundle or a "
                   "session (docs/outputs.md)");
}

void refuse_old_output(CLI::App& command, const char* name, const char* instead) {
  command
      .add_option_function<std::string>(
          name,
          [name, instead](const std::string&) {
            throw CLI::ValidationError(name, fmt::format("only names what is read; use {} for what "
                                                         "is written",
                                                         instead));
          })
      ->group("");
}

namespace {

using repair::beginning_of;
using repair::has_schema;

constexpr std::string_view kAnotherName = "choose another name";
constexpr std::string_view kForce = "choose another name, or replace it with --force";

tl::unexpected<Error> refused(std::string_view what, const std::string& path,
                              std::string_view hint) {
  return fail(ErrorCode::cannot_create, fmt::format("{}; it stays as it is", what), path,
              std::string(hint));
}

bool is_standard_output(const std::string& path) {
  return path == "-" || path == "/dev/stdout" || path == "/dev/fd/1" || path == "/proc/self/fd/1";
}

bool same_file(const FileInfo& a, const FileInfo& b) {
  return a.inode != 0 && a.inode == b.inode && a.device == b.device;
}

bool is_database(std::string_view beginning) {
  return beginning.starts_with(std::string_view("SQLite format 3\0", 16));
}

// The files that SQLite keeps beside a database while it is open, or after a crash.
bool belongs_to_database(FileSystem& files, const std::string& path) {
  for (const std::string_view suffix : {"-wal", "-shm", "-journal"}) {
    if (path.ends_with(suffix) &&
        is_database(beginning_of(files, path.substr(0, path.size() - suffix.size())))) {
      return true;
    }
  }
  return false;
}

// The folder of a run or a capture that goes on (station/lanes/run_folder.h).
bool is_under_way(FileSystem& files, const std::string& folder) {
  return has_schema(beginning_of(files, folder + "/run.json"), "unfinished-run") ||
         has_schema(beginning_of(files, folder + "/capture.json"), "unfinished-capture");
}

bool belongs_to_record(FileSystem& files, const std::string& path, std::string_view beginning) {
  constexpr std::array<std::string_view, 5> kRecords = {"bundle", "archive-plan", "archive-output",
                                                        "session-journal", "journal-entry"};
  constexpr std::array<std::string_view, 2> kOfBundle = {"temperature.csv", "host_clock.csv"};
  const std::string folder = folder_of(path);
  return std::any_of(kRecords.begin(), kRecords.end(),
                     [&](std::string_view name) { return has_schema(beginning, name); }) ||
         (std::find(kOfBundle.begin(), kOfBundle.end(), file_name_of(path)) != kOfBundle.end() &&
          repair::is_bundle(files, folder)) ||
         is_under_way(files, folder) || repair::is_plan(files, folder) ||
         repair::is_plan(files, folder + "/..");
}

bool is_recording_name(std::string_view path) {
  return path.ends_with(".gt3x") || path.ends_with(".agdc") || path.ends_with(".agd");
}

// Of a regular file that is no input; `named` may be a link to it.
Target look_at_content(FileSystem& files, const std::string& named) {
  const std::string path = files.real_path(named).value_or(named);
  // The files beside a database first: opening and closing one would end SQLite's locks on it.
  if (belongs_to_database(files, path)) {
    return Target::database;
  }
  const std::string beginning = beginning_of(files, path);
  if (is_database(beginning)) {
    return Target::database;
  }
  if (is_recording_name(path) || beginning.starts_with("PK\x03\x04") ||
      beginning.starts_with("PK\x05\x06")) {
    return Target::recording;
  }
  return belongs_to_record(files, path, beginning) ? Target::record : Target::plain;
}

}  // namespace

Result<Placing> placing_of(Target target, bool force, const std::string& path) {
  switch (target) {
    case Target::nothing:
      return Placing::keep;
    case Target::plain:
      if (force) {
        return Placing::replace;
      }
      return refused("the file exists", path, kForce);
    case Target::recording:
      return refused("this is a recording, a session or another archive", path, kAnotherName);
    case Target::database:
      return refused("this is a store or another database", path, kAnotherName);
    case Target::record:
      return refused("this is a part of a bundle, of a plan, of a journal or of a run under way",
                     path, kAnotherName);
    case Target::input:
      return refused("this is what the command reads", path, kAnotherName);
    case Target::folder:
      return refused("this is a folder", path, kAnotherName);
    case Target::device:
    case Target::pipe:
      return Placing::through;
    case Target::other:
      return refused("this is a disk or a socket", path, kAnotherName);
    case Target::lost_link:
      return refused("this is a symbolic link that leads nowhere", path, kAnotherName);
  }
  return refused("this is nothing that is known", path, kAnotherName);
}

Status allow_folder(FolderTarget target, bool force, const std::string& path) {
  switch (target) {
    case FolderTarget::nothing:
    case FolderTarget::empty:
      return {};
    case FolderTarget::recording_name:
      return fail(ErrorCode::usage, "the output is a folder, and this is the name of a recording",
                  path, "name a folder, for example 'repaired'");
    case FolderTarget::record:
      return refused("this is a bundle or the plan of an archive", path, kAnotherName);
    case FolderTarget::filled:
      if (force) {
        return {};
      }
      return refused("this folder is not empty", path,
                     "choose another name, or use it all the same with --force");
    case FolderTarget::no_folder:
      break;
  }
  return refused("this is no folder", path, kAnotherName);
}

Target look_at(FileSystem& files, const std::string& path, const std::vector<FileInfo>& inputs) {
  if (is_standard_output(path)) {
    return Target::device;
  }
  const auto info = files.info(path);
  if (!info) {
    return files.link_info(path) ? Target::lost_link : Target::nothing;
  }
  if (std::any_of(inputs.begin(), inputs.end(),
                  [&](const FileInfo& input) { return same_file(input, *info); })) {
    return info->is_folder ? Target::folder : Target::input;
  }
  switch (info->kind) {
    case FileKind::file:
      return look_at_content(files, path);
    case FileKind::folder:
      return Target::folder;
    case FileKind::device:
      return Target::device;
    case FileKind::pipe:
      return Target::pipe;
    case FileKind::disk:
    case FileKind::socket:
      break;
  }
  return Target::other;
}

FolderTarget look_at_folder(FileSystem& files, const std::string& path) {
  const auto info = files.info(path);
  if (!info) {
    if (files.link_info(path)) {
      return FolderTarget::no_folder;
    }
    return is_recording_name(path) ? FolderTarget::recording_name : FolderTarget::nothing;
  }
  if (!info->is_folder) {
    return FolderTarget::no_folder;
  }
  const auto names = files.list(path);
  if (names && names->empty()) {
    return FolderTarget::empty;
  }
  return repair::is_bundle(files, path) || repair::is_plan(files, path) ? FolderTarget::record
                                                                        : FolderTarget::filled;
}

namespace {

// Standard output as a file: the bytes go where the program's answers go.
class StandardOutput final : public WritableFile {
 public:
  explicit StandardOutput(std::ostream& out) : out_(out) {}
  Status write_at(std::uint64_t /*offset*/, std::span<const std::uint8_t> bytes) override {
    const std::string_view text = as_text(bytes);
    out_.write(text.data(), static_cast<std::streamsize>(text.size()));
    return state();
  }
  Result<std::size_t> read_at(std::uint64_t /*offset*/, std::span<std::uint8_t> /*out*/) override {
    return std::size_t{0};
  }
  Status sync() override {
    out_.flush();
    return state();
  }
  Status close() override { return state(); }

 private:
  Status state() const {
    return out_ ? Status()
                : Status(fail(ErrorCode::io, "standard output could not be written", {},
                              "check the program that reads it"));
  }
  std::ostream& out_;
};

}  // namespace

// The disk, with the rule on top.
class Outputs::Files final : public ForwardingFiles {
 public:
  Files(Context& context, bool force)
      : ForwardingFiles(context.env.files), out_(context.out), force_(force) {}

  using ForwardingFiles::disk;
  void add_input(const FileInfo& input) { inputs_.push_back(input); }
  bool force() const { return force_; }

  Result<Placement> placement(const std::string& path) override {
    SIXPOINT_ASSIGN(const Placing how, placing_of(look_at(disk(), path, inputs_), force_, path));
    Placement placement{how, path};
    if (const auto link = disk().link_info(path);
        how == Placing::replace && link && link->is_link) {
      SIXPOINT_ASSIGN(placement.path, disk().real_path(path));
    }
    return placement;
  }
  Result<std::unique_ptr<WritableFile>> open_through(const std::string& path) override {
    if (is_standard_output(path)) {
      return std::make_unique<StandardOutput>(out_);
    }
    return disk().open_through(path);
  }

 private:
  std::ostream& out_;
  bool force_;
  std::vector<FileInfo> inputs_;
};

Outputs::Outputs(Context& context, const OutputOptions& options, bool json)
    : context_(context), json_(json), files_(std::make_unique<Files>(context, options.force)) {}

Outputs::~Outputs() = default;

FileSystem& Outputs::files() { return *files_; }

Env Outputs::env() { return {context_.env.clock, *files_, context_.env.seed}; }

Status Outputs::input(const std::string& path) {
  if (const auto info = files_->disk().info(path); info && !path.empty()) {
    files_->add_input(*info);
  }
  return {};
}

Status Outputs::take(std::string_view option, const std::string& path) {
  const bool standard_output = is_standard_output(path);
  std::string name =
      standard_output ? "-" : std::filesystem::path(path).lexically_normal().string();
  if (std::find(taken_.begin(), taken_.end(), name) != taken_.end()) {
    return fail(ErrorCode::usage, "two outputs have this name", path,
                fmt::format("choose another name for {}", option));
  }
  if (standard_output && json_) {
    return fail(ErrorCode::usage, "standard output takes one document",
                fmt::format("{} {}", option, path), "leave out --json, or name a file");
  }
  taken_.push_back(std::move(name));
  context_.out_is_taken = context_.out_is_taken || standard_output;
  return {};
}

namespace {

Status refuse_unwritable(std::string_view option, const std::string& folder) {
  if (::faccessat(AT_FDCWD, folder.c_str(), W_OK, AT_EACCESS) != 0 &&
      (errno == EACCES || errno == EROFS)) {
    return fail(ErrorCode::permission, "this user may not write into the folder", folder,
                fmt::format("choose another folder for {}", option));
  }
  return {};
}

// Of a folder that is to be made, the one it is made in counts.
Status refuse_unwritable_tree(FileSystem& disk, std::string_view option, std::string folder) {
  while (!disk.info(folder) && folder_of(folder) != folder) {
    folder = folder_of(folder);
  }
  return refuse_unwritable(option, folder);
}

}  // namespace

Status Outputs::file(std::string_view option, const std::string& path) {
  if (path.empty()) {
    return {};
  }
  SIXPOINT_CHECK(take(option, path));
  SIXPOINT_ASSIGN(const Placement placement, files_->placement(path));
  if (placement.how == Placing::through) {
    return {};
  }
  // Said now and not after the work.
  const std::string folder = folder_of(path);
  if (const auto info = files_->disk().info(folder); folder != "." && (!info || !info->is_folder)) {
    return fail(ErrorCode::cannot_create, "there is no such folder", folder,
                fmt::format("make it, or choose another name for {}", option));
  }
  return refuse_unwritable(option, folder);
}

Status Outputs::file_to_keep(std::string_view option, const std::string& path) {
  SIXPOINT_CHECK(file(option, path));
  if (path.empty()) {
    return {};
  }
  SIXPOINT_ASSIGN(const Placement placement, files_->placement(path));
  if (placement.how == Placing::through) {
    return fail(ErrorCode::cannot_create, "this has to be a file: it is read again", path,
                fmt::format("name a file with {}", option));
  }
  return {};
}

namespace {

Status refuse_standard_output(std::string_view option, const std::string& path) {
  return is_standard_output(path)
             ? Status(fail(ErrorCode::usage, "standard output takes no folder",
                           fmt::format("{} {}", option, path), "name a folder (./- is one)"))
             : Status();
}

}  // namespace

Status Outputs::folder(std::string_view option, const std::string& path) {
  SIXPOINT_CHECK(refuse_standard_output(option, path));
  SIXPOINT_CHECK(take(option, path));
  SIXPOINT_CHECK(allow_folder(look_at_folder(files_->disk(), path), files_->force(), path));
  return refuse_unwritable_tree(files_->disk(), option, path);
}

Status Outputs::working_folder(std::string_view option, const std::string& path) {
  SIXPOINT_CHECK(refuse_standard_output(option, path));
  SIXPOINT_CHECK(take(option, path));
  const FolderTarget target = look_at_folder(files_->disk(), path);
  if (target != FolderTarget::filled) {
    SIXPOINT_CHECK(allow_folder(target, false, path));
  }
  return refuse_unwritable_tree(files_->disk(), option, path);
}

}  // namespace sixpoint::cli
