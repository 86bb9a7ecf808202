#!/usr/bin/env python3
"""The examples at the top of the headers, as C++ files that the build of the tests compiles.

  scripts/header_examples.py write WING FILE   writes the examples of a wing's headers into FILE
  scripts/header_examples.py check FOLDER      says what is wrong, and ends with 1 when anything is:
                                               a header does not begin with an example, or FOLDER
                                               does not hold what `write` makes of the headers now

An example is the lines of a header's first comment that are indented by three spaces: `//   code`. It
stands behind the first paragraph. Formulas, tables and other text that is set apart are indented by
five. Code that begins with the definition of a function or a type is compiled as it is; any other code
is the body of a function that returns Status. All of it lies in the header's own namespace.

tests/docs/header_examples/WING.txt has a line for each header whose example needs more than that:

  gt3x/forms/parameters.h: "gt3x/log/record.h" const Record& record

First come headers that are included as well, then parameters of the example's function. Parameters of
the line `*` are for every example of the wing that uses such a name and does not declare it;
every_wing.txt has those of all wings. without_example.txt lists the headers that need no example.
"""
import pathlib
import re
import sys

project = pathlib.Path(__file__).resolve().parent.parent
contexts = project / "tests/docs/header_examples"
WINGS = re.search(r"foreach\(room ([^)]*)\)", (project / "CMakeLists.txt").read_text()).group(1).split()
DEFINITION = re.compile(r"(struct|class|enum|template)\b"
                        r"|(?!(for|if|while|switch|return|else)\b)[\w:<>,&* ]+[ &*]\w+\([^=\[]*\) \{$")


class Header:
    def __init__(self, file):
        self.name = str(file.relative_to(project))
        text = file.read_text()
        comment = re.match(r"(?://.*\n)*", text).group(0).split("\n")
        self.lines = code_lines([line[2:] for line in comment])  # (number, code)
        first_paragraph = next(number for number, line in enumerate(comment) if not line[2:].strip())
        self.begins_with_example = bool(self.lines) and self.lines[0][0] == first_paragraph + 2
        found = re.search(r"^namespace (sixpoint[\w:]*) \{", text, re.MULTILINE)
        self.namespace = found.group(1) if found else "sixpoint"

    def compiled(self, parameters, wing_parameters):
        """The example as C++, in a namespace of its own. #line: the compiler names the header's line."""
        code = [line for _, line in self.lines]
        number, body = self.lines[0][0], []
        for line_number, line in self.lines:
            body += [""] * (line_number - number - len(body)) + ["  " + line]
        body = f'#line {number} "{self.name}"\n' + "\n".join(body) + "\n"
        if not DEFINITION.match(re.sub(r"\s*//.*", "", code[0])):
            given = ", ".join(parameters + used_by(code, wing_parameters, parameters))
            body = f"Status example({given}) {{\n{body}  return {{}};\n}}\n"
        own = re.sub(r"\W", "_", self.name)
        return (f"namespace {self.namespace} {{\nnamespace {{\nnamespace example_{own} {{\n{body}"
                "}\n}\n}\n")


def code_lines(comment):
    """(line, code) of every paragraph whose first line is indented by three spaces, and no more."""
    lines, is_code, at_start = [], False, True
    for number, line in enumerate(comment, 1):
        if not line.strip():
            at_start = True
            continue
        if at_start:
            is_code = re.match(r"   \S", line) is not None
        elif not line.startswith("   "):
            is_code = False
        at_start = False
        if is_code:
            lines.append((number, line[3:]))
    return lines


def name_of(parameter):
    return re.search(r"(\w+)\W*$", parameter).group(1)


def used_by(code, wing_parameters, given):
    """Those of the wing's parameters whose names the example uses and does not declare."""
    text = "\n".join(re.sub(r'"(\\.|[^"\\])*"|//.*', "", line) for line in code)
    needed = []
    for parameter in wing_parameters:
        name = name_of(parameter)
        # Not a member (`.name`, `->name`) and no namespace (`name::`).
        first = re.search(rf"(?<!\.)(?<!->)(?<!::)\b{name}\b(?!::)", text)
        # A word, `&` or `*` and a blank before the name: its declaration.
        declared = first and re.search(r"(?<!\breturn)[\w>&*]\s+$", text[:first.start()])
        if first and not declared and name not in [name_of(one) for one in given]:
            needed.append(parameter)
    return needed


def split_parameters(text):
    """At the commas between parameters, not at those inside <...> or (...)."""
    parts, depth = [""], 0
    for character in text:
        depth += (character in "<({") - (character in ">)}")
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts if part.strip()]


def lines_of(name):
    lines = (contexts / f"{name}.txt").read_text().split("\n")
    return [line for line in lines if line.strip() and not line.startswith("#")]


def read_context(name):
    """From a header, or `*`, to (includes, parameters)."""
    context = {}
    for line in lines_of(name):
        found = re.match(r'([^:]+):((?:\s+(?:"[^"]+"|<[^>]+>))*)(?:\s+(.*))?$', line)
        if not found:
            sys.exit(f"{name}.txt: this line is not 'HEADER: \"include\" ... parameters': {line}")
        context[found.group(1)] = (found.group(2).split(), split_parameters(found.group(3) or ""))
    return context


def headers_of(wing):
    files = [*(project / wing).glob("*.h"), *(project / wing).glob("*/*.h")]
    return [Header(file) for file in sorted(files)]


def text_of(wing):
    nothing = ([], [])
    context = read_context(wing)
    wing_parameters = read_context("every_wing")["*"][1] + context.get("*", nothing)[1]
    headers = [header for header in headers_of(wing) if header.lines]
    includes = {'"base/env.h"', '"base/result.h"'} | {f'"{header.name}"' for header in headers}
    for needed, _ in context.values():
        includes.update(needed)
    text = "// Made by scripts/header_examples.py from the first comments of the headers.\n"
    text += "".join(f"#include {include}\n" for include in sorted(includes))
    return text + "".join(header.compiled(context.get(header.name, nothing)[1], wing_parameters)
                          for header in headers)


def file_that_includes(header):
    """A file of another room, or a test, that includes this header."""
    room = str(pathlib.PurePath(header).parent)
    for folder in WINGS + ["tests", "bench", "fuzz"]:
        for pattern in ["*.h", "*.cpp", "*/*.h", "*/*.cpp", "*/*/*.h", "*/*/*.cpp"]:
            for file in (project / folder).glob(pattern):
                other = file.relative_to(project)
                if str(other.parent) != room and f'#include "{header}"' in file.read_text():
                    return str(other)
    return None


def problems(folder):
    without = lines_of("without_example")
    known = set()
    for wing in WINGS:
        headers = {header.name: header for header in headers_of(wing)}
        known.update(headers)
        for name, header in headers.items():
            if header.lines and name in without:
                yield f"{name} has an example and stands in without_example.txt"
            elif name not in without and not header.begins_with_example:
                yield f"{name} does not begin with an example: code behind the first paragraph, `//   code`"
        for name in read_context(wing):
            if name != "*" and not (name in headers and headers[name].lines):
                yield f"{wing}.txt has a line for {name}, which has no example"
        file = folder / f"{wing}.cpp"
        if not file.exists() or file.read_text() != text_of(wing):
            yield f"{file} is not what the headers of {wing}/ say now: build again"
    for name in without:
        if name not in known:
            yield f"without_example.txt names {name}, which is not there"
        elif other := file_that_includes(name):
            yield f"{name} stands in without_example.txt, but {other} includes it: it needs an example"


def main():
    arguments = sys.argv[1:]
    if arguments[:1] == ["write"] and len(arguments) == 3:
        pathlib.Path(arguments[2]).write_text(text_of(arguments[1]))
        return
    if arguments[:1] != ["check"] or len(arguments) != 2:
        sys.exit(__doc__)
    wrong = list(problems(pathlib.Path(arguments[1])))
    number = sum(1 for wing in WINGS for header in headers_of(wing) if header.lines)
    print("\n".join(wrong) or f"{number} headers begin with an example, and all examples are compiled")
    sys.exit(1 if wrong else 0)


main()
