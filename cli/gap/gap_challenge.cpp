// sixpoint gap challenge: draws effects, hides them from the diagnosis, scores its answers.
//
// Each trial is a bundle in a temporary folder; `gap diagnose` runs as a process of its own that
// gets nothing but that folder, and with --strip a catalogue without the true effects.
#include <algorithm>
#include <atomic>
#include <csignal>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "base/text/json_text.h"
#include "cli/child_process.h"
#include "cli/command.h"
#include "cli/gap/challenge_scores.h"
#include "cli/gap/gap_commands.h"
#include "cli/gap/gap_export.h"
#include "cli/output.h"
#include "cli/stop_request.h"
#include "cli/workers.h"
#include "gap/challenge/outside.h"
#include "gap/challenge/recorded.h"
#include "gap/challenge/score.h"
#include "gap/challenge/suggestion.h"
#include "gap/challenge/trials.h"
#include "sim/bundle_writer.h"

namespace sixpoint::cli {

namespace {

using gap::Followed;
using gap::GapTrial;
using gap::Outcome;
using gap::Scores;

struct GapChallengeCommandOptions : ChallengeSetting {
  std::size_t trials = 100;
  std::vector<std::string> only;
  gap::TrialShares shares;
  unsigned jobs = 1;
  std::string program;
  std::string keep;
  std::string html;
  std::string export_to;
  std::string labels;
  bool follow = false;
  bool dry_run = false;
  OutputOptions outputs;
  bool json = false;
};

// Was the command told to stop? Asked by those that wait for a diagnosis.
using Stopped = std::function<bool()>;

// Runs `arguments` with standard output in a file, at most `limit_s` seconds; the exit code.
Result<int> run_process(const std::vector<std::string>& arguments, const std::string& output,
                        double limit_s, Clock& clock, const Stopped& stopped) {
  const auto failed = [&](const char* what) {
    return fail(ErrorCode::internal, what, arguments.front(), "name the program with --program");
  };
  const int file = ::open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file < 0) {
    return failed("the file of its answer can't be opened");
  }
  const auto process = start_child(arguments, file, ChildErrors::dropped);
  ::close(file);
  if (!process) {
    return failed("the program can't be started");
  }
  const auto start = clock.elapsed();
  int status = 0;
  for (;;) {
    const pid_t ended = waitpid(*process, &status, WNOHANG);
    if (ended == *process) {
      break;
    }
    if (ended < 0) {
      return failed("the program got lost");
    }
    const bool too_long = std::chrono::duration<double>(clock.elapsed() - start).count() > limit_s;
    if (too_long || stopped()) {
      kill(*process, SIGKILL);
      waitpid(*process, &status, 0);
      return failed(too_long ? "the program took too long" : "stopped");
    }
    clock.sleep(std::chrono::milliseconds(2));
  }
  if (!WIFEXITED(status)) {
    return failed("the program crashed");
  }
  return WEXITSTATUS(status);
}

// Runs a diagnosis as a process and reads its answer; exit codes of errors and answers of another
// form are the outcome's failure.
Status diagnose(Env& env, const std::vector<std::string>& arguments, const std::string& answer,
                const Stopped& stopped, Outcome& outcome) {
  constexpr double kLimit_s = 120;
  constexpr int kFirstError = 64;  // smaller exit codes are verdicts
  SIXPOINT_ASSIGN(const int exit_code,
                  run_process(arguments, answer, kLimit_s, env.clock, stopped));
  if (exit_code >= kFirstError) {
    outcome.failure = fmt::format("exit code {}", exit_code);
    return {};
  }
  SIXPOINT_ASSIGN(const Bytes text, read_file(env.files, answer));
  gap::read_answer(parse_json<nlohmann::json>(as_text(text)), outcome);
  return {};
}

bool is_plain(const std::string& recording) {
  std::error_code error;
  return std::filesystem::is_regular_file(recording, error);
}

// Writes the trial and diagnoses it.
Result<Outcome> answer_trial(Env& env, const GapChallengeCommandOptions& options,
                             const GapTrial& trial, const std::string& name,
                             const Stopped& stopped) {
  Outcome outcome = gap::outcome_of(trial);
  const bool plain = is_plain(options.recording);
  const std::string bundle = name + (plain ? ".gt3x" : "");
  if (options.recording.empty()) {
    SIXPOINT_CHECK(sim::write_bundle(env.files, bundle, trial.scenario));
  } else if (plain) {
    SIXPOINT_CHECK(gap::write_plain_trial(env.files, options.recording, bundle,
                                          trial.scenario.protocol->effects));
  } else {
    SIXPOINT_CHECK(gap::write_recorded_trial(env.files, options.recording, bundle,
                                             trial.scenario.protocol->effects,
                                             trial.scenario.seed));
  }
  std::vector<std::string> arguments = {options.program, "gap", "diagnose", bundle, "--json"};
  if (options.strip) {
    for (const gap::TrialEffect& effect : trial.effects) {
      if (sim::find_effect(effect.name)) {
        arguments.insert(arguments.end(), {"--without", effect.name});
      }
    }
  }
  const std::string answer = bundle + ".answer.json";
  const auto start = env.clock.elapsed();
  if (const Status done = diagnose(env, arguments, answer, stopped, outcome); !done) {
    outcome.failure = done.error().what;
  }
  outcome.seconds = std::chrono::duration<double>(env.clock.elapsed() - start).count();
  // What the recording has of its own is not what was added.
  std::erase_if(outcome.named,
                [&](const auto& named) { return options.own_effects.contains(named.first); });
  outcome.unknown = outcome.unknown && !options.own_unknown;
  if (options.keep.empty()) {
    std::error_code ignored;
    std::filesystem::remove_all(bundle, ignored);
    std::filesystem::remove(answer, ignored);
  }
  return outcome;
}

// One trial; with --follow-suggestion twice: as it is, and with the segment that it suggests.
Result<Followed> run_trial(Env& env, const GapChallengeCommandOptions& options,
                           sim::StandardProtocol protocol, const std::string& folder,
                           std::size_t index, const Stopped& stopped) {
  SIXPOINT_ASSIGN(GapTrial trial,
                  gap::draw_trial(options.seed, index, protocol, options.shares, options.only));
  const std::string name = fmt::format("{}/{:06}", folder, index);
  Followed followed;
  SIXPOINT_ASSIGN(followed.before, answer_trial(env, options, trial, name, stopped));
  if (options.follow && !followed.before.suggestions.empty()) {
    SIXPOINT_CHECK(gap::follow(trial.scenario, followed.before.suggestions.front().segment));
    SIXPOINT_ASSIGN(followed.after, answer_trial(env, options, trial, name + "-followed", stopped));
  }
  return followed;
}

// Diagnoses the recording to which effects will be added, as it is.
Status learn_own(Env& env, GapChallengeCommandOptions& options, const std::string& folder,
                 const Stopped& stopped) {
  Outcome own;
  SIXPOINT_CHECK(diagnose(env, {options.program, "gap", "diagnose", options.recording, "--json"},
                          folder + "/own.answer.json", stopped, own));
  if (!own.failure.empty()) {
    return fail(ErrorCode::bad_data, "the recording can't be diagnosed", options.recording,
                "sixpoint gap diagnose says why");
  }
  for (const auto& [name, probability] : own.named) {
    options.own_effects.insert(name);
  }
  options.own_unknown = own.unknown;
  return {};
}

// Which effects are drawn, and of which shares: a recording takes fewer of them.
Status check_effects(GapChallengeCommandOptions& options) {
  if (!options.recording.empty()) {
    options.shares.outside = 0;
    options.shares.pair = 0;
    const auto& can = is_plain(options.recording) ? gap::effects_for_plain_recordings()
                                                  : gap::effects_for_recordings();
    if (options.only.empty()) {
      options.only = can;
    }
    for (const std::string& name : options.only) {
      if (std::find(can.begin(), can.end(), name) == can.end()) {
        return fail(ErrorCode::usage, "this effect can't be added to a recording", name,
                    fmt::format("one of {}", fmt::join(can, ", ")));
      }
    }
  }
  for (const std::string& name : options.only) {
    const auto& outside = gap::outside_kinds();
    const bool is_outside =
        std::any_of(outside.begin(), outside.end(),
                    [&](const gap::OutsideKind& kind) { return kind.effect.name == name; });
    if (const auto found = sim::find_effect(name); !found && !is_outside) {
      return tl::unexpected(found.error());
    }
  }
  return {};
}

// Bundles for others, instead of a diagnosis here.
Status export_trials(const GapChallengeCommandOptions& options, sim::StandardProtocol protocol,
                     Context& context) {
  if (options.strip || options.follow || !options.recording.empty() || !options.keep.empty() ||
      !options.html.empty() || !options.program.empty()) {
    return fail(
        ErrorCode::usage,
        "--export goes without --strip, --follow-suggestion, --recording, --keep, --html and "
        "--program",
        {}, "sixpoint gap score scores what another program answers");
  }
  const ExportOptions how = {.trials = options.trials,
                             .seed = options.seed,
                             .protocol = protocol,
                             .only = options.only,
                             .shares = options.shares,
                             .folder = options.export_to,
                             .labels = options.labels,
                             .jobs = options.jobs,
                             .dry_run = options.dry_run,
                             .outputs = options.outputs,
                             .json = options.json};
  return export_challenge(how, context);
}

// Where the bundles are made; a temporary folder goes with it.
class TrialFolder {
 public:
  TrialFolder() = default;
  TrialFolder(const TrialFolder&) = delete;
  TrialFolder& operator=(const TrialFolder&) = delete;
  ~TrialFolder() {
    std::error_code ignored;
    if (is_temporary_) {
      std::filesystem::remove_all(path_, ignored);
    }
  }

  Status make(const std::string& keep, Outputs& outputs) {
    path_ = keep;
    if (!keep.empty()) {
      SIXPOINT_CHECK(outputs.folder("--keep", path_));
      return outputs.files().make_folders(path_);
    }
    std::error_code error;
    path_ = (std::filesystem::temp_directory_path(error) / "sixpoint-challenge-XXXXXX").string();
    is_temporary_ = mkdtemp(path_.data()) != nullptr;
    return is_temporary_ ? Status()
                         : fail(ErrorCode::cannot_create, "no temporary folder can be made", path_,
                                "name one with --keep");
  }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  bool is_temporary_ = false;
};

// Empty where the command was told to stop.
Result<std::vector<Followed>> run_trials(Env& env, const GapChallengeCommandOptions& options,
                                         sim::StandardProtocol protocol, const std::string& folder,
                                         StopRequest& stop, Context& context) {
  std::vector<Result<Followed>> results(options.trials, Result<Followed>(Followed{}));
  std::atomic<bool> stopping{false};
  {
    Progress progress(context, "trials", options.trials);
    const Stopped stopped = [&stopping] { return stopping.load(); };
    for_each_job(
        options.trials, options.jobs,
        [&](std::size_t i) { results[i] = run_trial(env, options, protocol, folder, i, stopped); },
        [&](std::size_t done) {
          progress.at(done);
          stopping = stop.requested();
        },
        &stopping);
  }
  if (stopping) {
    return std::vector<Followed>();
  }
  std::vector<Followed> trials;
  for (Result<Followed>& result : results) {
    SIXPOINT_ASSIGN(Followed trial, std::move(result));
    trials.push_back(std::move(trial));
  }
  return trials;
}

void print_scores(const GapChallengeCommandOptions& options, const Scores& scores,
                  const std::vector<Outcome>& outcomes, const std::vector<Followed>& trials,
                  Context& context) {
  if (options.json) {
    Json json = scores_json(options, scores, outcomes);
    if (options.follow) {
      json["followed"] = gain_json(gap::gain_of(trials));
    }
    print_json(context, json);
    return;
  }
  auto lines = scores_lines(scores);
  if (options.follow) {
    const auto more = gain_lines(gap::gain_of(trials));
    lines.insert(lines.end(), more.begin(), more.end());
  }
  for (const auto& [what, value] : lines) {
    context.text() << fmt::format("{:<42} {}\n", what, value);
  }
}

Status end_stopped(const GapChallengeCommandOptions& options, Context& context) {
  if (options.json) {
    Json json = document("gap-challenge");
    json["stopped"] = true;
    print_json(context, json);
  }
  context.people << "stopped; nothing is scored\n";
  context.worsen(kExitStopped);
  return {};
}

Status challenge(GapChallengeCommandOptions options, Context& context) {
  const auto protocol = sim::parse_standard_protocol(options.protocol);
  if (!protocol) {
    return fail(ErrorCode::usage, "there is no such protocol", options.protocol,
                "production, production+ or engineering");
  }
  SIXPOINT_CHECK(check_effects(options));
  if (!options.export_to.empty()) {
    return export_trials(options, *protocol, context);
  }
  if (!options.labels.empty() || options.dry_run) {
    return fail(ErrorCode::usage, "--labels and --dry-run belong to --export", {},
                "name a folder with --export");
  }
  if (options.follow && (options.strip || !options.recording.empty())) {
    return fail(ErrorCode::usage, "--follow-suggestion goes without --strip and --recording", {},
                "a recording cannot be made longer");
  }
  if (options.program.empty()) {
    options.program = this_program();
  }
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.input(options.recording));
  SIXPOINT_CHECK(outputs.file("--html", options.html));
  StopRequest stop;  // Ctrl-C ends the diagnoses under way, and leaves no folder
  TrialFolder folder;
  SIXPOINT_CHECK(folder.make(options.keep, outputs));
  Env env = outputs.env();
  if (!options.recording.empty()) {
    const Status learnt =
        learn_own(env, options, folder.path(), [&stop] { return stop.requested(); });
    if (stop.requested()) {
      return end_stopped(options, context);
    }
    SIXPOINT_CHECK(learnt);
    if (std::all_of(options.only.begin(), options.only.end(),
                    [&](const std::string& name) { return options.own_effects.contains(name); })) {
      return fail(ErrorCode::bad_data, "the recording has of its own all that could be added to it",
                  options.recording, "give the recording of a unit that reads right");
    }
  }
  SIXPOINT_ASSIGN(const auto trials,
                  run_trials(env, options, *protocol, folder.path(), stop, context));
  if (stop.requested()) {
    return end_stopped(options, context);
  }
  std::vector<Outcome> outcomes;
  outcomes.reserve(trials.size());
  for (const Followed& trial : trials) {
    outcomes.push_back(trial.before);
  }
  const Scores scores = gap::score(outcomes, options.strip);
  if (!options.html.empty()) {
    SIXPOINT_CHECK(
        write_file(outputs.files(), options.html, scores_page(options, scores, outcomes)));
  }
  print_scores(options, scores, outcomes, trials, context);
  if (scores.failures.right > 0) {
    context.worsen(kExitFailed);
  }
  return {};
}

}  // namespace

void add_gap_challenge(CLI::App& gap_command, Context& context) {
  auto [command, options] = add_command<GapChallengeCommandOptions>(
      gap_command, context, "gap-challenge", "challenge",
      "draws effects, hides them from the diagnosis, and scores its answers", challenge);
  command.add_option("--trials", options.trials, "how many bundles")
      ->check(CLI::Range(std::size_t{1}, std::size_t{1'000'000}));
  command.add_option("--seed", options.seed, "the same seed draws the same trials");
  command.add_option("--protocol", options.protocol,
                     "production, production+ or engineering (default)");
  command.add_option("--effects", options.only, "draw only these")->delimiter(',');
  command.add_flag("--strip", options.strip, "take the true effects out of the catalogue");
  command.add_option(
      "--recording", options.recording,
      "add effects to this bundle of a real unit at rest, or a filter mismatch to this .gt3x "
      "file, instead of simulating one");
  command.add_option("--none", options.shares.none, "share of trials without any effect")
      ->check(CLI::Range(0.0, 1.0));
  command.add_option("--pairs", options.shares.pair, "share of trials with two effects")
      ->check(CLI::Range(0.0, 1.0));
  command
      .add_option("--outside", options.shares.outside,
                  "share of trials with an effect that is not in the catalogue")
      ->check(CLI::Range(0.0, 1.0));
  command
      .add_option("--realistic", options.shares.realistic,
                  "share of trials with many small effects and one that dominates (0 without the "
                  "option)")
      ->expected(0, 1)
      ->default_str("1")  // where no number follows
      ->check(CLI::Range(0.0, 1.0));
  command.add_flag("--faint", options.shares.faint,
                   "single effects and pairs near the size at which a recording shows them at all");
  command.add_flag("--rates", options.shares.any_rate, "draw sample rates from 20 to 100 Hz");
  command.add_flag("--follow-suggestion", options.follow,
                   "also record the segment that each answer suggests first, and show the gain");
  add_jobs_option(command, options.jobs, "diagnoses at a time (0 = one per core)");
  command.add_option("--program", options.program, "the sixpoint to test (default: this one)");
  command.add_option("--keep", options.keep, "leave bundles and answers in this folder");
  command.add_option("--html", options.html, "also write the scores as a page");
  command.add_option("--export", options.export_to,
                     "diagnose nothing: write the bundles to this new folder, for other programs");
  command.add_option("--labels", options.labels,
                     "with --export: the sealed labels (default: labels.jsonl in that folder)");
  command.add_flag("--dry-run", options.dry_run, "with --export: say what would be written");
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli
