#include "gt3x/recording.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>

#include <fmt/format.h>

#include "gt3x/container/read_ahead.h"
#include "gt3x/recording_archive.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::string_view kDownloadAgain =
    "download the recording from the unit again, or fetch an undamaged copy";

// A recording has a handful of entries; a hundred days at 100 Hz in 16 bits make 5 GB.
constexpr zip_int64_t kMaxEntries = 200;
constexpr std::uint64_t kMaxEntrySize = std::uint64_t{16} << 30;
// Deflate reaches 1032 : 1. A log of a unit that lay still compresses to about 40 : 1, so beyond
// this an entry is no recording but an attempt to fill a disk.
constexpr std::uint64_t kMaxRatio = 300;
constexpr std::uint64_t kRatioMattersFrom = std::uint64_t{64} << 20;

bool plain_name(std::string_view name) {
  return !name.empty() && name != "." && name != ".." && std::ranges::none_of(name, [](char c) {
    return c == '/' || c == '\\' || c == ':' || static_cast<unsigned char>(c) < 0x20;
  });
}

// From this size on an entry is unpacked on a thread of its own; below, the thread costs more.
constexpr std::uint64_t kReadAheadFrom = std::uint64_t{4} << 20;

// What libzip says about an error.
std::string describe(zip_error_t* error) {
  std::string text = zip_error_strerror(error);
  zip_error_fini(error);
  return text;
}

}  // namespace

// The packed bytes of one entry.
class Recording::PackedEntry final : public ByteSource {
 public:
  PackedEntry(std::shared_ptr<Archive> archive, zip_file_t* file, std::string where)
      : archive_(std::move(archive)), file_(file), where_(std::move(where)) {}
  PackedEntry(const PackedEntry&) = delete;
  PackedEntry& operator=(const PackedEntry&) = delete;
  ~PackedEntry() override {
    const std::lock_guard lock(archive_->mutex);
    zip_fclose(file_);
  }

  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    const std::lock_guard lock(archive_->mutex);
    const zip_int64_t count = zip_fread(file_, out.data(), out.size());
    if (count >= 0) {
      return static_cast<std::size_t>(count);
    }
    if (archive_->failure) {
      return fail(*archive_->failure);
    }
    return fail(
        ErrorCode::bad_data,
        std::string("the entry is damaged: ") + zip_error_strerror(zip_file_get_error(file_)),
        where_, std::string(kDownloadAgain));
  }

 private:
  std::shared_ptr<Archive> archive_;  // stays open
  zip_file_t* file_;
  std::string where_;
};

zip_int64_t Recording::Archive::origin(void* user, void* data, zip_uint64_t length,
                                       zip_source_cmd_t command) {
  auto* self = static_cast<Archive*>(user);
  switch (command) {
    case ZIP_SOURCE_OPEN:
      self->at = 0;
      return 0;
    case ZIP_SOURCE_READ: {
      if (length == 0) {
        return 0;
      }
      auto count =
          self->file->read_at(self->at, std::span(static_cast<std::uint8_t*>(data), length));
      if (!count) {
        // The first of our own errors says more than what libzip makes of it.
        if (!self->failure) {
          self->failure = std::move(count).error();
        }
        zip_error_set(&self->error, ZIP_ER_READ, EIO);
        return -1;
      }
      self->at += *count;
      return static_cast<zip_int64_t>(*count);
    }
    case ZIP_SOURCE_SEEK: {
      const zip_int64_t target =
          zip_source_seek_compute_offset(self->at, self->file->size(), data, length, &self->error);
      if (target < 0) {
        return -1;
      }
      self->at = static_cast<std::uint64_t>(target);
      return 0;
    }
    case ZIP_SOURCE_TELL:
      return static_cast<zip_int64_t>(self->at);
    case ZIP_SOURCE_STAT: {
      auto* stat = static_cast<zip_stat_t*>(data);
      zip_stat_init(stat);
      stat->size = self->file->size();
      stat->valid |= ZIP_STAT_SIZE;
      return sizeof *stat;
    }
    case ZIP_SOURCE_CLOSE:
    case ZIP_SOURCE_FREE:  // the archive owns itself
      return 0;
    case ZIP_SOURCE_ERROR:
      return zip_error_to_data(&self->error, data, length);
    case ZIP_SOURCE_SUPPORTS:
      return ZIP_SOURCE_SUPPORTS_SEEKABLE;
    default:
      zip_error_set(&self->error, ZIP_ER_OPNOTSUPP, 0);
      return -1;
  }
}

std::optional<std::size_t> Recording::Archive::index_of(const std::string& name) const {
  const auto found = std::ranges::find(entries, name, &EntryInfo::name);
  return found == entries.end() ? std::nullopt
                                : std::optional(static_cast<std::size_t>(found - entries.begin()));
}

tl::unexpected<Error> Recording::Archive::bad(std::string what, std::string hint) const {
  return fail(ErrorCode::bad_data, std::move(what), path,
              hint.empty() ? std::string(kDownloadAgain) : std::move(hint));
}

Recording::Recording(std::shared_ptr<Archive> archive) : archive_(std::move(archive)) {}

const std::string& Recording::path() const { return archive_->path; }
const Info& Recording::info() const { return archive_->info; }
const std::vector<EntryInfo>& Recording::entries() const { return archive_->entries; }
RecordingForm Recording::form() const { return archive_->form; }
bool Recording::has_entry(const std::string& name) const {
  return archive_->index_of(name).has_value();
}

Status Recording::Archive::open_zip() {
  zip_error_t problem;
  zip_error_init(&problem);
  zip_source_t* source = zip_source_function_create(&Archive::origin, this, &problem);
  if (source != nullptr) {
    zip = zip_open_from_source(source, ZIP_RDONLY, &problem);
    if (zip == nullptr) {
      zip_source_free(source);
    }
  }
  const std::string reason = describe(&problem);
  if (zip != nullptr) {
    return {};
  }
  if (failure) {
    return fail(*failure);
  }
  std::array<std::uint8_t, 4> start{};
  SIXPOINT_ASSIGN(const std::size_t count, file->read_at(0, start));
  if (count == start.size() && start == std::array<std::uint8_t, 4>{'P', 'K', 3, 4}) {
    return bad(fmt::format("the archive is cut short or damaged ({})", reason));
  }
  return bad("not a zip archive, so no .gt3x recording",
             "check that this is the file that the unit's software wrote");
}

Result<EntryInfo> Recording::Archive::read_entry(zip_uint64_t index) const {
  zip_stat_t stat;
  zip_stat_init(&stat);
  const char* name = zip_get_name(zip, index, ZIP_FL_ENC_RAW);
  if (name == nullptr || zip_stat_index(zip, index, 0, &stat) != 0) {
    return bad("the archive's list of entries is damaged");
  }
  EntryInfo entry{name, stat.size, stat.comp_size};
  const std::string shown = printable(entry.name, 60);
  if (!plain_name(entry.name)) {
    return bad(fmt::format("the archive holds an entry named with a path: '{}'", shown),
               "pack the recording's files again without folders");
  }
  if (index_of(entry.name)) {
    return bad(fmt::format("the archive holds two entries named {}", shown),
               "there is no way to know which one is right; " + std::string(kDownloadAgain));
  }
  if (stat.encryption_method != ZIP_EM_NONE ||
      (stat.comp_method != ZIP_CM_STORE && stat.comp_method != ZIP_CM_DEFLATE)) {
    return bad(
        fmt::format("entry {} is encrypted or packed in a way that recordings are not", shown),
        "unpack it and pack it again as an ordinary zip");
  }
  if (entry.size > kMaxEntrySize ||
      (entry.size > kRatioMattersFrom && entry.size / kMaxRatio > entry.compressed_size)) {
    return bad(
        fmt::format("entry {} claims {} bytes, more than a recording can have", shown, entry.size),
        "check that this is a recording");
  }
  return entry;
}

Status Recording::Archive::read_entries() {
  const zip_int64_t count = zip_get_num_entries(zip, 0);
  if (count > kMaxEntries) {
    return bad(fmt::format("the archive has {} entries, a recording has a few", count),
               "check that this is a recording");
  }
  for (zip_int64_t index = 0; index < count; ++index) {
    SIXPOINT_ASSIGN(EntryInfo entry, read_entry(static_cast<zip_uint64_t>(index)));
    entries.push_back(std::move(entry));
  }
  if (index_of("log.bin")) {
    form = RecordingForm::log;
  } else if (index_of("activity.bin")) {
    form = RecordingForm::activity;
  } else {
    return bad("the archive holds no log.bin, so no samples",
               "check that this is a recording and not another zip file");
  }
  return index_of("info.txt") ? Status() : Status(bad("the archive holds no info.txt"));
}

Result<Recording> Recording::open(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(auto file, files.open(path));
  if (file->size() == 0) {
    return fail(ErrorCode::bad_data, "the file is empty", path, std::string(kDownloadAgain));
  }
  auto archive = std::make_shared<Archive>(std::move(file), path);
  SIXPOINT_CHECK(archive->open_zip());
  SIXPOINT_CHECK(archive->read_entries());
  Recording recording(archive);
  SIXPOINT_ASSIGN(const auto info_source, recording.open_entry("info.txt"));
  const auto text = read_all(*info_source, 1 << 20);
  if (!text) {
    Error failure = text.error();
    failure.where = path + ":info.txt";
    return fail(std::move(failure));
  }
  auto info = Info::parse(as_text(*text));
  if (!info) {
    return archive->bad(info.error().what, info.error().hint);
  }
  archive->info = *std::move(info);
  return recording;
}

Result<EntryFacts> Recording::Archive::facts_of(std::size_t index) const {
  const std::lock_guard lock(mutex);
  zip_stat_t stat;
  zip_stat_init(&stat);
  if (zip_stat_index(zip, index, 0, &stat) != 0) {
    return bad("the archive's list of entries is damaged");
  }
  EntryFacts facts;
  facts.packing = stat.comp_method == ZIP_CM_DEFLATE ? Packing::deflate : Packing::store;
  facts.size = stat.size;
  facts.packed_size = stat.comp_size;
  facts.crc32 = stat.crc;
  facts.where = path + ":" + entries[index].name;
  zip_uint16_t length = 0;
  const zip_uint8_t* field =
      zip_file_extra_field_get_by_id(zip, index, kSyncPointsId, 0, &length, ZIP_FL_CENTRAL);
  if (field != nullptr && facts.packing == Packing::deflate) {
    facts.points =
        parse_sync_points({field, length}, {facts.size, facts.packed_size}).value_or(SyncPoints{});
  }
  return facts;
}

Result<std::unique_ptr<ByteSource>> Recording::Archive::open_packed(
    const std::shared_ptr<Archive>& archive, std::size_t index) {
  const std::lock_guard lock(archive->mutex);
  zip_file_t* file = zip_fopen_index(archive->zip, index, ZIP_FL_COMPRESSED);
  const std::string& name = archive->entries[index].name;
  if (file != nullptr) {
    return std::make_unique<PackedEntry>(archive, file, archive->path + ":" + name);
  }
  if (archive->failure) {
    return fail(*archive->failure);
  }
  return archive->bad(fmt::format("entry {} cannot be opened: {}", printable(name, 60),
                                  zip_strerror(archive->zip)));
}

Result<std::unique_ptr<ByteSource>> Recording::open_entry(const std::string& name) {
  const auto index = archive_->index_of(name);
  if (!index) {
    return archive_->bad(fmt::format("the archive holds no {}", printable(name, 60)));
  }
  SIXPOINT_ASSIGN(const EntryFacts facts, archive_->facts_of(*index));
  SIXPOINT_ASSIGN(auto packed, Archive::open_packed(archive_, *index));
  auto unpacked = unpack_entry(std::move(packed), facts);
  if (facts.size < kReadAheadFrom) {
    return unpacked;
  }
  return std::make_unique<ReadAhead>(std::move(unpacked));
}

Result<LogReader> Recording::open_log() {
  if (form() != RecordingForm::log) {
    return archive_->bad("the recording is of the old form (activity.bin) and has no records",
                         "only its samples can be read");
  }
  SIXPOINT_ASSIGN(auto source, open_entry("log.bin"));
  return LogReader(std::move(source));
}

}  // namespace sixpoint::gt3x
