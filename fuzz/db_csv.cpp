// CSV: what is read, written and read again is the same.
#include <cstdlib>

#include "base/memory_env.h"
#include "db/csv.h"

namespace {

using namespace sixpoint;

std::vector<db::CsvRecord> records_of(std::span<const std::uint8_t> bytes, bool& good) {
  MemoryFiles files;
  {
    auto file = files.create("in.csv").value();
    static_cast<void>(file->write_at(0, bytes));
  }
  auto reader = db::CsvReader::open(files, "in.csv").value();
  std::vector<db::CsvRecord> records;
  db::CsvRecord record;
  while (true) {
    const auto more = reader.next(record);
    good = more.has_value();
    if (!more || !*more) {
      return records;
    }
    records.push_back(record);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  bool good = true;
  const auto records = records_of(std::span(data, size), good);
  std::string text;
  for (const auto& record : records) {
    for (std::size_t i = 0; i < record.size(); ++i) {
      text += (i == 0 ? "" : ",") + sixpoint::db::csv_field(record[i]);
    }
    text += "\r\n";
  }
  bool good_again = true;
  const auto again = records_of(
      std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()), good_again);
  if (!good_again || again != records) {
    std::abort();
  }
  return 0;
}
