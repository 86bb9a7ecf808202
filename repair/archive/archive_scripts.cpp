#include "repair/archive/archive_scripts.h"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

namespace sixpoint::repair {
namespace {

// 1 GB, and where that may not do, 256 MB and 10 kB a file: 343 MB were measured with 60,000 files,
// and longer names and reasons take more.
std::size_t merge_mb(std::size_t files) { return std::max<std::size_t>(1024, 256 + files / 100); }

}  // namespace

std::string shell_word(const std::string& text) {
  const bool plain = !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
           std::string_view("/._-+:,=@").find(c) != std::string_view::npos;
  });
  if (plain) {
    return text;
  }
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') {
      quoted += "'\\''";
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

// No path may stand in a comment: one with a line end would go on as commands.
std::string slurm_script(const ArchiveScripts& scripts) {
  return fmt::format(R"(#!/bin/bash
# Repairs this plan's files as a Slurm job array, one shard per task:  sbatch run.sbatch OUTDIR
# What is done is not done again, and a task that was killed goes on where it was: submit it again
# as often as you like. Then: sixpoint archive merge PLANDIR. 'sixpoint archive submit' does both.
#SBATCH --job-name=sixpoint
#SBATCH --array=0-{2}{3}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --mem=1G
#SBATCH --requeue
#SBATCH --open-mode=append
set -euo pipefail
plan={0}
program=${{SIXPOINT:-{1}}}
output=${{1:?'usage: sbatch run.sbatch OUTDIR'}}
shard=${{SLURM_ARRAY_TASK_ID:?'run this with sbatch; on one machine use run_all.sh'}}
status=0
"$program" archive run "$plan" --shard "$shard" -o "$output" --jobs "${{SLURM_CPUS_PER_TASK:-1}}" || status=$?
# 1: the shard is done, and something in it cannot be repaired. The task did its work; merge says what.
if [ "$status" -eq 1 ]; then status=0; fi
exit "$status"
)",
                     shell_word(scripts.folder), shell_word(scripts.program), scripts.shards - 1,
                     scripts.at_once > 0 ? fmt::format("%{}", scripts.at_once) : "");
}

std::vector<std::string> array_command(const std::string& folder, const std::string& output,
                                       const std::vector<std::string>& more) {
  std::vector<std::string> words = {"sbatch", "--parsable",
                                    "--output=" + folder + "/results/slurm-%A-%a.log"};
  words.insert(words.end(), more.begin(), more.end());
  words.insert(words.end(), {folder + "/run.sbatch", output});
  return words;
}

std::vector<std::string> merge_command(const std::string& folder, const std::string& job,
                                       const std::vector<std::string>& more) {
  std::vector<std::string> words = {"sbatch", "--parsable", "--dependency=afterany:" + job,
                                    "--output=" + folder + "/merge.log"};
  words.insert(words.end(), more.begin(), more.end());
  words.push_back(folder + "/merge.sbatch");
  return words;
}

std::string merge_script(const ArchiveScripts& scripts) {
  return fmt::format(R"script(#!/bin/bash
# Puts the results together, as a job behind the array: 'sixpoint archive submit' submits both.
#SBATCH --job-name=sixpoint-merge
#SBATCH --mem={2}M
set -uo pipefail
plan={0}
program=${{SIXPOINT:-{1}}}
"$program" archive merge "$plan" --json >"$plan/merge.json.part"
status=$?
# The last line of a whole answer. A merge that was killed leaves an earlier answer as it is.
if [ "$(tail -n 1 "$plan/merge.json.part")" = "}}" ]; then mv "$plan/merge.json.part" "$plan/merge.json"; fi
exit "$status"
)script",
                     shell_word(scripts.folder), shell_word(scripts.program),
                     merge_mb(scripts.files));
}

std::string shell_script(const ArchiveScripts& scripts) {
  return fmt::format(R"(#!/bin/bash
# Repairs this plan's files on this machine, without Slurm:  bash run_all.sh OUTDIR
# and merges the results. JOBS says how many shards at a time (default: one per core). Ends with merge's exit code, and with 2
# at least where a shard was refused: what is merged is then what was there before.
set -euo pipefail
plan={0}
program=${{SIXPOINT:-{1}}}
output=${{1:?'usage: bash run_all.sh OUTDIR'}}
# A shard that fails stops no other one: merge names it.
not_run=0
seq 0 {2} | xargs -P "${{JOBS:-$(nproc)}}" -n 1 \
  sh -c '"$1" archive run "$2" --shard "$4" -o "$3" >/dev/null || [ "$?" -lt 64 ]' _ \
  "$program" "$plan" "$output" || not_run=2
status=0
"$program" archive merge "$plan" || status=$?
[ "$status" -ge "$not_run" ] || status=$not_run
exit "$status"
)",
                     shell_word(scripts.folder), shell_word(scripts.program), scripts.shards - 1);
}

}  // namespace sixpoint::repair
