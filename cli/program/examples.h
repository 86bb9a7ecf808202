// Two examples of every command: what its --help and the manual page end with.
//
//   for (const CommandExamples& of : command_examples()) {
//     std::cout << of.lines[0] << '\n';  // "sixpoint inspect day1.gt3x"
//   }
//
// tests/docs/run_examples.sh runs every line, in the order of the list, in one folder: what one
// line makes, a later one uses. In a line, RUN and CONSTANTS stand for identifiers that 'jig' and
// 'history' print.
#pragma once

#include <array>
#include <span>
#include <string_view>

namespace sixpoint::cli {

struct CommandExamples {
  std::string_view command;               // "store export"
  std::array<std::string_view, 2> lines;  // "sixpoint store export -o store.jsonl"
};
std::span<const CommandExamples> command_examples();

}  // namespace sixpoint::cli
