// sixpoint archive submit: the shards of a plan as a job array of Slurm, and the merge behind it.
#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include "cli/child_process.h"
#include "cli/command.h"
#include "cli/files/archive_options.h"
#include "cli/output.h"
#include "cli/people_text.h"
#include "repair/archive/archive_run.h"
#include "repair/archive/archive_scripts.h"
#include "repair/archive/plan_folder.h"

namespace sixpoint::cli {
namespace {

using Words = std::vector<std::string>;

Error not_submitted(std::string what) {
  return {ErrorCode::io, std::move(what), "sbatch",
          "see what sbatch said; nothing is lost, submit again"};
}

Error not_started(int error) {
  if (error == ENOENT) {
    return {ErrorCode::device_unavailable, "there is no sbatch on this machine", "sbatch",
            "run this on a machine of the cluster, or without Slurm: bash PLAN/run_all.sh OUTDIR"};
  }
  return not_submitted(fmt::format("it cannot be started: {}", std::strerror(error)));
}

std::string read_to_end(int read_end) {
  std::string text;
  std::array<char, 4096> piece{};
  for (;;) {
    const ssize_t count = ::read(read_end, piece.data(), piece.size());
    if (count > 0) {
      text.append(piece.data(), static_cast<std::size_t>(count));
    } else if (count == 0 || errno != EINTR) {
      return text;
    }
  }
}

// Runs sbatch and returns the number of its job: "123" or "123;cluster" (sbatch(1), --parsable).
Result<std::string> submit(const Words& words) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    return fail(not_submitted(fmt::format("no pipe: {}", std::strerror(errno))));
  }
  const auto process = start_child(words, ends[1], ChildErrors::shown);
  ::close(ends[1]);
  std::string job = process ? read_to_end(ends[0]) : std::string();
  ::close(ends[0]);
  if (!process) {
    return fail(not_started(process.error()));
  }
  int status = 0;
  while (::waitpid(*process, &status, 0) < 0 && errno == EINTR) {
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    return fail(not_submitted(WIFEXITED(status)
                                  ? fmt::format("it ended with {}", WEXITSTATUS(status))
                                  : std::string("it was killed")));
  }
  job = job.substr(0, job.find_first_of(";\n"));
  if (job.empty() || job.find_first_not_of("0123456789") != std::string::npos) {
    return fail(not_submitted(fmt::format("it answered {} and no job number", printable(job, 60))));
  }
  return job;
}

std::string shell_line(const Words& words) {
  std::string line;
  for (const std::string& word : words) {
    line += line.empty() ? "" : " ";
    line += bash_word(word);
  }
  return line;
}

// Lines that a shell can run.
std::string commands_text(const Words& array, const Words& merge) {
  constexpr std::string_view kJob = "--dependency=afterany:ARRAY";
  std::string second = shell_line(merge);
  second.replace(second.find(kJob), kJob.size(), "--dependency=\"afterany:${array%%;*}\"");
  return fmt::format("array=$({})\n{}\n", shell_line(array), second);
}

Status check_output(const ArchiveOptions& options, const std::string& folder, Context& context) {
  Outputs outputs(context, {}, options.json);
  const std::string output = absolute(options.output);
  SIXPOINT_CHECK(outputs.working_folder("--output", output));
  SIXPOINT_ASSIGN(const auto known, repair::output_folder_of(context.env.files, folder));
  if (known && *known != output) {
    return fail(ErrorCode::usage,
                fmt::format("the shards of this plan are repaired into {}", printable(*known)),
                output, fmt::format("use -o {}, or make another plan", bash_word(*known)));
  }
  return {};
}

}  // namespace

Status run_archive_submit(const ArchiveOptions& options, Context& context) {
  const std::string folder = absolute(options.plan);
  SIXPOINT_ASSIGN(const auto plan, repair::read_plan(context.env.files, folder));
  SIXPOINT_CHECK(check_output(options, folder, context));
  const Words array = repair::array_command(folder, absolute(options.output), options.sbatch);
  Words merge = repair::merge_command(folder, "ARRAY", options.sbatch);
  Json json = document("archive");
  json["plan"] = plan.id;
  json["shards"] = plan.shards.size();
  json["dry_run"] = options.dry_run;
  if (options.dry_run) {
    json["commands"] = {array, merge};
    json["array"] = nullptr;
    json["merge"] = nullptr;
    return print_answer(context, options.json, json, commands_text(array, merge));
  }
  SIXPOINT_ASSIGN(const std::string array_job, submit(array));
  merge = repair::merge_command(folder, array_job, options.sbatch);
  const auto merge_job = submit(merge);
  if (!merge_job) {
    Error error = merge_job.error();
    error.what = fmt::format("the array was submitted as job {}, the merge was not: {}", array_job,
                             error.what);
    error.hint = fmt::format("submit the merge by itself: {}", shell_line(merge));
    return fail(std::move(error));
  }
  json["commands"] = {array, merge};
  json["array"] = array_job;
  json["merge"] = *merge_job;
  return print_answer(context, options.json, json,
                      fmt::format("array {}\nmerge {}\n", array_job, *merge_job));
}

}  // namespace sixpoint::cli
