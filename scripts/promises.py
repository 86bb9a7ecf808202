#!/usr/bin/env python3
"""The promises of docs/promises.md and the threats of docs/security.md against the code and the tests that exist.

  scripts/promises.py build    the folder in which the tests were built

What must hold:
- Every row has an identifier of its own (a capital letter and a number), a sentence, a rule and tests.
- The rule is a file, then the functions in it: `repair/triage/triage.h` `triage`. The file exists and
  names each function. A header holds the table of the rule's cases.
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


def check_row(cells, tests):
    if len(cells) != 4 or not all(cells):
        return ["a row has four cells: identifier, promise, rule, tests"]
    wrong = []
    rule = re.findall(r"`([^`]+)`", cells[2])
    if not rule:
        return ["the rule names no file"]
    file = project / rule[0]
    if not file.is_file():
        wrong.append(f"no file {rule[0]}")
    else:
        text = file.read_text()
        wrong += [f"{rule[0]} does not name {name}" for name in rule[1:]
                  if not re.search(rf"\b{re.escape(name)}\b", text)]
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
