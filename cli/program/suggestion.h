// What the user may have meant by a command or an option that there is not.
//
//   CLI::App app;
//   declare_commands(app, context);
//   const auto text = unknown_word(app, {"scn", "archive"});
//   // 'sixpoint' has no command 'scn'; did you mean 'scan'? 'sixpoint --help' lists them
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace sixpoint::cli {

// About the first word of `arguments` that names no command and no option; nothing where all do. It
// only reads; whether the arguments are in order is the parser's to say.
std::optional<std::string> unknown_word(const CLI::App& app,
                                        const std::vector<std::string>& arguments);

// Which of `known` a person meant who typed `typed`:
//
// | typed                                                              | answer      |
// |--------------------------------------------------------------------|-------------|
// | the beginning of exactly one of them                               | that one    |
// | one or more steps from the nearest, a third of its letters at most | the nearest |
// | otherwise, or two are as near                                      | nothing     |
//
// A step is a letter too many, too few, another one, or two neighbours the other way round (optimal
// string alignment distance; Damerau 1964).
std::optional<std::string> nearest_word(const std::string& typed,
                                        const std::vector<std::string>& known);

}  // namespace sixpoint::cli
