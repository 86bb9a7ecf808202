#!/usr/bin/env python3
"""The promises of docs/promises.md and the threats of docs/security.md against the code and the tests that exist.

  scripts/promises.py build    the folder in which the tests were built

What must hold:
- Every row has an identifier of its own (a capital letter and a number), a sentence, a rule and tests.
- The rule is a header, then the functions in it: `repair/triage/triage.h` `triage`. The header exists and
  declares each of them. A threat may name a limit instead, which has its value there: `most_idle`.
- The header holds the table of the rule's cases. Every row of a table there has as many cells as its head.
- Each of the tests is one that ctest knows, or a pattern with a star that fits at least one.
- A test that names a promise in its source ("promise T1") names one that exists.
"""
import fnmatch
import json
import pathlib
import re
import subprocess
import sys

project = pathlib.Path(__file__).resolve().parent.parent


def read_rows(text):
    """The rows of all tables of the page whose first cell is an identifier."""
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if line.startswith("|") and re.fullmatch(r"[A-Z]+[0-9]+", cells[0]):
            yield cells


def declares(text, name, is_threat):
    """Whether a header has a function of this name, or a limit of a threat with its value."""
    code = re.sub(r"//.*", "", text)
    return re.search(rf"(?<![.>\w]){re.escape(name)}\(", code) or (
        is_threat and re.search(rf"\b{re.escape(name)} = \w", code))


def comment_paragraphs(text):
    """(number of the first line, lines) of the paragraphs of a header's comments, indents kept."""
    begin, lines = 0, []
    for number, line in enumerate([*text.splitlines(), ""], 1):
        comment = re.match(r"\s*//(.*\S)", line)
        if comment:
            begin, lines = (begin, lines) if lines else (number, lines)
            lines.append(comment.group(1))
        elif lines:
            yield begin, lines
            lines = []


def column_starts(line):
    return [cell.end() for cell in re.finditer(r"\S {2,}(?=\S)", line)]


def broken_rows(text):
    """The lines of a header's tables that do not go with the first line of their table.

    A table has a bar before, between and behind its cells, or is indented by five and has two blanks or
    more before each further column; in the latter a text may not run into a column.
    """
    for begin, lines in comment_paragraphs(text):
        head = next((i for i, line in enumerate(lines) if line.startswith(" | ")), None)
        if head is not None:
            cells = lines[head].count("|")
            for i, line in enumerate(lines[head:], head):
                if line.count("|") != cells or not (line.startswith(" |") and line.endswith("|")):
                    yield begin + i
        elif all(line.startswith(" " * 5) for line in lines) and len(lines) > 2:
            head = column_starts(lines[0])
            for i, line in enumerate(lines):
                runs_in = any(line[at - 2:at].strip() for at in head)
                if head and (runs_in or not set(column_starts(line)) <= set(head)):
                    yield begin + i


def check_row(cells, tests):
    if len(cells) != 4 or not all(cells):
        return ["a row has four cells: identifier, promise, rule, tests"]
    wrong = []
    rule = re.findall(r"`([^`]+)`", cells[2])
    if not rule:
        return ["the rule names no file"]
    file = project / rule[0]
    if not file.is_file() or file.suffix != ".h":
        wrong.append(f"no header {rule[0]}")
    elif not rule[1:]:
        wrong.append("the rule names no function")
    else:
        text = file.read_text()
        wrong += [f"{rule[0]} has no function {name}()" for name in rule[1:]
                  if not declares(text, name, cells[0].startswith("X"))]
        wrong += [f"{rule[0]}:{line}: this row of a table does not have the cells of its head"
                  for line in broken_rows(text)]
    named = re.findall(r"`([^`]+)`", cells[3])
    if not named:
        wrong.append("no test")
    wrong += [f"no test {name}" for name in named if not fnmatch.filter(tests, name)]
    return wrong


def main():
    listed = subprocess.run(["ctest", "--test-dir", sys.argv[1], "--show-only=json-v1"],
                            check=True, capture_output=True, text=True).stdout
    tests = [test["name"] for test in json.loads(listed)["tests"]]
    wrong, known = [], set()
    pages = [project / "docs/promises.md", project / "docs/security.md"]
    for cells in read_rows("\n".join(page.read_text() for page in pages)):
        if cells[0] in known:
            wrong.append(f"{cells[0]}: twice")
        known.add(cells[0])
        wrong += [f"{cells[0]}: {what}" for what in check_row(cells, tests)]
    for file in sorted((project / "tests").rglob("*.cpp")):
        for name in re.findall(r"\bpromise ([A-Z]+[0-9]+)\b", file.read_text()):
            if name not in known:
                wrong.append(f"{file.relative_to(project)}: no promise {name}")
    if not known:
        wrong.append("no promises were found")
    print("\n".join(wrong) if wrong else f"{len(known)} promises and threats, each with its rule and its tests")
    return 1 if wrong else 0


sys.exit(main())
