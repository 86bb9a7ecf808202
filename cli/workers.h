// Many files on several threads, with a progress bar; the answers keep the order of the files.
//
//   const auto named = named_files(context, paths, {".gt3x"});
//   const auto scan = [&](const NamedFile& file) {
//     return file.error ? repair::unreadable_file(file.path, *file.error)
//                       : repair::scan_file(context.env.files, file.path);
//   };
//   const auto scanned = for_each_file<repair::ScannedFile>(context, "scanning", named, 0, scan);
#pragma once

#include <string>
#include <vector>

#include "cli/context.h"
#include "repair/batch/jobs.h"
#include "repair/batch/named_files.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

using repair::for_each_job;
using repair::NamedFile;
using repair::threads_of;

// In the order of `paths`. A folder without a file of these endings gives a warning; where there is no
// file at all, the exit code is that of no_input.
std::vector<NamedFile> named_files(Context& context, const std::vector<std::string>& paths,
                                   const std::vector<std::string>& endings);

// --jobs N: 0 (one per core) to repair::kMostJobs. `about`: what there are so many of.
void add_jobs_option(CLI::App& command, unsigned& jobs,
                     const std::string& about = "files at a time (default: one per core)");

// The answers of `work(file)`, which runs on up to `jobs` threads; `doing` names the progress bar.
template <class Answer, class Work>
std::vector<Answer> for_each_file(Context& context, const std::string& doing,
                                  const std::vector<NamedFile>& files, unsigned jobs, Work work) {
  std::vector<Answer> answers(files.size());
  Progress progress(context, doing, files.size());
  for_each_job(
      files.size(), jobs, [&](std::size_t i) { answers[i] = work(files[i]); },
      [&](std::size_t done) { progress.at(done); });
  return answers;
}

}  // namespace sixpoint::cli
