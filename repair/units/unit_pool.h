// The still periods of the files of a run, by unit, and what they give together. Two passes: the
// first asks every file by itself and collects; after close() the files that wait are asked again.
// Between them collect_helper() reads files that are not affected, of units that lack constants.
//
//   UnitPool pool;
//   ConstantsFinderOptions options;
//   options.unit = &pool;
//   ConstantsFinder finder(env, options);
//   // repair_file(env, input, output, finder, how) for every file, on any thread
//   pool.close(env.clock.now());
//   for (const std::string& path : pool.waiting()) {
//     if (pool.has_constants(path)) { /* repair_file() again */ }
//   }
//
// Of each file up to kBlocksPerDirection blocks in each direction are kept, evenly taken, 56 bytes
// each; of a file that may not lend its constants (repair/rescale/gate.h) none. Some 15 KB per
// file, so that 10,000 affected files take 150 MB. Solving takes a second or so per unit. add() and
// ask() may be called from several threads, close() by one and once.
#pragma once

#include <map>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "repair/rescale/unit_constants.h"
#include "repair/units/unit_answer.h"

namespace sixpoint::repair {

inline constexpr std::size_t kBlocksPerDirection = 10;

// Answers by serial number: what close() found, on disk too (an archive's plan).
class UnitAnswers {
 public:
  const UnitAnswer* find(const std::string& serial) const;  // null where there is none
  void set(const std::string& serial, UnitAnswer answer);
  const std::map<std::string, UnitAnswer>& all() const { return answers_; }
  // Adds the record or the reason to `choice`; nothing for a unit of one file.
  void give(const std::string& serial, ConstantsChoice& choice) const;

  std::string to_json_lines() const;
  // What to_json_lines() wrote; bad_data otherwise.
  static Result<UnitAnswers> parse(std::string_view text);

 private:
  std::map<std::string, UnitAnswer> answers_;
};

// Answers that are known already: for the shards of a plan.
class KnownUnits final : public UnitConstants {
 public:
  explicit KnownUnits(UnitAnswers answers) : answers_(std::move(answers)) {}
  void add(const std::string& /*path*/, const Survey& /*survey*/,
           const calib::ConstantsRecord* /*record*/) override {}
  void ask(const std::string& /*path*/, const Survey& survey, ConstantsChoice& choice) override {
    answers_.give(survey.facts.serial, choice);
  }

 private:
  UnitAnswers answers_;
};

class UnitPool final : public UnitConstants {
 public:
  void add(const std::string& path, const Survey& survey,
           const calib::ConstantsRecord* record) override;
  // A file that needs no constants itself, but may_help() (unit_answer.h). Before close().
  void add_helper(const std::string& path, const Survey& survey);
  // Serial numbers of units whose files wait and have no constants of their own. Before close().
  std::set<std::string> units_that_lack() const;
  // Before close(): nothing is chosen, and the file waits.
  void ask(const std::string& path, const Survey& survey, ConstantsChoice& choice) override;

  void close(UtcTime now);
  const UnitAnswers& answers() const { return answers_; }
  // Files that asked before close(), sorted.
  std::vector<std::string> waiting() const;
  bool has_constants(const std::string& path) const;
  // Why a file that waited has no constants of its unit; empty for a unit of one file.
  std::string why_none(const std::string& path) const;
  // The files of its unit contradict each other.
  bool contradicts(const std::string& path) const;

 private:
  const UnitAnswer* answer_of_waiting(const std::string& path) const;
  // A still block without what pooling has no use for.
  struct Kept {
    double start_time_s = 0;
    PerAxis<float> mean_lsb{};
    PerAxis<float> sd_lsb{};
    PerAxis<float> ramp_variance_lsb2{};
    int samples = 0;
    float duration_s = 0;
    bool noisy = false;
  };
  struct File {
    std::string path;
    calib::Calibration file_constants;
    std::vector<Kept> blocks;
    std::optional<calib::ConstantsRecord> own;
    bool is_calibration_file = false;
    bool only_helps = false;
  };
  void keep(const std::string& path, const Survey& survey, const calib::ConstantsRecord* record,
            bool only_helps);
  static std::vector<Kept> kept_of(const Survey& survey, const calib::Calibration& constants);
  static UnitFile expanded(const std::string& serial, const File& file);

  mutable std::mutex mutex_;
  std::map<std::string, std::vector<File>> units_;  // by serial number; emptied by close()
  std::map<std::string, std::string> waiting_;      // path -> serial number
  bool closed_ = false;
  UnitAnswers answers_;
};

// The first pass over one file for a plan: headers first, and of an affected file its still periods
// and `finder`'s answer, which collects. What cannot be read is left for the repair to report.
// Returns the serial number of a file that is not affected but may_help(), empty for all others.
std::string collect(FileSystem& files, const std::string& path, ConstantsSource& finder,
                    const calib::StillBlockOptions& still = {});

// The second pass: the still periods of a file that may_help() a unit that lacks constants.
void collect_helper(FileSystem& files, const std::string& path, UnitPool& pool,
                    const calib::StillBlockOptions& still = {});

}  // namespace sixpoint::repair
