// Standard input, standard output and standard error of a program that was started without them
// (2>&- in a shell, some services and schedulers).
//
//   take_closed_streams();  // first of all in main()
//
// The system gives a file that is opened the lowest number that is free. So the first file of a
// program without standard error would get the number 2, and text for people would go into that
// file: a store, a recording, a lock. A number that is taken is given to no file.
//
//     the stream           before               afterwards
//     is open              as it is             as it is
//     is closed            the next file's      reads and writes fail (EBADF), as on a closed one
//
// So a closed standard output ends a command that writes to it with 74, as a full disk does; what
// people would read on a closed standard error is lost.
#pragma once

namespace sixpoint::cli {

// Once, before any file is opened or any thread is started.
void take_closed_streams();

}  // namespace sixpoint::cli
