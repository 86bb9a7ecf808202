// The constants of all units as a store held them at one moment. The shards of an archive use it
// instead of the store: a hundred tasks must not share one database file on a network disk, and all
// of them must use the same constants.
//
//   SIXPOINT_ASSIGN(const auto snapshot, ConstantsSnapshot::of_store(store));
//   snapshot.find("MOS2A1");   // null where the store has none of this unit
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "db/store.h"

namespace sixpoint::repair {

class ConstantsSnapshot {
 public:
  struct Entry {
    std::string id;        // in the store
    std::string document;  // JSON in the form of constants.json
    std::string conflict;  // instead of both: why a person must decide (applying_constants.h)
    // Instead of all three: none apply, because these were withdrawn (applying_constants.h).
    std::string withdrawn = {};
    std::string doubt = {};  // beside the first two: applying_constants.h
  };

  // The constants under `current` that apply or were withdrawn, of every unit of the store.
  static Result<ConstantsSnapshot> of_store(db::Store& store);
  // Of one unit; nothing where there are none.
  static Result<std::optional<Entry>> of_unit(db::Store& store, const std::string& serial);
  // What to_json_lines() wrote; bad_data otherwise.
  static Result<ConstantsSnapshot> parse(std::string_view text);
  std::string to_json_lines() const;

  const Entry* find(const std::string& serial) const;  // null where there is none
  std::size_t size() const { return entries_.size(); }

 private:
  std::map<std::string, Entry> entries_;
};

}  // namespace sixpoint::repair
