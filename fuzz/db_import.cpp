// A store's export as JSON Lines: whatever is imported, the store is as it was before or holds a
// whole chain.
#include <cstdlib>
#include <optional>

#include "base/memory_env.h"
#include "db/exchange.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  static MemoryEnv clock_only;
  static std::optional<db::Store> store;
  if (!store) {
    store.emplace(db::Store::in_memory(clock_only.env).value());
  }
  MemoryFiles files;
  {
    auto file = files.create("in.jsonl").value();
    static_cast<void>(file->write_at(0, std::span(data, size)));
  }
  const auto report = db::import_json_lines(*store, files, "in.jsonl");
  const auto audit = store->audit();
  if (!audit || !audit->ok || (!report && audit->rows != 0) ||
      (report && (report->head != audit->head || report->rows != audit->rows))) {
    std::abort();
  }
  if (report) {
    // What came in goes out and in again.
    MemoryFiles out;
    auto again = db::Store::in_memory(clock_only.env).value();
    if (!db::export_json_lines(*store, out, "out.jsonl") ||
        db::import_json_lines(again, out, "out.jsonl").value().head != report->head) {
      std::abort();
    }
    store.reset();
  }
  return 0;
}
