// What an exception that no library caught says to people.
//
//   const Error error = error_of(std::bad_alloc());  // io: "not enough memory"
//
// The libraries return errors as values, so it is a limit of the machine or a defect of this program:
//
//     exception                                              code       says
//     std::bad_alloc; a system_error "not enough memory"     io         not enough memory
//     a system_error "resource unavailable, try again"       io         no more threads
//     any other                                              internal   please report it
//
// May be called from any thread.
#pragma once

#include <exception>

#include "base/error.h"

namespace sixpoint {

Error error_of(const std::exception& exception);
// Of one that a thread caught and handed over.
Error error_of(const std::exception_ptr& thrown);

}  // namespace sixpoint
