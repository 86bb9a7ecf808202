// The answer of `archive` with its list of files: for people a few lines for each file as it comes;
// as JSON one document, which is kept as text and written at the end. So a command that is stopped
// or fails on its way leaves no half of it. That text takes some 700 bytes a file, less than the
// reports that `archive merge` keeps for the manifest.
//
//   FileStream files(context, options_json);
//   files.add(report);
//   files.end({{"summary", Json::object()}});
#pragma once

#include <string>

#include "cli/context.h"
#include "cli/files/repair_answer.h"
#include "repair/rescale/repair_file.h"

namespace sixpoint::cli {

class FileStream {
 public:
  FileStream(Context& context, bool json) : context_(context), json_(json) {
    if (json_) {
      text_ = "{\n\"schema\": \"sixpoint/archive/1\",\n\"files\": [";
    }
  }
  void add(const Json& file) {
    if (json_) {
      text_.append(first_ ? "\n" : ",\n").append(text_of(file));
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
    text_.append("\n]");
    for (const auto& [key, value] : rest.items()) {
      text_.append(",\n\"").append(key).append("\": ").append(text_of(value));
    }
    text_.append("\n}\n");
    write_document(context_, text_);
  }

 private:
  static std::string text_of(const Json& json) {
    return json.dump(-1, ' ', false, Json::error_handler_t::replace);
  }
  Context& context_;
  bool json_;
  bool first_ = true;
  std::string text_;  // of the document so far
};

}  // namespace sixpoint::cli
