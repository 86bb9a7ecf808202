// An entry of the journal: damaged, or whole with a record that no run wrote. What the store does
// not take stays in the journal, and what it takes leaves the chain whole.
#include <cstdlib>

#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "base/sha256.h"
#include "db/journal.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  if (size == 0) {
    return 0;
  }
  static MemoryEnv clock_only;
  static auto store = db::Store::in_memory(clock_only.env).value();
  static int stored = 0;
  std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  if (data[0] % 2 == 0) {
    // Past the checksum, which no fuzzer guesses.
    const std::string hash = text_sha256(text);
    text = nlohmann::json{{"record", text}, {"sha256", hash}}.dump(
        -1, ' ', false, nlohmann::json::error_handler_t::ignore);
  }
  MemoryFiles files;
  auto journal = db::Journal::open(files, "journal").value();
  {
    auto file = files.create("journal/0000000001-x.json").value();
    static_cast<void>(file->write_at(0, as_bytes(text)));
  }
  const auto taken = journal.catch_up(store);
  if (journal.pending().value() != (taken ? 0U : 1U)) {
    std::abort();
  }
  if (taken) {
    const auto audit = store.audit();
    if (!audit || !audit->ok) {
      std::abort();
    }
    // So that an audit stays quick.
    if (++stored % 200 == 0) {
      store = db::Store::in_memory(clock_only.env).value();
    }
  }
  return 0;
}
