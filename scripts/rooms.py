#!/usr/bin/env python3
"""The rooms, from their CMakeLists.txt, against the includes and against docs/architecture.md.

  scripts/rooms.py            says what is wrong, and ends with 1 when anything is
  scripts/rooms.py --write    writes the pictures in docs/architecture.md anew

What must hold:
- A room includes headers of the rooms on its own link line, and of no others; a room on a link line
  is included by at least one file. cli/program/commands.cpp lists the commands and declares them itself:
  the room that defines add_NAME counts as included.
- No include runs up: a room's neighbours stand before it in the order in which CMake adds them.
- A room that CMake adds only where a library is installed (mocks/umockdev) is a room as any other.
- Each tests/**/*_test.cpp is named in a CMakeLists.txt: a test that is not built says nothing.
- The text between the two marks in docs/architecture.md is what this script writes.
"""
import pathlib
import re
import sys

project = pathlib.Path(__file__).resolve().parent.parent
BEGIN, END = "<!-- rooms: begin (scripts/rooms.py --write) -->", "<!-- rooms: end -->"


class Room:
    def __init__(self, folder, arguments):
        self.folder = folder
        self.linked = set(re.findall(r"\bsixpoint::(\w+)", arguments))
        self.included = {}  # room name -> a file that includes it

    @property
    def name(self):
        return self.folder.replace("/", "_")


def read_rooms(folder, rooms):
    """Rooms in the order in which CMake adds them; CMake adds a folder's own room where it stands."""
    text = re.sub(r"#.*", "", (project / folder / "CMakeLists.txt").read_text())
    step = re.compile(r"sixpoint_room\((?P<room>[\w/]+)(?P<arguments>[^)]*)\)"
                      r"|foreach\(\w+ (?P<list>[^)]*)\)\s*add_subdirectory"
                      r"|add_subdirectory\((?P<one>\w+)\)", re.MULTILINE)
    for found in step.finditer(text):
        if found.group("room"):
            rooms.append(Room(found.group("room"), found.group("arguments")))
        else:
            for below in (found.group("list") or found.group("one")).split():
                read_rooms(f"{folder}/{below}" if folder else below, rooms)
    return rooms


def read_includes(rooms):
    by_folder = {room.folder: room for room in rooms}
    for room in rooms:
        folder = project / room.folder
        for file in sorted(folder.glob("*.h")) + sorted(folder.glob("*.cpp")):
            for include in re.findall(r'^#include "([^"]+)/[^"/]+"', file.read_text(), re.MULTILINE):
                if include in by_folder and by_folder[include] is not room:
                    room.included.setdefault(by_folder[include].name, file.relative_to(project))


def read_commands(rooms):
    file = project / "cli/program/commands.cpp"
    program = next(room for room in rooms if project / room.folder == file.parent)
    names = "|".join(re.findall(r"COMMAND\((\w+)\)", file.read_text()))
    defined = re.compile(rf"^void add_({names})\(CLI::App& app, Context& context\) {{", re.MULTILINE)
    for room in rooms:
        for other in (project / room.folder).glob("*.cpp"):
            if defined.search(other.read_text()):
                program.included.setdefault(room.name, file.relative_to(project))


def problems(rooms):
    order = {room.name: place for place, room in enumerate(rooms)}
    for room in rooms:
        for name, file in room.included.items():
            if name not in room.linked:
                yield f"{file} includes a header of {name}, which is not on the link line of {room.folder}"
            if order[name] > order[room.name]:
                yield f"{file} includes up: {name} is added after {room.name}"
        for name in sorted(room.linked - set(room.included)):
            if name in order:
                yield f"{room.folder} links {name} and includes nothing of it"
        if not (project / room.folder / "README.md").exists():
            yield f"{room.folder} has no README.md"


def tests_not_built():
    lists = "".join(file.read_text() for file in (project / "tests").glob("**/CMakeLists.txt"))
    for file in sorted((project / "tests").glob("**/*_test.cpp")):
        if not re.search(rf"\b{file.name}\b", lists):
            yield f"{file.relative_to(project)} is named in no CMakeLists.txt: it is not built"


def picture(rooms):
    """A flowchart of the wings, and a line for each room with the neighbours that it sees."""
    wing = {room.name: room.folder.split("/")[0] for room in rooms}
    arrows = sorted({(wing[room.name], wing[name]) for room in rooms for name in room.linked
                     if name in wing and wing[name] != wing[room.name] and wing[name] != "base"},
                    key=lambda arrow: [list(wing.values()).index(end) for end in arrow])
    lines = ["```mermaid", "flowchart BT"]
    lines += [f"  {above} --> {below}" for above, below in arrows]
    lines += ["```", "", "| room | sees, beside `base` |", "|---|---|"]
    folder = {room.name: room.folder for room in rooms}
    for room in rooms:
        seen = [f"`{folder[other.name]}`" for other in rooms
                if other.name in room.linked and other.name != "base"]
        lines.append(f"| `{room.folder}` | {', '.join(seen) or '-'} |")
    return "\n".join(lines)


def main():
    rooms = read_rooms("", [])
    read_includes(rooms)
    read_commands(rooms)
    page = project / "docs/architecture.md"
    text = page.read_text()
    if BEGIN not in text or END not in text:
        sys.exit(f"docs/architecture.md lacks the marks '{BEGIN}' and '{END}'")
    before, rest = text.split(BEGIN)
    written = f"{before}{BEGIN}\n{picture(rooms)}\n{END}{rest.split(END)[1]}"
    if sys.argv[1:] == ["--write"]:
        page.write_text(written)
    wrong = list(problems(rooms)) + list(tests_not_built())
    if written != page.read_text():
        wrong.append("docs/architecture.md is not what the link lines say; run scripts/rooms.py --write")
    print("\n".join(wrong) or f"{len(rooms)} rooms: includes, link lines and docs/architecture.md agree")
    sys.exit(1 if wrong else 0)


main()
