// The scripts of a plan: its shards as a Slurm job array, with the merge behind it, and on one
// machine.
//
//   const ArchiveScripts scripts{"/data/plan", "/usr/bin/sixpoint", 100, 64};
//   const std::string batch = slurm_script(scripts);
#pragma once

#include <string>
#include <vector>

namespace sixpoint::repair {

struct ArchiveScripts {
  std::string folder;   // of the plan, as the tasks reach it
  std::string program;  // sixpoint, as the tasks reach it
  std::size_t shards = 0;
  std::size_t at_once = 0;  // tasks at a time; 0: as many as the queue lets run
  std::size_t files = 0;    // of the plan: the merge's memory goes by them
};

std::string slurm_script(const ArchiveScripts& scripts);
// The job that waits for the array.
std::string merge_script(const ArchiveScripts& scripts);
std::string shell_script(const ArchiveScripts& scripts);

// The command lines that submit the array, and the merge as a job that waits until every task of
// the array `job` has ended, however it ended. `more` are options of sbatch for both.
std::vector<std::string> array_command(const std::string& folder, const std::string& output,
                                       const std::vector<std::string>& more);
std::vector<std::string> merge_command(const std::string& folder, const std::string& job,
                                       const std::vector<std::string>& more);

// One argument of a shell command line, in quotes where it needs them.
std::string shell_word(const std::string& text);

}  // namespace sixpoint::repair
