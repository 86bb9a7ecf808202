// Where the tests of a store put it: the same tests run on SQLite and on PostgreSQL. Each test
// program links one make_place().
#pragma once

#include <memory>
#include <string>

#include "temporary_folder.h"

namespace sixpoint::db::tests {

class Place {
 public:
  virtual ~Place() = default;
  // An empty place for a store named `name`; the same name is the same place.
  virtual std::string location(const std::string& name) = 0;
  virtual void erase(const std::string& name) = 0;
  // Another program's hand in the store: statements with every trigger and key switched off. Throws
  // where they do not run.
  virtual void tamper(const std::string& name, const std::string& sql) = 0;
  // Statements as any program would send them. False where the store refuses.
  virtual bool statements(const std::string& name, const std::string& sql) = 0;
  virtual std::string empty_bytes() const = 0;  // a literal
};

std::unique_ptr<Place> make_place();

}  // namespace sixpoint::db::tests
