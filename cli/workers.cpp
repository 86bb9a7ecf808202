#include "cli/workers.h"

#include <fmt/ranges.h>

#include "cli/command.h"

namespace sixpoint::cli {

std::vector<NamedFile> named_files(Context& context, const std::vector<std::string>& paths,
                                   const std::vector<std::string>& endings) {
  repair::NamedFiles named = repair::named_files(context.env.files, paths, endings);
  for (const std::string& folder : named.empty_folders) {
    context.log().warn("{}: no {} file below this folder", printable(folder),
                       fmt::join(endings, ", "));
  }
  if (named.files.empty()) {
    context.worsen(ErrorCode::no_input);  // a disk that is not mounted is an empty folder
  }
  return std::move(named.files);
}

void add_jobs_option(CLI::App& command, unsigned& jobs, const std::string& about) {
  command.add_option("--jobs", jobs, about)->check(CLI::Range(0U, repair::kMostJobs));
}

}  // namespace sixpoint::cli
