// Texts and JSON documents as values of Python, and back.
//
//   const pybind11::dict answer = dict_of(document);
//   const repair::Json options = json_of(given);
//
// Names of files may hold bytes that are no UTF-8, and errors and answers hold names. Python's text has
// a surrogate for each such byte (PEP 383), as os.fsdecode() makes it: a name that comes out can
// go in again.
#pragma once

#include <string_view>

#include <pybind11/pybind11.h>

#include "repair/batch/answers.h"

namespace sixpoint::python {

pybind11::str text_of(std::string_view bytes);

// Of a JSON object. Numbers that JSON does not have (NaN) are None, as in the text of a document.
pybind11::dict dict_of(const repair::Json& json);

// Of None, bool, int, float, str, bytes, and a dict of them; a TypeError of Python for others. A whole
// number that 64 bits do not hold becomes a float, which no option takes.
repair::Json json_of(pybind11::handle value);

}  // namespace sixpoint::python
