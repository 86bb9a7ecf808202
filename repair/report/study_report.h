// One page about a study that was repaired: what was affected, with what it was repaired, what is
// missing, and what it changes. One file of HTML and SVG, nothing to load, no script, printable.
//
//   StudyReport study;
//   for (const RepairReport& report : reports) {
//     study.add(report);
//   }
//   study.add_thumbnails(files);   // reads the worst files, before and after
//   const std::string page = study.html({"Repair of /data/archive", "2026-11-23", "sixpoint 1.0.0"});
//
// Sections: totals; a line per unit (repair/units/unit_needs.h); what could not be done, with its
// reasons; files, the worst first by their still error before the repair; ENMO before and after of
// the first of these; the constants that were used. Long lists are cut, and the page says how many
// lines are left out: manifest.csv in the output folder has all of them. Memory: the reports.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "base/env.h"
#include "repair/rescale/repair_file.h"
#include "repair/units/unit_needs.h"

namespace sixpoint::repair {

struct StudyPage {
  std::string title;
  std::string made_at;  // as people read it
  std::string software;
};

struct StudyLimits {
  std::size_t units = 500;
  std::size_t not_done = 500;
  std::size_t files = 200;
  // Each reads two recordings, some seconds for a week of them.
  std::size_t thumbnails = 12;
};

class StudyReport {
 public:
  explicit StudyReport(const StudyLimits& limits = {}) : limits_(limits) {}
  void add(const RepairReport& report);
  // ENMO of the worst files that were repaired, as they were and as they are. Files that cannot be
  // read are left out.
  void add_thumbnails(FileSystem& files);
  std::string html(const StudyPage& page) const;

 private:
  struct Curves {
    std::vector<double> before_mg;  // by column of the time; NaN where nothing was recorded
    std::vector<double> after_mg;
    double hours = 0;
  };
  std::vector<const RepairReport*> worst_first() const;
  std::string totals() const;
  std::string units() const;
  std::string not_done() const;
  std::string files() const;
  std::string thumbnails() const;
  std::string constants() const;

  StudyLimits limits_;
  std::vector<RepairReport> reports_;
  UnitTable table_;
  std::map<std::string, Curves> curves_;  // by input
};

}  // namespace sixpoint::repair
