"""Reads the answer of 'history --json', prints its last run, a set of constants, and the jig of that run."""
import json
import sys

history = json.load(sys.stdin)
run = next(run for run in reversed(history["runs"]) if run["kind"] == "jig")
print(run["id"][:12], history["constants"][-1]["id"][:12], run["jig"])
