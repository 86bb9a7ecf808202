// SENSOR_SCHEMA with SENSOR_DATA, and the small records: the first two bytes say where the data
// begin.
#include <cstdlib>

#include "gt3x/forms/sensor_schema.h"
#include "gt3x/forms/small_records.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  if (size < 2) {
    return 0;
  }
  const std::span<const std::uint8_t> rest(data + 2, size - 2);
  const std::size_t split = std::min<std::size_t>(data[0] + 256U * data[1], rest.size());
  if (const auto schema = gt3x::parse_sensor_schema(rest.first(split))) {
    if (const auto samples = gt3x::parse_sensor_data(*schema, rest.subspan(split))) {
      for (const auto& sample : *samples) {
        if (sample.size() != schema->labels().size()) {
          std::abort();
        }
      }
    }
  }
  constexpr std::uint8_t kTypes[] = {2, 3, 4, 5, 6, 7, 11, 13, 30, 200};
  for (const std::uint8_t type : kTypes) {
    const auto rows = gt3x::small_record_rows(type, rest, {});
    if (rows) {
      for (const auto& row : *rows) {
        if (row.size() != gt3x::small_record_columns(type).size()) {
          std::abort();
        }
      }
    }
  }
  return 0;
}
