#include "gt3x/recording.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>

#include <fmt/format.h>
#include <sys/stat.h>

#include "gt3x/container/archive_end.h"
#include "gt3x/container/read_ahead.h"
#include "gt3x/recording_archive.h"
#include "gt3x/salvaged_info.h"

namespace sixpoint::gt3x {
namespace {

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
  PackedEntry(std::shared_ptr<Archive> archive, zip_file_t* file)
      : archive_(std::move(archive)), file_(file) {}
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
    // Who unpacks it (inflating_source.h) checks the CRC, and says where the damage is.
    zip_error_t* why = zip_file_get_error(file_);
    if (zip_error_code_zip(why) == ZIP_ER_CRC) {
      return std::size_t{0};
    }
    return fail(ErrorCode::bad_data, zip_error_strerror(why));
  }

 private:
  std::shared_ptr<Archive> archive_;  // stays open
  zip_file_t* file_;
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
      length = std::min(length, self->end - std::min(self->at, self->end));
      auto count = self->file->read_at(
          self->at, std::span(static_cast<std::uint8_t*>(data), static_cast<std::size_t>(length)));
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
          zip_source_seek_compute_offset(self->at, self->end, data, length, &self->error);
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
      stat->size = self->end;
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
  return fail(ErrorCode::bad_data, std::move(what), path, std::move(hint));
}

tl::unexpected<Error> Recording::Archive::list_is_damaged() const {
  return bad("the archive's list of entries is damaged", hint_about(Damage::no_directory));
}

void Recording::Archive::note(Damage kind, const std::string& entry, const std::string& why) {
  const bool known = std::ranges::any_of(
      damage, [&](const RecordingDamage& one) { return one.kind == kind && one.entry == entry; });
  if (!known) {
    damage.push_back({kind, entry, why});
  }
}

Recording::Recording(std::shared_ptr<Archive> archive) : archive_(std::move(archive)) {}

const std::string& Recording::path() const { return archive_->path; }
const Info& Recording::info() const { return archive_->info; }
const std::vector<EntryInfo>& Recording::entries() const { return archive_->entries; }
RecordingForm Recording::form() const { return archive_->form; }
std::uint64_t Recording::bytes_behind() const { return archive_->file->size() - archive_->end; }
const std::vector<RecordingDamage>& Recording::damage() const { return archive_->damage; }
bool Recording::is_damaged(const std::string& entry) const {
  return std::ranges::find(archive_->damage, entry, &RecordingDamage::entry) !=
         archive_->damage.end();
}
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
    return bad(fmt::format("the archive is cut short or damaged ({})", reason),
               hint_about(Damage::no_directory));
  }
  if (count == start.size() && start == std::array<std::uint8_t, 4>{'S', 'Q', 'L', 'i'}) {
    return bad("a database, as an .agd is: it holds epochs, and no samples",
               "name the .gt3x that it was made from");
  }
  return bad("not a zip archive, so no .gt3x recording",
             "check that this is the file that the unit's software wrote");
}

Result<EntryHeader> Recording::Archive::listed_header(zip_uint64_t index) const {
  zip_stat_t stat;
  zip_stat_init(&stat);
  const char* name = zip_get_name(zip, index, ZIP_FL_ENC_RAW);
  zip_uint8_t system = 0;
  zip_uint32_t attributes = 0;
  if (name == nullptr || zip_stat_index(zip, index, 0, &stat) != 0 ||
      zip_file_get_external_attributes(zip, index, 0, &system, &attributes) != 0) {
    return list_is_damaged();
  }
  EntryHeader header;
  header.name = name;
  header.size = stat.size;
  header.packed_size = stat.comp_size;
  header.method = stat.comp_method;
  header.encrypted = stat.encryption_method != ZIP_EM_NONE;
  header.symbolic_link = system == ZIP_OPSYS_UNIX && S_ISLNK(attributes >> 16U);
  return header;
}

// An entry that may not be there is an error.
Status Recording::Archive::add_entry(const EntryHeader& header) {
  if (const auto refusal = why_refused(header, options.limits)) {
    return bad(refusal->what, refusal->hint);
  }
  if (index_of(header.name)) {
    return bad(fmt::format("the archive holds two entries named {}", printable(header.name, 60)),
               "there is no way to know which one is right; " + hint_about(Damage::refused));
  }
  if (entries.size() == options.limits.entries) {
    return bad(fmt::format("the archive has more than {} entries, a recording has a few",
                           options.limits.entries),
               "check that this is a recording");
  }
  entries.push_back({header.name, header.size, header.packed_size});
  return {};
}

namespace {

// A folder needs no entry: the names of the files in it say where they are.
bool is_folder(EntryHeader& header) {
  const bool folder = header.name.size() > 1 && header.name.ends_with('/') && header.size == 0;
  if (folder) {
    header.name.pop_back();
  }
  return folder && stays_inside(header.name);
}

}  // namespace

Status Recording::Archive::read_list() {
  const zip_int64_t count = zip_get_num_entries(zip, 0);
  std::uint64_t left = end;
  for (zip_int64_t i = 0; i < count; ++i) {
    const auto index = static_cast<zip_uint64_t>(i);
    SIXPOINT_ASSIGN(EntryHeader header, listed_header(index));
    if (!is_folder(header)) {
      SIXPOINT_CHECK(add_entry(header));
      listed.push_back(index);
      if (header.packed_size > left) {
        return bad("entries overlap: together they have more bytes than the archive",
                   hint_about(Damage::no_directory));
      }
      left -= header.packed_size;
    }
  }
  return check_entries();
}

Status Recording::Archive::read_local_headers() {
  entries.clear();
  listed.clear();
  SIXPOINT_ASSIGN(auto found, find_local_entries(*file, options.limits));
  for (LocalEntry& entry : found) {
    if (!is_folder(entry.header)) {
      SIXPOINT_CHECK(add_entry(entry.header));
      local_entries.push_back(std::move(entry));
    }
  }
  return check_entries();
}

Status Recording::Archive::check_entries() {
  if (!index_of("log.bin") && !index_of("activity.bin")) {
    return bad("the archive holds no log.bin, so no samples",
               "check that this is a recording and not another zip file");
  }
  form = index_of("log.bin") ? RecordingForm::log : RecordingForm::activity;
  return {};
}

Status Recording::Archive::find_entries() {
  SIXPOINT_ASSIGN(end, archive_end(*file));
  Status by_list = open_zip();
  if (by_list) {
    by_list = read_list();
  }
  const bool damaged = !by_list && by_list.error().code == ErrorCode::bad_data;
  if (!damaged ||
      what_may_be_delivered(Damage::no_directory, options.salvage) == Delivery::nothing) {
    return by_list;
  }
  end = file->size();
  const Status by_headers = read_local_headers();
  if (!by_headers) {
    return entries.empty() ? by_list : by_headers;
  }
  note(Damage::no_directory, {},
       "the list of entries is lost or damaged; they were found by their own headers");
  return {};
}

Status Recording::Archive::read_info(Recording& recording) {
  const auto read = [&]() -> Result<Info> {
    if (!index_of("info.txt")) {
      return bad("the archive holds no info.txt", hint_about(Damage::no_info));
    }
    SIXPOINT_ASSIGN(const auto source, recording.open_entry("info.txt"));
    auto bytes = read_all(*source, 1 << 20);
    if (!bytes) {
      Error unread = std::move(bytes).error();
      unread.where = path + ":info.txt";
      return fail(std::move(unread));
    }
    std::string_view text = as_text(*bytes);
    if (recording.is_damaged("info.txt")) {
      // The last line may be a part of one.
      text = text.substr(0, text.rfind('\n') + 1);
    }
    auto parsed = Info::parse(text);
    return parsed ? parsed : bad(parsed.error().what, hint_about(Damage::no_info));
  };
  auto text = read();
  if (text && !recording.is_damaged("info.txt")) {
    info = *std::move(text);
    return {};
  }
  if (!text && (text.error().code != ErrorCode::bad_data ||
                what_may_be_delivered(Damage::no_info, options.salvage) == Delivery::nothing)) {
    return fail(std::move(text).error());
  }
  SIXPOINT_ASSIGN(SalvagedInfo salvaged,
                  salvaged_info(text ? *std::move(text) : Info(), recording));
  info = std::move(salvaged.info);
  note(Damage::no_info, "info.txt", salvaged.said);
  return {};
}

Result<Recording> Recording::open(FileSystem& files, const std::string& path,
                                  const RecordingOptions& options) {
  SIXPOINT_ASSIGN(auto file, files.open(path));
  if (file->size() == 0) {
    return fail(ErrorCode::bad_data, "the file is empty", path, hint_about(Damage::no_samples));
  }
  auto archive = std::make_shared<Archive>(std::move(file), path, options);
  SIXPOINT_CHECK(archive->find_entries());
  Recording recording(archive);
  SIXPOINT_CHECK(archive->read_info(recording));
  return recording;
}

Result<EntryFacts> Recording::Archive::facts_of(std::size_t index) const {
  EntryFacts facts;
  facts.where = path + ":" + entries[index].name;
  if (!local_entries.empty()) {
    const LocalEntry& entry = local_entries[index];
    facts.packing = entry.header.method == kMethodDeflate ? Packing::deflate : Packing::store;
    facts.size = entry.header.size;
    facts.packed_size = entry.packed_bytes;
    facts.crc32 = entry.crc32;
    facts.size_known = entry.size_known;
    facts.crc_known = entry.crc_known;
    return facts;
  }
  const std::lock_guard lock(mutex);
  zip_stat_t stat;
  zip_stat_init(&stat);
  if (zip_stat_index(zip, listed[index], 0, &stat) != 0) {
    return list_is_damaged();
  }
  facts.packing = stat.comp_method == ZIP_CM_DEFLATE ? Packing::deflate : Packing::store;
  facts.size = stat.size;
  facts.packed_size = stat.comp_size;
  facts.crc32 = stat.crc;
  zip_uint16_t length = 0;
  const zip_uint8_t* field =
      zip_file_extra_field_get_by_id(zip, listed[index], kSyncPointsId, 0, &length, ZIP_FL_CENTRAL);
  if (field != nullptr && facts.packing == Packing::deflate) {
    facts.points =
        parse_sync_points({field, length}, {facts.size, facts.packed_size}).value_or(SyncPoints{});
  }
  return facts;
}

Result<std::unique_ptr<ByteSource>> Recording::Archive::open_packed(
    const std::shared_ptr<Archive>& archive, std::size_t index) {
  if (!archive->local_entries.empty()) {
    return packed_bytes_of(archive->file, archive->local_entries[index]);
  }
  const std::lock_guard lock(archive->mutex);
  zip_file_t* file = zip_fopen_index(archive->zip, archive->listed[index], ZIP_FL_COMPRESSED);
  const std::string& name = archive->entries[index].name;
  if (file != nullptr) {
    return std::make_unique<PackedEntry>(archive, file);
  }
  if (archive->failure) {
    return fail(*archive->failure);
  }
  return archive->bad(
      fmt::format("entry {} cannot be opened: {}", printable(name, 60), zip_strerror(archive->zip)),
      hint_about(Damage::lost_entry));
}

Result<std::unique_ptr<ByteSource>> Recording::open_entry(const std::string& name) {
  return open_entry(name, Unpacking::ahead);
}

Result<std::unique_ptr<ByteSource>> Recording::open_entry(const std::string& name, Unpacking how) {
  const auto index = archive_->index_of(name);
  if (!index) {
    return archive_->bad(fmt::format("the archive holds no {}", printable(name, 60)),
                         hint_about(Damage::refused));
  }
  SIXPOINT_ASSIGN(EntryFacts facts, archive_->facts_of(*index));
  if (how == Unpacking::when_asked) {
    facts.points = {};
  }
  const bool salvage = archive_->options.salvage;
  auto packed = Archive::open_packed(archive_, *index);
  if (!packed && packed.error().code == ErrorCode::bad_data && salvage) {
    archive_->note(Damage::lost_entry, name, packed.error().what);
    return std::make_unique<MemorySource>(Bytes());
  }
  if (!packed) {
    return fail(std::move(packed).error());
  }
  if (salvage) {
    return salvage_entry(
        *std::move(packed), facts, archive_->options.limits,
        [archive = archive_, name](const EntryDamage& damage) {
          archive->note(damage.kind, name,
                        fmt::format("{}; {} bytes of it could be read", damage.why, damage.bytes));
        });
  }
  const bool on_threads = !facts.points.packed_sizes.empty();  // piecewise_source.h
  auto unpacked = unpack_entry(*std::move(packed), facts);
  if (facts.size < kReadAheadFrom || on_threads || how == Unpacking::when_asked) {
    return unpacked;
  }
  return std::make_unique<ReadAhead>(std::move(unpacked));
}

Result<LogReader> Recording::open_log() { return open_log(Unpacking::ahead); }

Result<LogReader> Recording::open_log_beginning() { return open_log(Unpacking::when_asked); }

Result<LogReader> Recording::open_log(Unpacking how) {
  if (form() != RecordingForm::log) {
    return archive_->bad("the recording is of the old form (activity.bin) and has no records",
                         "only its samples can be read");
  }
  SIXPOINT_ASSIGN(auto source, open_entry("log.bin", how));
  return LogReader(std::move(source));
}

Result<AgdcCalibration> agdc_calibration(Recording& recording, double rate_hz) {
  SIXPOINT_ASSIGN(const auto source, recording.open_entry("calibration.json"));
  SIXPOINT_ASSIGN(const Bytes bytes, read_all(*source, 1U << 20U));
  SIXPOINT_ASSIGN(auto calibration,
                  parse_agdc_calibration(as_text(bytes), static_cast<int>(rate_hz)));
  // 12 bits at 16 LSB/g would be 128 g.
  constexpr double kLeastScale_lsb_per_g = 16;
  const auto scale = recording.info().accel_scale_lsb_per_g();
  if (calibration.already_applied && scale && *scale < kLeastScale_lsb_per_g) {
    return fail(ErrorCode::bad_data,
                fmt::format("the samples are said to be g times a scale of {} LSB/g", *scale), {},
                "take the file from where it was made again");
  }
  return calibration;
}

bool holds_raw_counts(Recording& recording, double rate_hz) {
  const auto calibration = agdc_calibration(recording, rate_hz);
  return !calibration || !calibration->already_applied;
}

}  // namespace sixpoint::gt3x
