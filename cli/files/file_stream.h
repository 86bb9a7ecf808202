// The answer of `archive` with its list of files, which may be longer than memory: each file is
// written as it comes, as JSON or as lines for people.
//
//   FileStream files(context, options_json);
//   files.add(report);
//   files.end({{"summary", Json::object()}});
#pragma once

#include "cli/context.h"
#include "cli/files/repair_answer.h"
#include "repair/rescale/repair_file.h"

namespace sixpoint::cli {

class FileStream {
 public:
  FileStream(Context& context, bool json) : context_(context), json_(json) {
    if (json_) {
      context_.out << "{\n\"schema\": \"sixpoint/archive/1\",\n\"files\": [";
    }
  }
  void add(const Json& file) {
    if (json_) {
      context_.out << (first_ ? "\n" : ",\n") << text_of(file);
      first_ = false;
    }
  }
  void add(const repair::RepairReport& report) {
    if (json_) {
      add(report.to_json());
    } else {
      print_report(context_, report);
    }
  }
  // The other keys of the document.
  void end(const Json& rest) {
    if (!json_) {
      return;
    }
    context_.out << "\n]";
    for (const auto& [key, value] : rest.items()) {
      context_.out << ",\n\"" << key << "\": " << text_of(value);
    }
    context_.out << "\n}\n";
  }

 private:
  static std::string text_of(const Json& json) {
    return json.dump(-1, ' ', false, Json::error_handler_t::replace);
  }
  Context& context_;
  bool json_;
  bool first_ = true;
};

}  // namespace sixpoint::cli
