#!/usr/bin/env python3
"""The table of docs/architecture.md against the link lines: check_rooms.py PROJECT."""
import pathlib
import re
import sys

project = pathlib.Path(sys.argv[1])
rows = re.findall(r"^\| `(\w+)/` \|.*\| ([^|]+) \|$",
                  (project / "docs/architecture.md").read_text(), re.MULTILINE)
rooms = [room for room, _ in rows]
wrong = []
above = set()
for room, sees in rows:
    if sees.startswith("everything above"):
        said = set(above)
    else:
        said = set(re.findall(r"\w+", sees)) & set(rooms)
    # A line that is a comment names nothing.
    cmake = re.sub(r"#.*", "", (project / room / "CMakeLists.txt").read_text())
    call = re.search(r"sixpoint_room\(" + room + r"\b(.*?)\)\s*$", cmake, re.DOTALL | re.MULTILINE)
    linked = set(re.findall(r"\bsixpoint::(\w+)", call.group(1))) - {"base"} if call else None
    said -= {"base"}
    if linked != said:
        wrong.append(f"{room}: docs/architecture.md says {sorted(said)}, its link line {linked and sorted(linked)}")
    above.add(room)
folders = {path.parent.name for path in project.glob("*/CMakeLists.txt")
           if "sixpoint_room(" in path.read_text()}
if folders != set(rooms):
    wrong.append(f"rooms in the table {sorted(rooms)}, in the folders {sorted(folders)}")
print("\n".join(wrong) or f"{len(rooms)} rooms are as docs/architecture.md says")
sys.exit(1 if wrong else 0)
