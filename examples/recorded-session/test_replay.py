"""Replays a recorded session against the program, and says how it must end."""

import json
import os
import subprocess

import pytest

PROGRAM = os.environ.get("SIXPOINT_PROGRAM", "sixpoint")


def sixpoint(*arguments, ends_with=0):
    """Runs the program and returns its JSON document."""
    done = subprocess.run([PROGRAM, *map(str, arguments), "--json"], capture_output=True, text=True, check=False)
    assert done.returncode == ends_with, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    sixpoint("jig", "--device", "virtual:seed=7,jig=auto", "--store", folder / "bench.db", "--record", folder / "session.zip")
    return folder / "session.zip"


def test_the_same_program_ends_as_it_did(session, tmp_path):
    answer = sixpoint("jig", "--device", f"replay:{session}", "--store", tmp_path / "replay.db")
    assert answer["verdict"] == "pass"
    assert len(answer["poses"]) == 6


def test_what_the_session_does_not_hold_is_no_answer(session, tmp_path):
    # The session ends before a write: a run that writes loses its unit there, and nothing passes.
    answer = sixpoint("jig", "--device", f"replay:{session}", "--store", tmp_path / "replay.db", "--write", ends_with=69)
    assert answer["verdict"] == "inconclusive"
    assert "unit_gone" in answer["codes"]


def test_a_changed_session_is_refused(session, tmp_path):
    changed = tmp_path / "changed.zip"
    content = bytearray(session.read_bytes())
    content[len(content) // 2] ^= 1
    changed.write_bytes(content)
    answer = sixpoint("session", "show", changed, ends_with=65)
    assert answer["error"]["hint"]
