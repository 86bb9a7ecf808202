// A part of the program that is loaded when it is first used: a room that needs large libraries for
// work which few commands do. Between a part and its callers stands a table of functions, which the
// room that calls declares:
//
//   struct SheetDrawing {
//     Result<std::string> (*png)(const std::string& svg);
//   };
//
// The part defines it under its own name, and the caller asks for it:
//
//     extern "C" const SheetDrawing sixpoint_part_drawing = {&png_of};
//
//     extern "C" [[gnu::weak]] const SheetDrawing sixpoint_part_drawing;
//     SIXPOINT_ASSIGN(const SheetDrawing* drawing, part("drawing", &sixpoint_part_drawing));
//
// sixpoint_part() in cmake/SixpointRoom.cmake makes the library libsixpoint-NAME-VERSION.so of a
// room. The version is in its name, because the two sides must be built together: a program that
// runs on while another version is installed finds none. Where the room itself is linked in, as in
// the modules of other languages, its own table is used and nothing is loaded.
//
// A part stays loaded until the program ends. Any number of threads may ask at once.
// What it is for: docs/performance.md, the program's start.
#pragma once

#include <string>

#include "base/result.h"

namespace sixpoint {

// The table `sixpoint_part_NAME` of the part's library, which is looked for in the folders of the
// program's RUNPATH. cannot_create where it is not there or does not load; the message is the
// loader's.
Result<const void*> load_part(const std::string& name);

// `inside`: the address of the weak declaration; null where the room is not linked in.
template <class Table>
Result<const Table*> part(const std::string& name, const Table* inside) {
  if (inside != nullptr) {
    return inside;
  }
  SIXPOINT_ASSIGN(const void* loaded, load_part(name));
  return static_cast<const Table*>(loaded);
}

}  // namespace sixpoint
