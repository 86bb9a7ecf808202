// sixpoint gap challenge: draws effects, hides them from the diagnosis, scores its answers.
//
// Each trial is a bundle in a temporary folder; `gap diagnose` runs as a process of its own that
// gets nothing but that folder, and with --strip a catalogue without the true effects.
#include "station/cli/gap_challenge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "sim/bundle_writer.h"
#include "station/cli/workers.h"
#include "station/gap_outside.h"
#include "station/gap_recorded.h"
#include "station/gap_trials.h"

extern char** environ;  // NOLINT(readability-redundant-declaration): POSIX has it in no header

namespace sixpoint::cli {

namespace {

using station::GapTrial;
using station::TrialKind;

struct Options {
  std::size_t trials = 100;
  std::uint64_t seed = 1;
  std::string protocol = "engineering";
  std::vector<std::string> only;
  bool strip = false;
  station::TrialShares shares;
  unsigned jobs = 1;
  std::string program;
  std::string keep;
  std::string html;
  std::string recording;  // a bundle or a .gt3x file to which effects are added
  // What the diagnosis says of that bundle as it is.
  std::set<std::string> own_effects;
  bool own_unknown = false;
  bool json = false;
};

// What came of one trial.
struct Outcome {
  TrialKind kind = TrialKind::none;
  std::vector<station::TrialEffect> truth;
  std::string failure;  // of the program; empty where it answered
  std::string verdict;
  std::vector<std::pair<std::string, double>> named;       // accepted, strongest first
  std::vector<std::pair<std::string, double>> candidates;  // all, with probabilities
  std::set<std::string> confounded;                        // with the first one named
  std::set<std::string> not_observable;
  bool unknown = false;
  double seconds = 0;

  bool has(std::string_view name) const {
    return std::any_of(truth.begin(), truth.end(),
                       [&](const station::TrialEffect& effect) { return effect.name == name; });
  }
  bool has_family(std::string_view name) const {
    return std::any_of(truth.begin(), truth.end(), [&](const station::TrialEffect& effect) {
      return station::family_of(effect.name) == station::family_of(name);
    });
  }
  bool first_right() const { return !named.empty() && has(named.front().first); }
  bool family_right() const {
    return !named.empty() && (has_family(named.front().first) ||
                              std::any_of(confounded.begin(), confounded.end(),
                                          [&](const std::string& name) { return has(name); }));
  }
  // The protocol can't show it, and the diagnosis says so and blames nobody else.
  bool honestly_blind() const {
    return named.empty() && !truth.empty() &&
           std::all_of(truth.begin(), truth.end(), [&](const station::TrialEffect& effect) {
             return not_observable.contains(effect.name);
           });
  }
  // For an effect that the diagnosis can't know: what the protocol can't show needs no "unknown".
  bool honest() const { return unknown || family_right() || honestly_blind(); }
  bool confidently_wrong() const {
    constexpr double kConfident = 0.9;
    return !unknown && !named.empty() && named.front().second > kConfident && !family_right();
  }
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

// Takes what is there and of the right type; an answer of another form counts as a failure.
void read_answer(const Json& json, Outcome& outcome) {
  if (!json.is_object() || !json.contains("verdict") || !json["verdict"].is_string()) {
    outcome.failure = "no answer of the agreed form";
    return;
  }
  outcome.verdict = json["verdict"].get<std::string>();
  const auto list = [&](const char* key) {
    std::vector<std::pair<std::string, double>> found;
    if (const auto effects = json.find(key); effects != json.end() && effects->is_array()) {
      for (const Json& effect : *effects) {
        if (effect.is_object() && effect.contains("name") && effect["name"].is_string()) {
          const auto p = effect.find("probability");
          found.emplace_back(effect["name"].get<std::string>(),
                             p != effect.end() && p->is_number() ? p->get<double>() : 0.0);
        }
      }
    }
    return found;
  };
  outcome.named = list("effects");
  outcome.candidates = list("candidates");
  for (const auto& [name, probability] : list("not_observable")) {
    outcome.not_observable.insert(name);
  }
  if (!outcome.named.empty()) {
    const Json& first = json["effects"][0];
    if (const auto other = first.find("confounded_with");
        other != first.end() && other->is_array()) {
      for (const Json& name : *other) {
        if (name.is_string()) {
          outcome.confounded.insert(name.get<std::string>());
        }
      }
    }
  }
  if (const auto unknown = json.find("unknown"); unknown != json.end() && unknown->is_object()) {
    const auto present = unknown->find("present");
    outcome.unknown = present != unknown->end() && present->is_boolean() && present->get<bool>();
  }
}

bool is_plain(const std::string& recording) {
  std::error_code error;
  return std::filesystem::is_regular_file(recording, error);
}

Result<Outcome> run_trial(Env& env, const Options& options, sim::StandardProtocol protocol,
                          const std::string& folder, std::size_t index) {
  SIXPOINT_ASSIGN(const GapTrial trial,
                  station::draw_trial(options.seed, index, protocol, options.shares, options.only));
  Outcome outcome;
  outcome.kind = trial.kind;
  outcome.truth = trial.effects;
  const bool plain = is_plain(options.recording);
  const std::string bundle = fmt::format("{}/{:06}{}", folder, index, plain ? ".gt3x" : "");
  if (options.recording.empty()) {
    SIXPOINT_CHECK(sim::write_bundle(env.files, bundle, trial.scenario));
  } else if (plain) {
    SIXPOINT_CHECK(station::write_plain_trial(env.files, options.recording, bundle,
                                              trial.scenario.protocol->effects));
  } else {
    SIXPOINT_CHECK(station::write_recorded_trial(env.files, options.recording, bundle,
                                                 trial.scenario.protocol->effects,
                                                 trial.scenario.seed));
  }
  std::vector<std::string> arguments = {options.program, "gap", "diagnose", bundle, "--json"};
  if (options.strip) {
    for (const station::TrialEffect& effect : trial.effects) {
      if (sim::find_effect(effect.name)) {
        arguments.insert(arguments.end(), {"--without", effect.name});
      }
    }
  }
  const std::string answer = bundle + ".answer.json";
  constexpr double kLimit_s = 120;
  const auto start = env.clock.elapsed();
  const Result<int> exit_code = run_process(arguments, answer, kLimit_s, env.clock);
  outcome.seconds = std::chrono::duration<double>(env.clock.elapsed() - start).count();
  if (!exit_code) {
    outcome.failure = exit_code.error().what;
    return outcome;
  }
  constexpr int kFirstError = 64;
  if (*exit_code >= kFirstError) {
    outcome.failure = fmt::format("exit code {}", *exit_code);
  }
  SIXPOINT_ASSIGN(const Bytes text, read_file(env.files, answer));
  if (outcome.failure.empty()) {
    read_answer(Json::parse(text.begin(), text.end(), nullptr, false), outcome);
    // What the recording has of its own is not what was added.
    std::erase_if(outcome.named,
                  [&](const auto& named) { return options.own_effects.contains(named.first); });
    outcome.unknown = outcome.unknown && !options.own_unknown;
  }
  if (options.keep.empty()) {
    std::error_code ignored;
    std::filesystem::remove_all(bundle, ignored);
    std::filesystem::remove(answer, ignored);
  }
  return outcome;
}

// Diagnoses the recording to which effects will be added, as it is.
Status learn_own(Env& env, Options& options, const std::string& folder) {
  const std::string answer = folder + "/own.answer.json";
  constexpr double kLimit_s = 120;
  SIXPOINT_ASSIGN(const int exit_code,
                  run_process({options.program, "gap", "diagnose", options.recording, "--json"},
                              answer, kLimit_s, env.clock));
  constexpr int kFirstError = 64;
  Outcome own;
  if (exit_code < kFirstError) {
    SIXPOINT_ASSIGN(const Bytes text, read_file(env.files, answer));
    read_answer(Json::parse(text.begin(), text.end(), nullptr, false), own);
  }
  if (exit_code >= kFirstError || !own.failure.empty()) {
    return fail(ErrorCode::bad_data, "the recording can't be diagnosed", options.recording,
                "sixpoint gap diagnose says why");
  }
  for (const auto& [name, probability] : own.named) {
    options.own_effects.insert(name);
  }
  options.own_unknown = own.unknown;
  return {};
}

// Wilson's interval for a share, 95 %.
std::array<double, 2> interval(double right, double of) {
  constexpr double kZ = 1.96;
  if (of == 0) {
    return {0, 1};
  }
  const double p = right / of;
  const double denominator = 1 + kZ * kZ / of;
  const double centre = (p + kZ * kZ / (2 * of)) / denominator;
  const double half = kZ * std::sqrt(p * (1 - p) / of + kZ * kZ / (4 * of * of)) / denominator;
  return {std::max(0.0, centre - half), std::min(1.0, centre + half)};
}

struct Share {
  double right = 0;
  double of = 0;
  void count(bool is_right) {
    right += is_right ? 1 : 0;
    of += 1;
  }
  Json to_json() const {
    Json json;
    json["right"] = static_cast<std::uint64_t>(right);
    json["of"] = static_cast<std::uint64_t>(of);
    json["share"] = of > 0 ? Json(right / of) : Json(nullptr);
    json["interval"] = interval(right, of);
    return json;
  }
  std::string text() const {
    const auto [low, high] = interval(right, of);
    return of == 0 ? "-"
                   : fmt::format("{:.0f} of {:.0f} = {:.1f} % ({:.1f} to {:.1f} %)", right, of,
                                 100 * right / of, 100 * low, 100 * high);
  }
};

struct Scores {
  Share first;             // single: the first one named is right
  Share exact;             // single: it alone was named, and nothing called unknown
  Share first_observable;  // ... where the diagnosis does not say that this protocol can't show it
  Share first_large;       // ... and the severity is at least 1
  Share family;            // single: the family is right, where observable
  Share alarms;            // none: something was named or called unknown
  Share withheld_honest;   // outside or stripped: unknown, or the right family
  Share withheld_wrong;    // outside or stripped: confidently something else
  double pair_hits = 0, pair_named = 0, pair_truth = 0;
  Share failures;
  struct Bin {
    double sum_p = 0, right = 0, of = 0;
  };
  std::array<Bin, 10> bins;
  struct PerEffect {
    Share first, family;
    double blind = 0, missed = 0;
  };
  std::map<std::string, PerEffect> by_effect;
  double seconds_sum = 0, seconds_max = 0;

  double f1() const {
    return pair_named + pair_truth == 0 ? 0 : 2 * pair_hits / (pair_named + pair_truth);
  }
  double calibration_error() const {
    double error = 0;
    double all = 0;
    for (const Bin& bin : bins) {
      error += std::abs(bin.sum_p - bin.right);
      all += bin.of;
    }
    return all == 0 ? 0 : error / all;
  }
};

Scores score(const std::vector<Outcome>& outcomes, bool strip) {
  Scores scores;
  for (const Outcome& outcome : outcomes) {
    scores.failures.count(!outcome.failure.empty());
    if (!outcome.failure.empty()) {
      continue;
    }
    scores.seconds_sum += outcome.seconds;
    scores.seconds_max = std::max(scores.seconds_max, outcome.seconds);
    const bool withheld =
        outcome.kind == TrialKind::outside || (strip && outcome.kind != TrialKind::none);
    if (withheld) {
      scores.withheld_honest.count(outcome.honest());
      scores.withheld_wrong.count(outcome.confidently_wrong());
      continue;
    }
    for (const auto& [name, probability] : outcome.candidates) {
      const auto bin = static_cast<std::size_t>(std::clamp(probability * 10, 0.0, 9.0));
      scores.bins[bin].sum_p += probability;
      scores.bins[bin].right += outcome.has(name) ? 1 : 0;
      scores.bins[bin].of += 1;
    }
    if (outcome.kind == TrialKind::none) {
      scores.alarms.count(!outcome.named.empty() || outcome.unknown);
    } else if (outcome.kind == TrialKind::single) {
      const std::string& name = outcome.truth.front().name;
      const bool observable = !outcome.not_observable.contains(name);
      scores.first.count(outcome.first_right());
      scores.exact.count(outcome.first_right() && outcome.named.size() == 1 && !outcome.unknown);
      auto& effect = scores.by_effect[name];
      effect.blind += outcome.honestly_blind() ? 1 : 0;
      if (observable) {
        scores.first_observable.count(outcome.first_right());
        scores.family.count(outcome.family_right());
        effect.first.count(outcome.first_right());
        effect.family.count(outcome.family_right());
        effect.missed += outcome.named.empty() && !outcome.unknown ? 1 : 0;
        if (outcome.truth.front().severity >= 1) {
          scores.first_large.count(outcome.first_right());
        }
      }
    } else {
      for (const auto& [name, probability] : outcome.named) {
        scores.pair_hits += outcome.has(name) ? 1 : 0;
        scores.pair_named += 1;
      }
      for (const station::TrialEffect& effect : outcome.truth) {
        scores.pair_truth += outcome.not_observable.contains(effect.name) ? 0 : 1;
      }
    }
  }
  return scores;
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
  result["single_first_right"] = scores.first.to_json();
  result["single_alone_and_right"] = scores.exact.to_json();
  result["single_first_right_observable"] = scores.first_observable.to_json();
  result["single_first_right_observable_severity_1"] = scores.first_large.to_json();
  result["single_family_right"] = scores.family.to_json();
  result["none_alarms"] = scores.alarms.to_json();
  result["pair_f1"] = number(scores.f1());
  result["withheld_honest"] = scores.withheld_honest.to_json();
  result["withheld_confidently_wrong"] = scores.withheld_wrong.to_json();
  result["expected_calibration_error"] = number(scores.calibration_error());
  result["failures"] = scores.failures.to_json();
  json["calibration"] = Json::array();
  for (const Scores::Bin& bin : scores.bins) {
    json["calibration"].push_back({{"probability", bin.of > 0 ? Json(bin.sum_p / bin.of) : Json()},
                                   {"right", bin.of > 0 ? Json(bin.right / bin.of) : Json()},
                                   {"candidates", static_cast<std::uint64_t>(bin.of)}});
  }
  json["by_effect"] = Json::array();
  for (const auto& [name, effect] : scores.by_effect) {
    json["by_effect"].push_back({{"name", name},
                                 {"first_right", effect.first.to_json()},
                                 {"family_right", effect.family.to_json()},
                                 {"missed", static_cast<std::uint64_t>(effect.missed)},
                                 {"not_observable", static_cast<std::uint64_t>(effect.blind)}});
  }
  json["outcomes"] = Json::array();
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    const Outcome& outcome = outcomes[i];
    Json entry;
    entry["trial"] = i;
    entry["kind"] = station::to_string(outcome.kind);
    entry["truth"] = Json::array();
    for (const station::TrialEffect& effect : outcome.truth) {
      entry["truth"].push_back({{"name", effect.name}, {"severity", effect.severity}});
    }
    entry["verdict"] = outcome.verdict;
    entry["named"] = Json::array();
    for (const auto& [name, probability] : outcome.named) {
      entry["named"].push_back({{"name", name}, {"probability", number(probability)}});
    }
    entry["unknown"] = outcome.unknown;
    entry["honest"] = outcome.honest();
    entry["confidently_wrong"] = outcome.confidently_wrong();
    entry["seconds"] = outcome.seconds;
    if (!outcome.failure.empty()) {
      entry["failure"] = outcome.failure;
    }
    json["outcomes"].push_back(std::move(entry));
  }
  const double answered = scores.failures.of - scores.failures.right;
  json["seconds"]["mean"] = number(answered > 0 ? scores.seconds_sum / answered : 0);
  json["seconds"]["max"] = scores.seconds_max;
  return json;
}

// What people read: the same lines on the terminal and in the page.
std::vector<std::pair<std::string, std::string>> lines(const Scores& scores) {
  return {{"one effect: first-named right", scores.first.text()},
          {"  ... and nothing else named", scores.exact.text()},
          {"  ... where this protocol can show it", scores.first_observable.text()},
          {"  ... and at least of typical size", scores.first_large.text()},
          {"  ... right family", scores.family.text()},
          {"two effects: F1 of the set", fmt::format("{:.3f}", scores.f1())},
          {"nothing missing: alarms", scores.alarms.text()},
          {"withheld: unknown, or right family", scores.withheld_honest.text()},
          {"withheld: confidently wrong", scores.withheld_wrong.text()},
          {"expected calibration error", fmt::format("{:.3f}", scores.calibration_error())},
          {"failures of the program", scores.failures.text()}};
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
        name, effect.first.text(), effect.family.text(), effect.missed, effect.blind);
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
  const auto escaped = [](std::string_view text) {
    std::string safe;
    for (const char c : printable(text, 200)) {
      safe += c == '<' ? "&lt;" : c == '&' ? "&amp;" : std::string(1, c);
    }
    return safe;
  };
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    const Outcome& outcome = outcomes[i];
    std::vector<std::string> truth;
    for (const station::TrialEffect& effect : outcome.truth) {
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

Status challenge(Context& context, Options options) {
  const auto protocol = sim::parse_standard_protocol(options.protocol);
  if (!protocol) {
    return fail(ErrorCode::usage, "there is no such protocol", options.protocol,
                "production or engineering");
  }
  if (!options.recording.empty()) {
    options.shares.outside = 0;
    options.shares.pair = 0;
    const auto& can = is_plain(options.recording) ? station::effects_for_plain_recordings()
                                                  : station::effects_for_recordings();
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
    const auto& outside = station::outside_kinds();
    const bool is_outside =
        std::any_of(outside.begin(), outside.end(),
                    [&](const station::OutsideKind& kind) { return kind.effect.name == name; });
    if (const auto found = sim::find_effect(name); !found && !is_outside) {
      return tl::unexpected(found.error());
    }
  }
  std::error_code error;
  if (options.program.empty()) {
    options.program = std::filesystem::read_symlink("/proc/self/exe", error).string();
  }
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
    SIXPOINT_CHECK(context.env.files.make_folders(folder));
  }
  if (!options.recording.empty()) {
    SIXPOINT_CHECK(learn_own(context.env, options, folder));
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
        [&](std::size_t i) { results[i] = run_trial(context.env, options, *protocol, folder, i); },
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
  const Scores scores = score(outcomes, options.strip);
  if (!options.html.empty()) {
    SIXPOINT_CHECK(write_file(context.env.files, options.html, page(options, scores, outcomes)));
  }
  if (options.json) {
    print_json(context, to_json(options, scores, outcomes));
  } else {
    for (const auto& [what, value] : lines(scores)) {
      context.out << fmt::format("{:<42} {}\n", what, value);
    }
  }
  if (scores.failures.right > 0) {
    context.worsen(kExitFailed);
  }
  return {};
}

}  // namespace

void add_gap_challenge(CLI::App& gap_command, Context& context) {
  auto options = std::make_shared<Options>();
  CLI::App* command = gap_command.add_subcommand(
      "challenge", "draws effects, hides them from the diagnosis, and scores its answers");
  command->add_option("--trials", options->trials, "how many bundles")
      ->check(CLI::Range(std::size_t{1}, std::size_t{1'000'000}));
  command->add_option("--seed", options->seed, "the same seed draws the same trials");
  command->add_option("--protocol", options->protocol, "production or engineering (default)");
  command->add_option("--effects", options->only, "draw only these")->delimiter(',');
  command->add_flag("--strip", options->strip, "take the true effects out of the catalogue");
  command->add_option(
      "--recording", options->recording,
      "add effects to this bundle of a real unit at rest, or a filter mismatch to this .gt3x "
      "file, instead of simulating one");
  command->add_option("--none", options->shares.none, "share of trials without any effect")
      ->check(CLI::Range(0.0, 1.0));
  command->add_option("--pairs", options->shares.pair, "share of trials with two effects")
      ->check(CLI::Range(0.0, 1.0));
  command
      ->add_option("--outside", options->shares.outside,
                   "share of trials with an effect that is not in the catalogue")
      ->check(CLI::Range(0.0, 1.0));
  command->add_option("--jobs", options->jobs, "diagnoses at a time (0 = one per core)");
  command->add_option("--program", options->program, "the sixpoint to test (default: this one)");
  command->add_option("--keep", options->keep, "leave bundles and answers in this folder");
  command->add_option("--html", options->html, "also write the scores as a page");
  command->add_flag("--json", options->json, "answer as JSON");
  command->callback([options, &context] {
    if (const Status done = challenge(context, *options); !done) {
      report_error(context, "gap-challenge", done.error(), options->json);
    }
  });
}

}  // namespace sixpoint::cli
