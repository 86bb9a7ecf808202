#include "repair/rescale/constants_snapshot.h"

#include <nlohmann/json.hpp>

#include "base/text/json_text.h"
#include "calib/constants.h"
#include "repair/rescale/applying_constants.h"

namespace sixpoint::repair {

namespace {

using Json = nlohmann::ordered_json;

}  // namespace

Result<std::optional<ConstantsSnapshot::Entry>> ConstantsSnapshot::of_unit(
    db::Store& store, const std::string& serial) {
  SIXPOINT_ASSIGN(const auto history, store.constants_history(serial));
  const Applying applying = applying_constants(history, calib::FilterConfiguration::current);
  if (applying.conflict) {
    return std::optional(Entry{"", "", applying.why});
  }
  if (!applying.index && !applying.withdrawn.empty()) {
    return std::optional(Entry{"", "", "", applying.withdrawn});
  }
  if (!applying.index) {
    return std::optional<Entry>();
  }
  const db::ConstantsRecord& set = history.constants[*applying.index];
  return std::optional(Entry{set.id, set.document, "", "", applying.doubt});
}

Result<ConstantsSnapshot> ConstantsSnapshot::of_store(db::Store& store) {
  ConstantsSnapshot snapshot;
  SIXPOINT_ASSIGN(const auto units, store.units());
  for (const db::UnitRecord& unit : units) {
    SIXPOINT_ASSIGN(auto entry, of_unit(store, unit.serial));
    if (entry) {
      snapshot.entries_[unit.serial] = *std::move(entry);
    }
  }
  return snapshot;
}

std::string ConstantsSnapshot::to_json_lines() const {
  std::string text;
  for (const auto& [serial, entry] : entries_) {
    text += Json{{"serial", serial},
                 {"id", entry.id},
                 {"document", entry.document},
                 {"conflict", entry.conflict},
                 {"withdrawn", entry.withdrawn},
                 {"doubt", entry.doubt}}
                .dump(-1, ' ', false, Json::error_handler_t::replace);
    text += '\n';
  }
  return text;
}

Result<ConstantsSnapshot> ConstantsSnapshot::parse(std::string_view text) {
  ConstantsSnapshot snapshot;
  for (const std::string_view line : lines_of(text)) {
    const Json json = parse_json(line);
    const auto is_text = [&](const char* key) {
      return json.is_object() && json.contains(key) && json[key].is_string();
    };
    if (!is_text("serial") || !is_text("id") || !is_text("document") || !is_text("conflict")) {
      return fail(ErrorCode::bad_data, "a line of the constants is damaged", {},
                  "make the plan anew");
    }
    snapshot.entries_[json["serial"].get<std::string>()] = {
        json["id"].get<std::string>(), json["document"].get<std::string>(),
        json["conflict"].get<std::string>(),
        is_text("withdrawn") ? json["withdrawn"].get<std::string>() : "",
        is_text("doubt") ? json["doubt"].get<std::string>() : ""};
  }
  return snapshot;
}

const ConstantsSnapshot::Entry* ConstantsSnapshot::find(const std::string& serial) const {
  const auto found = entries_.find(serial);
  return found == entries_.end() ? nullptr : &found->second;
}

}  // namespace sixpoint::repair
