#include "repair/archive/record_folder.h"

#include <span>

#include <fmt/format.h>

namespace sixpoint::repair {

std::string beginning_of(FileSystem& files, const std::string& path) {
  constexpr std::size_t kEnough = 4096;
  const auto file = files.open(path);
  std::string text(kEnough, '\0');
  const auto count =
      file ? (*file)->read_at(0,
                              std::span(reinterpret_cast<std::uint8_t*>(text.data()), text.size()))
           : Result<std::size_t>(0);
  text.resize(count.value_or(0));
  return text;
}

bool has_schema(std::string_view beginning, std::string_view name) {
  return beginning.starts_with('{') &&
         beginning.find(fmt::format("\"sixpoint/{}/", name)) != std::string_view::npos;
}

bool is_bundle(FileSystem& files, const std::string& folder) {
  return has_schema(beginning_of(files, folder + "/protocol.json"), "bundle");
}

bool is_plan(FileSystem& files, const std::string& folder) {
  return has_schema(beginning_of(files, folder + "/plan.json"), "archive-plan");
}

}  // namespace sixpoint::repair
