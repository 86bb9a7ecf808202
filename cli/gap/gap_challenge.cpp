// sixpoint gap challenge: draws effects, hides them from the diagnosis, scores its answers.
//
// Each trial is a bundle in a temporary folder; `gap diagnose` runs as a process of its own that
// gets nothing but that folder, and with --strip a catalogue without the true effects.
#include "cli/gap/gap_challenge.h"

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <memory>
#include <set>

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "base/text/html.h"
#include "cli/command.h"
#include "cli/output.h"
#include "cli/workers.h"
#include "gap/challenge/outside.h"
#include "gap/challenge/recorded.h"
#include "gap/challenge/score.h"
#include "gap/challenge/trials.h"
#include "sim/bundle_writer.h"

extern char** environ;  // NOLINT(readability-redundant-declaration): POSIX has it in no header

namespace sixpoint::cli {

namespace {

using gap::GapTrial;
using gap::Outcome;
using gap::Scores;
using gap::Share;

struct Options {
  std::size_t trials = 100;
  std::uint64_t seed = 1;
  std::string protocol = "engineering";
  std::vector<std::string> only;
  bool strip = false;
  gap::TrialShares shares;
  unsigned jobs = 1;
  std::string program;
  std::string keep;
  std::string html;
  std::string recording;  // a bundle or a .gt3x file to which effects are added
  // What the diagnosis says of that bundle as it is.
  std::set<std::string> own_effects;
  bool own_unknown = false;
  OutputOptions outputs;
  bool json = false;
};

// Runs `arguments` with standard output in a file, at most `limit_s` seconds; the exit code.
Result<int> run_process(const std::vector<std::string>& arguments, const std::string& output,
                        double limit_s, Clock& clock) {
  const auto failed = [&](const char* what) {
    return fail(ErrorCode::internal, what, arguments.front(), "name the program with --program");
  };
  std::vector<char*> list;
  for (const std::string& argument : arguments) {
    list.push_back(const_cast<char*>(argument.c_str()));  // NOLINT: posix_spawn does not write
  }
  list.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t process = 0;
  const int spawned =
      posix_spawn(&process, arguments.front().c_str(), &actions, nullptr, list.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (spawned != 0) {
    return failed("the program can't be started");
  }
  const auto start = clock.elapsed();
  int status = 0;
  for (;;) {
    const pid_t ended = waitpid(process, &status, WNOHANG);
    if (ended == process) {
      break;
    }
    if (ended < 0) {
      return failed("the program got lost");
    }
    if (std::chrono::duration<double>(clock.elapsed() - start).count() > limit_s) {
      kill(process, SIGKILL);
      waitpid(process, &status, 0);
      return failed("the program took too long");
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
                Outcome& outcome) {
  constexpr double kLimit_s = 120;
  constexpr int kFirstError = 64;  // smaller exit codes are verdicts
  SIXPOINT_ASSIGN(const int exit_code, run_process(arguments, answer, kLimit_s, env.clock));
  if (exit_code >= kFirstError) {
    outcome.failure = fmt::format("exit code {}", exit_code);
    return {};
  }
  SIXPOINT_ASSIGN(const Bytes text, read_file(env.files, answer));
  gap::read_answer(nlohmann::json::parse(text.begin(), text.end(), nullptr, false), outcome);
  return {};
}

bool is_plain(const std::string& recording) {
  std::error_code error;
  return std::filesystem::is_regular_file(recording, error);
}

Result<Outcome> run_trial(Env& env, const Options& options, sim::StandardProtocol protocol,
                          const std::string& folder, std::size_t index) {
  SIXPOINT_ASSIGN(const GapTrial trial,
                  gap::draw_trial(options.seed, index, protocol, options.shares, options.only));
  Outcome outcome = gap::outcome_of(trial);
  const bool plain = is_plain(options.recording);
  const std::string bundle = fmt::format("{}/{:06}{}", folder, index, plain ? ".gt3x" : "");
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
  if (const Status done = diagnose(env, arguments, answer, outcome); !done) {
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

// Diagnoses the recording to which effects will be added, as it is.
Status learn_own(Env& env, Options& options, const std::string& folder) {
  Outcome own;
  SIXPOINT_CHECK(diagnose(env, {options.program, "gap", "diagnose", options.recording, "--json"},
                          folder + "/own.answer.json", own));
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

Json to_json(const Share& share) {
  Json json;
  json["right"] = static_cast<std::uint64_t>(share.right);
  json["of"] = static_cast<std::uint64_t>(share.of);
  json["share"] = share.of > 0 ? Json(share.right / share.of) : Json(nullptr);
  json["interval"] = share.interval();
  return json;
}

std::string text_of(const Share& share) {
  const auto [low, high] = share.interval();
  return share.of == 0
             ? "-"
             : fmt::format("{:.0f} of {:.0f} = {:.1f} % ({:.1f} to {:.1f} %)", share.right,
                           share.of, 100 * share.right / share.of, 100 * low, 100 * high);
}

Json to_json(const Outcome& outcome, std::size_t index) {
  Json entry;
  entry["trial"] = index;
  entry["kind"] = gap::to_string(outcome.kind);
  entry["truth"] = Json::array();
  for (const gap::TrialEffect& effect : outcome.truth) {
    entry["truth"].push_back({{"name", effect.name}, {"severity", effect.severity}});
  }
  entry["verdict"] = outcome.verdict;
  entry["named"] = Json::array();
  for (const auto& [name, probability] : outcome.named) {
    entry["named"].push_back({{"name", name}, {"probability", number(probability)}});
  }
  entry["unknown"] = outcome.unknown;
  entry["unknown_probability"] = number(outcome.unknown_probability);
  entry["honest"] = outcome.honest();
  entry["confidently_wrong"] = outcome.confidently_wrong();
  entry["seconds"] = outcome.seconds;
  if (!outcome.failure.empty()) {
    entry["failure"] = outcome.failure;
  }
  return entry;
}

Json to_json(const Options& options, const Scores& scores, const std::vector<Outcome>& outcomes) {
  Json json = document("gap-challenge");
  json["trials"] = outcomes.size();
  json["seed"] = options.seed;
  json["protocol"] = options.protocol;
  json["strip"] = options.strip;
  if (!options.recording.empty()) {
    json["recording"] = options.recording;
    json["own_effects"] = options.own_effects;
    json["own_unknown"] = options.own_unknown;
  }
  Json& result = json["scores"];
  result["single_first_right"] = to_json(scores.first);
  result["single_alone_and_right"] = to_json(scores.exact);
  result["single_first_right_observable"] = to_json(scores.first_observable);
  result["single_first_right_observable_severity_1"] = to_json(scores.first_large);
  result["single_family_right"] = to_json(scores.family);
  result["none_alarms"] = to_json(scores.alarms);
  result["pair_f1"] = number(scores.f1());
  result["realistic_dominant_first"] = to_json(scores.dominant);
  result["realistic_recall"] = to_json(scores.recall);
  result["realistic_precision"] = to_json(scores.precise);
  result["realistic_exact_set"] = to_json(scores.exact_set);
  result["realistic_needless_unknown"] = to_json(scores.needless);
  result["withheld_honest"] = to_json(scores.withheld_honest);
  result["withheld_confidently_wrong"] = to_json(scores.withheld_wrong);
  result["expected_calibration_error"] = number(scores.calibration_error());
  result["unknown_calibration_error"] = number(scores.unknown_calibration_error());
  result["failures"] = to_json(scores.failures);
  json["calibration"] = Json::array();
  for (const Scores::Bin& bin : scores.bins) {
    json["calibration"].push_back({{"probability", bin.of > 0 ? Json(bin.sum_p / bin.of) : Json()},
                                   {"right", bin.of > 0 ? Json(bin.right / bin.of) : Json()},
                                   {"candidates", static_cast<std::uint64_t>(bin.of)}});
  }
  json["by_effect"] = Json::array();
  for (const auto& [name, effect] : scores.by_effect) {
    json["by_effect"].push_back({{"name", name},
                                 {"first_right", to_json(effect.first)},
                                 {"family_right", to_json(effect.family)},
                                 {"missed", static_cast<std::uint64_t>(effect.missed)},
                                 {"not_observable", static_cast<std::uint64_t>(effect.blind)}});
  }
  json["outcomes"] = Json::array();
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    json["outcomes"].push_back(to_json(outcomes[i], i));
  }
  const double answered = scores.failures.of - scores.failures.right;
  json["seconds"]["mean"] = number(answered > 0 ? scores.seconds_sum / answered : 0);
  json["seconds"]["max"] = scores.seconds_max;
  return json;
}

// What people read: the same lines on the terminal and in the page.
std::vector<std::pair<std::string, std::string>> lines(const Scores& scores) {
  return {{"one effect: first-named right", text_of(scores.first)},
          {"  ... and nothing else named", text_of(scores.exact)},
          {"  ... where this protocol can show it", text_of(scores.first_observable)},
          {"  ... and at least of typical size", text_of(scores.first_large)},
          {"  ... right family", text_of(scores.family)},
          {"two effects: F1 of the set", fmt::format("{:.3f}", scores.f1())},
          {"nothing missing: alarms", text_of(scores.alarms)},
          {"realistic: dominant effect first", text_of(scores.dominant)},
          {"  ... effects named (recall)", text_of(scores.recall)},
          {"  ... names that are right (precision)", text_of(scores.precise)},
          {"  ... exactly the effects that are there", text_of(scores.exact_set)},
          {"  ... needless unknown", text_of(scores.needless)},
          {"withheld: unknown, or right family", text_of(scores.withheld_honest)},
          {"withheld: confidently wrong", text_of(scores.withheld_wrong)},
          {"expected calibration error", fmt::format("{:.3f}", scores.calibration_error())},
          {"  ... of unknown", fmt::format("{:.3f}", scores.unknown_calibration_error())},
          {"failures of the program", text_of(scores.failures)}};
}

std::string page(const Options& options, const Scores& scores,
                 const std::vector<Outcome>& outcomes) {
  std::string html =
      "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>gap challenge</title>"
      "<style>body{font:15px/1.5 sans-serif;max-width:60em;margin:2em auto;padding:0 1em}"
      "table{border-collapse:collapse;margin:1em 0}td,th{padding:.2em .8em;text-align:left;"
      "border-bottom:1px solid #ccc}td.n{text-align:right}.bad{color:#b00020}</style>";
  html += fmt::format(
      "<h1>Blind check of the gap diagnosis</h1><p>{} trials, {} protocol, seed {}{}. Shares with "
      "95 % intervals.</p><table>",
      outcomes.size(), options.protocol, options.seed,
      options.strip ? ", true effects taken out of the catalogue" : "");
  for (const auto& [what, value] : lines(scores)) {
    html += fmt::format("<tr><td>{}</td><td>{}</td></tr>", what, value);
  }
  html +=
      "</table><h2>By effect</h2><table><tr><th>effect<th>first-named right<th>family right"
      "<th>missed<th>not observable</tr>";
  for (const auto& [name, effect] : scores.by_effect) {
    html += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{}</td><td class=\"n\">{:.0f}</td><td class=\"n\">{:.0f}"
        "</td></tr>",
        name, text_of(effect.first), text_of(effect.family), effect.missed, effect.blind);
  }
  html += "</table><h2>Calibration</h2><table><tr><th>said<th>was<th>candidates</tr>";
  for (const Scores::Bin& bin : scores.bins) {
    if (bin.of > 0) {
      html += fmt::format("<tr><td>{:.2f}</td><td>{:.2f}</td><td class=\"n\">{:.0f}</td></tr>",
                          bin.sum_p / bin.of, bin.right / bin.of, bin.of);
    }
  }
  html +=
      "</table><h2>Trials</h2><table><tr><th>#<th>truth (severity)<th>named (probability)"
      "<th>verdict</tr>";
  const auto escaped = [](const std::string& text) { return html_escaped(printable(text, 200)); };
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    const Outcome& outcome = outcomes[i];
    std::vector<std::string> truth;
    for (const gap::TrialEffect& effect : outcome.truth) {
      truth.push_back(fmt::format("{} ({:.2f})", effect.name, effect.severity));
    }
    std::vector<std::string> named;
    for (const auto& [name, probability] : outcome.named) {
      named.push_back(fmt::format("{} ({:.2f})", name, probability));
    }
    if (outcome.unknown) {
      named.emplace_back("unknown");
    }
    html += fmt::format("<tr{}><td class=\"n\">{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                        outcome.confidently_wrong() ? " class=\"bad\"" : "", i,
                        fmt::join(truth, ", "), escaped(fmt::format("{}", fmt::join(named, ", "))),
                        escaped(outcome.failure.empty() ? outcome.verdict : outcome.failure));
  }
  return html + "</table></html>\n";
}

// Which effects are drawn, and of which shares: a recording takes fewer of them.
Status check_effects(Options& options) {
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

Status challenge(Options options, Context& context) {
  const auto protocol = sim::parse_standard_protocol(options.protocol);
  if (!protocol) {
    return fail(ErrorCode::usage, "there is no such protocol", options.protocol,
                "production or engineering");
  }
  SIXPOINT_CHECK(check_effects(options));
  if (options.program.empty()) {
    options.program = this_program();
  }
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.input(options.recording));
  SIXPOINT_CHECK(outputs.file("--html", options.html));
  std::error_code error;
  const bool temporary = options.keep.empty();
  std::string folder = options.keep;
  if (temporary) {
    std::string pattern =
        (std::filesystem::temp_directory_path(error) / "sixpoint-challenge-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) {
      return fail(ErrorCode::cannot_create, "no temporary folder can be made", pattern,
                  "name one with --keep");
    }
    folder = pattern;
  } else {
    SIXPOINT_CHECK(outputs.folder("--keep", folder));
    SIXPOINT_CHECK(context.env.files.make_folders(folder));
  }
  Env env = outputs.env();
  if (!options.recording.empty()) {
    SIXPOINT_CHECK(learn_own(env, options, folder));
    if (std::all_of(options.only.begin(), options.only.end(),
                    [&](const std::string& name) { return options.own_effects.contains(name); })) {
      return fail(ErrorCode::bad_data, "the recording has of its own all that could be added to it",
                  options.recording, "give the recording of a unit that reads right");
    }
  }
  std::vector<Result<Outcome>> results(options.trials, Result<Outcome>(Outcome{}));
  {
    Progress progress(context, "trials", options.trials);
    for_each_job(
        options.trials, options.jobs,
        [&](std::size_t i) { results[i] = run_trial(env, options, *protocol, folder, i); },
        [&](std::size_t done) { progress.at(done); });
  }
  if (temporary) {
    std::filesystem::remove_all(folder, error);
  }
  std::vector<Outcome> outcomes;
  for (Result<Outcome>& result : results) {
    if (!result) {
      return tl::unexpected(result.error());
    }
    outcomes.push_back(std::move(*result));
  }
  const Scores scores = gap::score(outcomes, options.strip);
  if (!options.html.empty()) {
    SIXPOINT_CHECK(write_file(outputs.files(), options.html, page(options, scores, outcomes)));
  }
  if (options.json) {
    print_json(context, to_json(options, scores, outcomes));
  } else {
    for (const auto& [what, value] : lines(scores)) {
      context.text() << fmt::format("{:<42} {}\n", what, value);
    }
  }
  if (scores.failures.right > 0) {
    context.worsen(kExitFailed);
  }
  return {};
}

}  // namespace

void add_gap_challenge(CLI::App& gap_command, Context& context) {
  auto [command, options] = add_command<Options>(
      gap_command, context, "gap-challenge", "challenge",
      "draws effects, hides them from the diagnosis, and scores its answers", challenge);
  command.add_option("--trials", options.trials, "how many bundles")
      ->check(CLI::Range(std::size_t{1}, std::size_t{1'000'000}));
  command.add_option("--seed", options.seed, "the same seed draws the same trials");
  command.add_option("--protocol", options.protocol, "production or engineering (default)");
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
                  "share of trials with many small effects and one that dominates")
      ->check(CLI::Range(0.0, 1.0));
  command.add_flag("--rates", options.shares.any_rate, "draw sample rates from 20 to 100 Hz");
  command.add_option("--jobs", options.jobs, "diagnoses at a time (0 = one per core)");
  command.add_option("--program", options.program, "the sixpoint to test (default: this one)");
  command.add_option("--keep", options.keep, "leave bundles and answers in this folder");
  command.add_option("--html", options.html, "also write the scores as a page");
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli
