#include "repair/rescale/applying_constants.h"

#include <algorithm>
#include <array>
#include <limits>

#include <fmt/format.h>

#include "calib/application/agreement.h"
#include "db/records.h"

namespace sixpoint::repair {
namespace {

// Uncertainties are estimates themselves: two that differ by less are equal.
constexpr double kEqualShare = 1.1;

std::string day_of(UtcTime time) { return to_iso8601(time).substr(0, 10); }

// In the order of ConstantsKind.
constexpr std::array<std::string_view, 3> kKindNames = {"jig", "calibration file", "file scan"};

// A set that can apply.
struct Candidate {
  std::size_t index = 0;
  const db::ConstantsRecord* row = nullptr;
  ConstantsKind kind = ConstantsKind::file_scan;
  std::optional<calib::ConstantsRecord> record;  // nothing where the document cannot be read
  double uncertainty_mg = std::numeric_limits<double>::infinity();

  std::string_view method() const { return kKindNames[static_cast<std::size_t>(kind)]; }
};

Candidate candidate_of(std::size_t index, const db::ConstantsRecord& row) {
  Candidate candidate{index, &row, kind_of(row), std::nullopt};
  if (auto record = calib::parse_constants_record(row.document)) {
    if (const double mg = calib::largest_uncertainty_mg(record->uncertainty); mg > 0) {
      candidate.uncertainty_mg = mg;
    }
    candidate.record = *std::move(record);
  }
  return candidate;
}

// Of one method: the smallest uncertainty, then the latest.
const Candidate& best_of(const std::vector<Candidate>& candidates) {
  const auto& surest = *std::ranges::min_element(candidates, {}, &Candidate::uncertainty_mg);
  const Candidate* best = nullptr;
  for (const Candidate& one : candidates) {
    const bool equal = one.uncertainty_mg <= kEqualShare * surest.uncertainty_mg;
    if (equal && (best == nullptr || one.row->made_at >= best->row->made_at)) {
      best = &one;
    }
  }
  return *best;
}

std::string why_of(const Candidate& best, const std::vector<Candidate>& all,
                   const std::vector<Candidate>& same_method) {
  if (all.size() == 1) {
    return "applies: the only set";
  }
  if (same_method.size() == 1) {
    return fmt::format("applies: {} comes first", best.method());
  }
  const bool newest = std::ranges::none_of(
      same_method, [&](const Candidate& other) { return other.row->made_at > best.row->made_at; });
  return newest ? fmt::format("applies: the latest by {}", best.method())
                : fmt::format("applies: the smallest uncertainty by {} ({:.1f} mg)", best.method(),
                              best.uncertainty_mg);
}

// By how much two sets disagree; nothing where they agree or cannot be compared.
std::optional<calib::Agreement> disagreement(const Candidate& one, const Candidate& other) {
  if (!one.record || !other.record) {
    return std::nullopt;
  }
  const auto between = calib::agreement(one.record->calibration, one.record->uncertainty,
                                        other.record->calibration, other.record->uncertainty);
  return between.agree() ? std::nullopt : std::optional(between);
}

// The first newer set of a method behind that disagrees; what is wrong, in one sentence.
std::optional<std::string> conflict_with(const Candidate& best, const std::vector<Candidate>& all) {
  for (const Candidate& other : all) {
    if (other.kind <= best.kind || other.row->made_at <= best.row->made_at) {
      continue;
    }
    if (const auto between = disagreement(best, other)) {
      return fmt::format(
          "the set {} by {} is older than the set {} by {} and disagrees with it ({}): decide with "
          "'sixpoint store prefer ID --why TEXT'",
          best.row->id, best.method(), other.row->id, other.method(), between->brief());
    }
  }
  return std::nullopt;
}

// The first other set of the same method that disagrees.
std::string doubt_about(const Candidate& best, const std::vector<Candidate>& same_method) {
  for (const Candidate& other : same_method) {
    if (const auto between = disagreement(best, other)) {
      return fmt::format(
          "the store's set {} of {} disagrees with this one, {} ({}): one of them may be of "
          "another unit, or the sensor has changed; 'sixpoint store prefer ID --why TEXT' or "
          "'store withdraw' decides",
          db::shown_id(other.row->id), day_of(other.row->made_at), db::shown_id(best.row->id),
          between->brief());
    }
  }
  return {};
}

// "5c0f91aa on 2026-11-22 (wrong jig)", the latest ones first; empty where there are none.
std::string withdrawn_sets(const db::UnitHistory& history, const std::string& filter) {
  constexpr std::size_t kMostSets = 3;
  std::vector<std::string> sets;
  for (const db::ConstantsRecord& row : history.constants) {
    if (row.filter != filter || !history.is_withdrawn(row.id)) {
      continue;
    }
    const auto last = std::ranges::find_if(
        history.corrections.rbegin(), history.corrections.rend(), [&](const db::Correction& one) {
          return one.row_id == row.id && one.action == "withdraw";
        });
    sets.insert(sets.begin(), fmt::format("{} on {} ({})", db::shown_id(row.id),
                                          day_of(last->made_at), printable(last->reason, 200)));
  }
  const std::size_t more = sets.size() - std::min(sets.size(), kMostSets);
  sets.resize(sets.size() - more);
  return fmt::format("{}{}", fmt::join(sets, ", "),
                     more > 0 ? fmt::format(" and {} more", more) : std::string());
}

}  // namespace

ConstantsKind kind_of(const db::ConstantsRecord& record) {
  std::string kind;
  if (const auto parsed = calib::parse_constants_record(record.document)) {
    kind = parsed->made_from.kind;
  }
  if (kind == "jig" ||
      (kind.empty() && (record.method == "jig" || record.method.starts_with("six_pose")))) {
    return ConstantsKind::jig;
  }
  return kind == "calibration_file" ? ConstantsKind::calibration_file : ConstantsKind::file_scan;
}

Applying applying_constants(const db::UnitHistory& history, calib::FilterConfiguration filter) {
  const std::string wanted(calib::to_string(filter));
  Applying answer;
  std::vector<Candidate> all;
  for (std::size_t i = 0; i < history.constants.size(); ++i) {
    const db::ConstantsRecord& row = history.constants[i];
    const bool withdrawn = history.is_withdrawn(row.id);
    answer.about.push_back(withdrawn              ? "does not apply: withdrawn"
                           : row.filter != wanted ? "does not apply: another filter configuration"
                                                  : "does not apply: another set comes first");
    if (!withdrawn && row.filter == wanted) {
      all.push_back(candidate_of(i, row));
    }
  }
  if (all.empty()) {
    answer.why = "the store holds no constants of this unit that apply";
    answer.withdrawn = withdrawn_sets(history, wanted);
    return answer;
  }
  const db::Correction* preference = history.preference(wanted);
  if (preference != nullptr) {
    const auto preferred = std::ranges::find_if(
        all, [&](const Candidate& one) { return one.row->id == preference->row_id; });
    answer.index = preferred->index;
    answer.why = fmt::format("applies: preferred ({})", printable(preference->reason, 200));
  } else {
    const ConstantsKind first = std::ranges::min_element(all, {}, &Candidate::kind)->kind;
    std::vector<Candidate> same_method;
    std::ranges::copy_if(all, std::back_inserter(same_method),
                         [&](const Candidate& one) { return one.kind == first; });
    const Candidate& best = best_of(same_method);
    if (auto conflict = conflict_with(best, all)) {
      answer.conflict = true;
      answer.why = *std::move(conflict);
      answer.about[best.index] = "does not apply: a person must decide: " + answer.why;
      return answer;
    }
    answer.index = best.index;
    answer.why = why_of(best, all, same_method);
    answer.doubt = doubt_about(best, same_method);
  }
  answer.about[*answer.index] =
      answer.doubt.empty() ? answer.why : answer.why + "; " + answer.doubt;
  return answer;
}

std::string said_of_stored(const db::UnitHistory& history, calib::FilterConfiguration filter,
                           const std::string& id, UtcTime now) {
  const Applying applying = applying_constants(history, filter);
  if (!applying.index) {
    return applying.why;
  }
  const db::ConstantsRecord& set = history.constants[*applying.index];
  if (set.id == id) {
    return applying.doubt;
  }
  return fmt::format(
      "the set {} was stored, but {} of {} {}{}; where that one is wrong: 'sixpoint store withdraw "
      "{} --why TEXT'",
      db::shown_id(id), db::shown_id(set.id), day_of(set.made_at), applying.why,
      set.made_at > now ? ", its date is in the future, so a clock was ahead or this one is behind"
                        : "",
      db::shown_id(set.id));
}

}  // namespace sixpoint::repair
