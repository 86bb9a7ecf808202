#include "gt3x/container/zip_bridge.h"

#include <cerrno>

namespace sixpoint::gt3x {
namespace {

struct Pull {
  std::unique_ptr<ByteSource> source;
  std::optional<Error>* failure;
  zip_error_t error{};
};

zip_int64_t pull(void* user, void* data, zip_uint64_t length, zip_source_cmd_t command) {
  auto* state = static_cast<Pull*>(user);
  switch (command) {
    case ZIP_SOURCE_OPEN:
    case ZIP_SOURCE_CLOSE:
      return 0;
    case ZIP_SOURCE_READ: {
      if (length == 0) {
        return 0;
      }
      auto count = state->source->read(std::span(static_cast<std::uint8_t*>(data), length));
      if (!count) {
        return refuse(std::move(count).error(), *state->failure, ZIP_ER_READ, state->error);
      }
      return static_cast<zip_int64_t>(*count);
    }
    case ZIP_SOURCE_STAT: {
      auto* stat = static_cast<zip_stat_t*>(data);
      zip_stat_init(stat);
      if (const auto size = state->source->size()) {
        stat->size = *size;
        stat->valid |= ZIP_STAT_SIZE;
      }
      return sizeof *stat;
    }
    case ZIP_SOURCE_ERROR:
      return zip_error_to_data(&state->error, data, length);
    case ZIP_SOURCE_FREE:
      delete state;  // NOLINT(cppcoreguidelines-owning-memory): libzip's last call
      return 0;
    case ZIP_SOURCE_SUPPORTS:
      return ZIP_SOURCE_SUPPORTS_READABLE | zip_bit(ZIP_SOURCE_SUPPORTS);
    default:
      zip_error_set(&state->error, ZIP_ER_OPNOTSUPP, 0);
      return -1;
  }
}

}  // namespace

std::string describe(zip_error_t* error) {
  std::string text = zip_error_strerror(error);
  zip_error_fini(error);
  return text;
}

zip_int64_t refuse(Error why, std::optional<Error>& first, int code, zip_error_t& error) {
  if (!first) {
    first = std::move(why);
  }
  zip_error_set(&error, code, EIO);
  return -1;
}

zip_int64_t seek(std::uint64_t& at, std::uint64_t size, void* data, zip_uint64_t length,
                 zip_error_t& error) {
  const zip_int64_t target = zip_source_seek_compute_offset(at, size, data, length, &error);
  if (target < 0) {
    return -1;
  }
  at = static_cast<std::uint64_t>(target);
  return 0;
}

zip_source_t* make_pulling_source(std::unique_ptr<ByteSource> source,
                                  std::optional<Error>* failure) {
  auto state = std::make_unique<Pull>(Pull{std::move(source), failure, {}});
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* made = zip_source_function_create(&pull, state.get(), &error);
  zip_error_fini(&error);
  if (made != nullptr) {
    static_cast<void>(state.release());
  }
  return made;
}

}  // namespace sixpoint::gt3x
