#include "repair/units/unit_pool.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/text/json_text.h"
#include "calib/direction_cells.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/gate.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kMethod = "unit_files";

template <class To, class From>
PerAxis<To> converted(const PerAxis<From>& from) {
  return {static_cast<To>(from[0]), static_cast<To>(from[1]), static_cast<To>(from[2])};
}

std::optional<UnitRow> row_of(const std::string& text) {
  for (const UnitRow row : {UnitRow::alone, UnitRow::sibling, UnitRow::pooled,
                            UnitRow::contradiction, UnitRow::missing}) {
    if (to_string(row) == text) {
      return row;
    }
  }
  return std::nullopt;
}

// nlohmann's exceptions for a missing or wrong member go to the caller.
Result<UnitAnswer> answer_of(const Json& json) {
  const auto row = row_of(json.at("row"));
  if (!row) {
    return fail(ErrorCode::bad_data, "a row that this program does not know");
  }
  UnitAnswer answer;
  answer.row = *row;
  answer.why = json.at("why");
  answer.files = json.at("files");
  answer.own_suffices = json.at("own_suffices");
  answer.missing_sides = json.at("missing_sides").get<std::vector<std::string>>();
  if (const Json& constants = json.at("constants"); !constants.is_null()) {
    SIXPOINT_ASSIGN(answer.record, calib::constants_record_from_json(constants));
  }
  return answer;
}

}  // namespace

const UnitAnswer* UnitAnswers::find(const std::string& serial) const {
  const auto found = answers_.find(serial);
  return found == answers_.end() ? nullptr : &found->second;
}

void UnitAnswers::set(const std::string& serial, UnitAnswer answer) {
  answers_.insert_or_assign(serial, std::move(answer));
}

void UnitAnswers::give(const std::string& serial, ConstantsChoice& choice) const {
  const UnitAnswer* answer = find(serial);
  if (answer == nullptr || answer->row == UnitRow::alone) {
    return;
  }
  choice.reasons.push_back(answer->why);
  choice.for_a_person = choice.for_a_person || answer->row == UnitRow::contradiction;
  if (answer->record) {
    choice.chosen = ChosenConstants{*answer->record, std::string(kMethod), ""};
  }
}

std::string UnitAnswers::to_json_lines() const {
  std::string text;
  for (const auto& [serial, answer] : answers_) {
    text += Json{{"serial", serial},
                 {"row", to_string(answer.row)},
                 {"why", answer.why},
                 {"files", answer.files},
                 {"own_suffices", answer.own_suffices},
                 {"missing_sides", answer.missing_sides},
                 {"constants", answer.record ? calib::to_json(*answer.record) : Json(nullptr)}}
                .dump(-1, ' ', false, Json::error_handler_t::replace);
    text += '\n';
  }
  return text;
}

Result<UnitAnswers> UnitAnswers::parse(std::string_view text) {
  UnitAnswers answers;
  for (const std::string_view line : lines_of(text)) {
    const Json json = parse_json(line);
    try {
      if (auto answer = answer_of(json)) {
        answers.set(json.at("serial").get<std::string>(), *std::move(answer));
        continue;
      }
    } catch (const Json::exception&) {
      // Said below: what is missing makes no difference to the reader.
    }
    return fail(ErrorCode::bad_data, "a line of the units' constants is damaged", {},
                "make the plan anew");
  }
  return answers;
}

std::vector<UnitPool::Kept> UnitPool::kept_of(const Survey& survey,
                                              const calib::Calibration& constants) {
  std::vector<int> cell_of_block;
  auto cells = calib::cells_of(survey.blocks, {}, &cell_of_block);
  // Cells are 5.6 degrees across; their neighbourhoods are the directions.
  calib::number_neighbourhoods(cells, constants);
  std::map<int, std::vector<std::size_t>> by_direction;
  for (std::size_t i = 0; i < survey.blocks.size(); ++i) {
    if (const int cell = cell_of_block[i]; cell >= 0) {
      by_direction[cells[static_cast<std::size_t>(cell)].neighbourhood].push_back(i);
    }
  }
  std::vector<std::size_t> taken;
  for (const auto& [direction, blocks] : by_direction) {
    const std::size_t count = std::min(blocks.size(), kBlocksPerDirection);
    for (std::size_t k = 0; k < count; ++k) {
      taken.push_back(blocks[k * blocks.size() / count]);
    }
  }
  std::ranges::sort(taken);
  std::vector<Kept> kept;
  kept.reserve(taken.size());
  for (const std::size_t i : taken) {
    const calib::StillBlock& block = survey.blocks[i];
    kept.push_back({block.start_time_s, converted<float>(block.mean_lsb),
                    converted<float>(block.sd_lsb), converted<float>(block.ramp_variance_lsb2),
                    block.samples, static_cast<float>(block.duration_s), block.noisy});
  }
  return kept;
}

UnitFile UnitPool::expanded(const std::string& serial, const File& file) {
  UnitFile out{file.path,      serial, file.file_constants, {}, file.own, file.is_calibration_file,
               file.only_helps};
  for (const Kept& kept : file.blocks) {
    calib::StillBlock block;
    block.start_time_s = kept.start_time_s;
    block.samples = kept.samples;
    block.duration_s = kept.duration_s;
    block.mean_lsb = converted<double>(kept.mean_lsb);
    block.mean_g = file.file_constants.to_g(block.mean_lsb);
    block.sd_lsb = converted<double>(kept.sd_lsb);
    block.ramp_variance_lsb2 = converted<double>(kept.ramp_variance_lsb2);
    block.noisy = kept.noisy;
    out.blocks.push_back(block);
  }
  return out;
}

void UnitPool::add(const std::string& path, const Survey& survey,
                   const calib::ConstantsRecord* record) {
  keep(path, survey, record, /*only_helps=*/false);
}

void UnitPool::add_helper(const std::string& path, const Survey& survey) {
  keep(path, survey, nullptr, /*only_helps=*/true);
}

std::set<std::string> UnitPool::units_that_lack() const {
  const std::lock_guard lock(mutex_);
  std::set<std::string> units;
  for (const auto& [path, serial] : waiting_) {
    units.insert(serial);
  }
  std::erase_if(units, [&](const std::string& serial) {
    const auto files = units_.find(serial);
    return files == units_.end() ||
           std::ranges::any_of(files->second, [](const File& file) { return !!file.own; });
  });
  return units;
}

void UnitPool::keep(const std::string& path, const Survey& survey,
                    const calib::ConstantsRecord* record, bool only_helps) {
  if (survey.constants.empty() || !why_not_lent(survey).empty()) {
    return;
  }
  const auto constants = calib::calibration_from(survey.constants.front());
  if (!constants) {
    return;
  }
  File file{path,
            *constants,
            kept_of(survey, *constants),
            std::nullopt,
            recording_kind(survey) == "calibration_file",
            only_helps};
  if (record != nullptr) {
    file.own = *record;
  }
  const std::lock_guard lock(mutex_);
  if (!closed_) {
    units_[survey.facts.serial].push_back(std::move(file));
  }
}

void UnitPool::ask(const std::string& path, const Survey& survey, ConstantsChoice& choice) {
  const std::lock_guard lock(mutex_);
  if (closed_) {
    answers_.give(survey.facts.serial, choice);
  } else {
    waiting_.emplace(path, survey.facts.serial);
  }
}

void UnitPool::close(UtcTime now) {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  for (auto& [serial, files] : units_) {
    std::vector<UnitFile> unit;
    for (const File& file : files) {
      unit.push_back(expanded(serial, file));
    }
    files.clear();
    answers_.set(serial, unit_answer(std::move(unit), now));
  }
  units_.clear();
}

std::vector<std::string> UnitPool::waiting() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> paths;
  for (const auto& [path, serial] : waiting_) {
    paths.push_back(path);
  }
  return paths;
}

const UnitAnswer* UnitPool::answer_of_waiting(const std::string& path) const {
  const std::lock_guard lock(mutex_);
  const auto found = waiting_.find(path);
  return found == waiting_.end() ? nullptr : answers_.find(found->second);
}

bool UnitPool::has_constants(const std::string& path) const {
  const UnitAnswer* answer = answer_of_waiting(path);
  return answer != nullptr && answer->record.has_value();
}

std::string UnitPool::why_none(const std::string& path) const {
  const UnitAnswer* answer = answer_of_waiting(path);
  return answer == nullptr || answer->record ? "" : answer->why;
}

bool UnitPool::contradicts(const std::string& path) const {
  const UnitAnswer* answer = answer_of_waiting(path);
  return answer != nullptr && answer->row == UnitRow::contradiction;
}

std::string collect(FileSystem& files, const std::string& path, ConstantsSource& finder,
                    const calib::StillBlockOptions& still) {
  const auto facts = facts_of(files, path);
  if (!facts || triage(*facts).verdict != Verdict::affected) {
    return facts && may_help(*facts) ? facts->serial : std::string();
  }
  const auto surveyed = survey(files, path, still);
  // What follows is what repair_file() asks before it looks for constants.
  if (surveyed && !surveyed->already_repaired && !surveyed->constants_problem &&
      triage(surveyed->facts).verdict == Verdict::affected) {
    static_cast<void>(finder.choose(path, *surveyed));
  }
  return {};
}

void collect_helper(FileSystem& files, const std::string& path, UnitPool& pool,
                    const calib::StillBlockOptions& still) {
  const auto surveyed = survey(files, path, still);
  if (surveyed && !surveyed->already_repaired && !surveyed->constants_problem &&
      may_help(surveyed->facts)) {
    pool.add_helper(path, *surveyed);
  }
}

}  // namespace sixpoint::repair
