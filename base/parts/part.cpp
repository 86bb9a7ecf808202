#include "base/parts/part.h"

#include <dlfcn.h>

namespace sixpoint {

namespace {

Result<const void*> refused(const std::string& name) {
  const char* const said = dlerror();
  return fail(ErrorCode::cannot_create,
              "a part of the program does not load" +
                  (said == nullptr ? std::string() : ": " + std::string(said)),
              name,
              "start the program again if it was updated while it ran; else install the whole "
              "package again: the parts stand in lib/sixpoint beside the program's folder");
}

}  // namespace

Result<const void*> load_part(const std::string& name) {
  const std::string library = "libsixpoint-" + name + "-" SIXPOINT_VERSION ".so";
  // All symbols at once: what is missing is said here, and not in the middle of work.
  void* const handle = dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    return refused(name);
  }
  const void* const table = dlsym(handle, ("sixpoint_part_" + name).c_str());
  if (table == nullptr) {
    return refused(name);
  }
  return table;
}

}  // namespace sixpoint
