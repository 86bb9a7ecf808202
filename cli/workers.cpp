#include "cli/workers.h"

#include <fmt/ranges.h>

#include "cli/command.h"

namespace sixpoint::cli {

std::vector<NamedFile> named_files(Context& context, const std::vector<std::string>& paths,
                                   const std::vector<std::string>& endings) {
  std::vector<NamedFile> files;
  const auto refuse = [&](const std::string& path, const Error& error) {
    files.emplace_back().path = path;
    files.back().error = error;
  };
  for (const std::string& path : paths) {
    const auto found = repair::find_files(context.env.files, path, {endings});
    if (!found) {
      refuse(path, found.error());
      continue;
    }
    for (const repair::RefusedPath& refused : found->refused) {
      refuse(refused.path, refused.error);
    }
    if (found->files.empty()) {
      context.log().warn("{}: no {} file below this folder", printable(path),
                         fmt::join(endings, ", "));
    }
    for (const repair::FoundFile& file : found->files) {
      files.push_back({file, std::nullopt});
    }
  }
  return files;
}

void add_jobs_option(CLI::App& command, unsigned& jobs) {
  command.add_option("--jobs", jobs, "files at a time (default: one per core)");
}

unsigned threads_of(unsigned jobs) {
  return jobs > 0 ? jobs : std::max(1U, std::thread::hardware_concurrency());
}

void for_each_job(std::size_t count, unsigned jobs, const std::function<void(std::size_t)>& work,
                  const std::function<void(std::size_t)>& watch, const std::atomic<bool>* stop) {
  jobs = threads_of(jobs);
  std::atomic<std::size_t> next{0};
  std::atomic<std::size_t> done{0};
  std::atomic<std::size_t> ended{0};  // threads
  const auto stopped = [stop] { return stop != nullptr && *stop; };
  const auto run = [&] {
    for (std::size_t i = next++; i < count && !stopped(); i = next++) {
      work(i);
      ++done;
    }
    ++ended;
  };
  std::vector<std::jthread> threads;
  for (unsigned i = 0; i < jobs && i < count; ++i) {
    threads.emplace_back(run);
  }
  while (ended < threads.size()) {
    watch(done);
    std::this_thread::sleep_for(std::chrono::milliseconds(count - done < jobs ? 2 : 20));
  }
}

}  // namespace sixpoint::cli
