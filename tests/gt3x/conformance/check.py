#!/usr/bin/env python3
"""Runs sixpoint over the conformance suite: check.py SIXPOINT FOLDER [RECORDINGS.md]

With docs/recordings.md also checks that each of its rules has a file, and each file a rule that is there.
Another reader needs a function like answer_of() of its own; everything else stays. Python's standard library alone.
"""
import calendar
import json
import pathlib
import re
import subprocess
import sys
import time


def seconds_of(text):
    """Of a time by the file's own clock: the suite has none with an offset."""
    return calendar.timegm(time.strptime(text[:19], "%Y-%m-%dT%H:%M:%S"))


def answer_of(program, path, salvage):
    """What the reader makes of a file, in the form of README.md."""
    option = ["--salvage"] if salvage else []

    def run(*arguments):
        return subprocess.run([program, *arguments, *option], capture_output=True, timeout=20, check=False)

    seen = run("inspect", path, "--json")
    exported = run("export", path, "--raw", "--no-fill", "--unix", "--csv", "-")
    for done in (seen, exported):
        if done.returncode not in (0, 65):
            return {"answer": f"ended with {done.returncode}: {done.stderr.decode(errors='replace')}"}
    if seen.returncode != 0 or exported.returncode != 0:
        return {"answer": "refused", "says": (seen.stderr + exported.stderr).decode(errors="replace"),
                "stdout": exported.stdout}
    facts = json.loads(seen.stdout)
    answer = {key: facts[key] for key in ("serial", "firmware", "sample_rate_hz", "accel_scale_lsb_per_g", "constants",
                                          "calibration_time", "records", "checksum_failures")}
    answer["answer"] = "read"
    answer["start"] = seconds_of(facts["start"])
    answer["damaged_stretches"] = facts["damage"]["stretches"]
    answer["gaps"] = [[seconds_of(gap["start"]), gap["seconds"], gap["kind"]] for gap in facts["gaps"]]
    for kind in ("missing", "doubtful"):
        answer[kind] = sorted({loss["entry"] or "" for loss in facts["losses"] or [] if loss["kind"] == kind})
    lines = exported.stdout.decode().split("\r\n")[11:-1]
    answer["samples"] = [[int(line.split(".")[0]), *map(int, line.split(",")[1:])] for line in lines]
    return answer


def difference(expected, answer):
    """Why the answer is not what is expected; nothing where it is."""
    if answer["answer"] != expected.get("answer", "read"):
        return f"it is {answer['answer']}: {answer.get('says', '')}"
    if expected.get("answer") == "refused":
        if expected.get("says", "") not in answer["says"]:
            return f"it does not say '{expected['says']}': {answer['says']}"
        return None
    for key, value in expected.items():
        if key in ("rule", "about", "answer", "salvage", "says"):
            continue
        if key in ("missing", "doubtful"):
            # What else is lost may be said too, but not of entries that are whole.
            same = set(value) <= set(answer[key]) and (value or not answer[key])
        else:
            same = answer[key] == value
        if not same:
            return f"{key} is {str(answer[key])[:300]}, not {str(value)[:300]}"
    return None


def rule_failures(folder, document):
    """Rules without a file, and files of no rule."""
    rules = set(re.findall(r"^\| ([A-Z]\d+) \|", document.read_text(), re.MULTILINE))
    held = {json.loads(path.read_text())["rule"] for path in folder.glob("*.json")}
    return [f"FAILED rule {rule}: no file holds it" for rule in sorted(rules - held)] + [
        f"FAILED rule {rule}: {document.name} has none" for rule in sorted(held - rules)]


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    program, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    count = failures = 0
    if len(sys.argv) == 4:
        lacking = rule_failures(folder, pathlib.Path(sys.argv[3]))
        failures += len(lacking)
        print("\n".join(lacking))
    for path in sorted(folder.glob("*.json")):
        expected = json.loads(path.read_text())
        trials = [(False, expected)]
        if "salvage" in expected:
            trials.append((True, expected["salvage"]))
        for salvage, wanted in trials:
            why = difference(wanted, answer_of(program, str(path.with_suffix(".gt3x")), salvage))
            if why:
                failures += 1
                print(f"FAILED {path.stem}{' --salvage' if salvage else ''} ({expected['about']}): {why}")
        count += 1
    print(f"{count} files, {failures} failures")
    sys.exit(1 if failures or count < 120 else 0)


if __name__ == "__main__":
    main()
