// The scripts of a plan: its shards as a Slurm job array, with the merge behind it, and on one
// machine.
//
//   const ArchiveScripts scripts{"/data/plan", "/usr/bin/sixpoint", 100, 64};
//   const std::string batch = slurm_script(scripts);
#pragma once

#include <string>

namespace sixpoint::repair {

struct ArchiveScripts {
  std::string folder;   // of the plan, as the tasks reach it
  std::string program;  // sixpoint, as the tasks reach it
  std::size_t shards = 0;
  std::size_t at_once = 0;  // tasks at a time; 0: as many as the queue lets run
};

std::string slurm_script(const ArchiveScripts& scripts);
// Submits the array, and the merge as a job that waits for it. Prints the two job numbers.
std::string submit_script(const ArchiveScripts& scripts);
// The job that waits.
std::string merge_script(const ArchiveScripts& scripts);
std::string shell_script(const ArchiveScripts& scripts);

// One argument of a shell command line, in quotes where it needs them.
std::string shell_word(const std::string& text);

}  // namespace sixpoint::repair
