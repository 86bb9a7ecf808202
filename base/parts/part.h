// A part of the program that is loaded when it is first used: a room that needs large libraries for
// work which few commands do. Loading PostgreSQL's client and the drawing libraries with every
// command made `sixpoint --version` start in 45 ms instead of 17, and took 15 MB of memory.
//
// Between a part and its callers stands a table of functions. The room that calls declares it:
//
//     struct SheetDrawing {
//       Result<Bytes> (*png)(const std::string& svg);
//     };
//
// the part defines it under the name of the part:
//
//     extern "C" const SheetDrawing sixpoint_part_drawing = {&png_of};
//
// and this gives it to the caller:
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
