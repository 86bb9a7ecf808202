// What is wrong with a command line, in words, and what the user may have meant.
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
class ParseError;
}  // namespace CLI

namespace sixpoint::cli {

// About the first word of `arguments` that names no command and no option; nothing where all do. It
// only reads; whether the arguments are in order is the parser's to say.
std::optional<std::string> unknown_word(const CLI::App& app,
                                        const std::vector<std::string>& arguments);

// Why the parser refused a command line:
//
// | the parser's words                            | in plain words                                    |
// |-----------------------------------------------|---------------------------------------------------|
// | --output: 1 required TEXT missing             | --output has no value                             |
// | --output: At Most 1 required but received 2   | --output is given 2 times, and is taken once      |
// | RECORDING: At least 2 required but received 1 | RECORDING: at least 2 are needed, 1 is given      |
// | --jobs: Value abc not in range 0 to 256       | --jobs: 'abc' is no number from 0 to 256          |
// | Could not convert: --seed = x                 | --seed cannot be 'x'                              |
// | --shards excludes --files                     | --shards and --files do not go together           |
// | The following argument was not expected: c    | more arguments than it takes: c                   |
// | A subcommand is required                      | a command is missing                              |
// | anything else                                 | the same                                          |
std::string plain_words(const CLI::ParseError& refused);

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
