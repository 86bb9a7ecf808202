// An .agd, which SQLite reads from the disk: facts or an error, in bounded time and memory.
#include <cstdio>
#include <string>

#include <unistd.h>

#include "repair/triage/agd.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::string kPath = "/dev/shm/fuzz-" + std::to_string(getpid()) + ".agd";
  std::FILE* file = std::fopen(kPath.c_str(), "wb");
  if (file == nullptr) {
    return 0;
  }
  std::fwrite(data, 1, size, file);
  std::fclose(file);
  static_cast<void>(sixpoint::repair::read_agd_facts(kPath));
  static_cast<void>(unlink(kPath.c_str()));
  return 0;
}
