// The temporary files that this process is writing, so that one that is told to end leaves none.
//
//   note_temporary("/data/.out.csv.0.tmp");
//   forget_temporary("/data/.out.csv.0.tmp");  // once it has its name, or is removed
//
// AtomicFile notes its own, and a backup its own. Any thread may call any of these.
#pragma once

#include <string>

namespace sixpoint {

void note_temporary(const std::string& path);
void forget_temporary(const std::string& path);
bool is_noted_temporary(const std::string& path);

// Unlinks every file that is noted. For a signal handler that ends the process: it takes no memory
// and waits for nothing.
void remove_noted_temporaries() noexcept;

}  // namespace sixpoint
