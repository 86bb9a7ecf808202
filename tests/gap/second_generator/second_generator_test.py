#!/usr/bin/python3
"""The diagnosis on bundles of another generator: second_generator_test.py build/sixpoint"""

import json
import os
import pathlib
import struct
import sys
import tempfile
import unittest
import zipfile

try:
    import numpy as np
except ImportError:  # the group `python` of scripts/install_packages.sh
    print("SKIPPED: install the Debian package python3-numpy", file=sys.stderr)
    sys.exit(1 if os.environ.get("SIXPOINT_MUST_NOT_SKIP") else 77)

import bound
import draw
import generate
import measure
import unit

PROGRAM = sys.argv.pop(1) if len(sys.argv) > 1 else "build/sixpoint"
SHARED = pathlib.Path(os.environ.get("SIXPOINT_SHARED", pathlib.Path(__file__).parents[4] / "shared"))


class Diagnosis(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def answers(self, stratum, kind, count, seed):
        folder = self.folder / f"{stratum}_{kind}_{seed}"
        for name, label in generate.make(folder, stratum, kind, count, seed, False).items():
            answer = measure.diagnose(PROGRAM, folder / name)
            self.assertIsNotNone(answer, name)
            yield name, label, answer

    def test_the_dominant_effect_of_a_real_unit_is_named(self):
        for kind in ("engineering", "production"):
            for name, label, answer in self.answers("realistic", kind, 2, 71):
                dominant = [e["name"] for e in label["effects"] if e["dominant"]]
                self.assertTrue([e for e in label["effects"] if e["dominant"]][0]["must"], name)
                self.assertEqual([e["name"] for e in answer["effects"][:1]], dominant, name)

    def test_what_is_named_of_three_effects_is_there(self):
        for name, label, answer in self.answers("triple", "production", 2, 72):
            there = {e["name"] for e in label["effects"]}
            self.assertLessEqual({e["name"] for e in answer["effects"]}, there, name)
            self.assertTrue(answer["effects"], name)

    def test_no_alarm_where_nothing_is_missing(self):
        # At 100 Hz; what other rates do stands in docs/gap.md, Another generator.
        for kind, count in (("production", 2), ("engineering", 1)):
            for name, _, answer in self.answers("none", kind, count, 73):
                self.assertEqual(answer["verdict"], "no_gap", name)


class Form(unittest.TestCase):
    """A bundle has the files and keys of those by others."""

    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name) / "made"
        self.label = generate.make(self.folder, "realistic", "engineering", 1, 5, False)
        self.bundle = next(self.folder.glob("re*"))

    def test_the_same_seed_gives_the_same_bundle(self):
        again = self.folder.with_name("again")
        self.assertEqual(generate.make(again, "realistic", "engineering", 1, 5, False), self.label)
        for file in self.bundle.iterdir():
            if file.suffix == ".gt3x":  # its archive holds the time of day
                contents = [zipfile.ZipFile(folder / file.name).read("log.bin") for folder in (self.bundle, again / self.bundle.name)]
                self.assertEqual(*contents)
            else:
                self.assertEqual(file.read_bytes(), (again / self.bundle.name / file.name).read_bytes())

    def test_every_record_is_a_second_of_samples_with_a_checksum(self):
        log = zipfile.ZipFile(self.bundle / "recording.gt3x").read("log.bin")
        at = samples = 0
        while at < len(log):
            separator, kind, _, length = struct.unpack_from("<BBIH", log, at)
            self.assertEqual((separator, kind), (0x1E, 26))
            self.assertEqual(int(np.bitwise_xor.reduce(np.frombuffer(log, np.uint8, 9 + length, at))), 0xFF)
            samples += length // 6
            at += 9 + length
        last = json.loads((self.bundle / "protocol.json").read_text())["segments"][-1]
        self.assertEqual(samples, last["first_sample"] + last["samples"])

    def test_keys_are_those_of_practice_bundles(self):
        other = SHARED / "gap" / "practice2" / "r02"
        if not other.exists():
            self.assertNotIn("SIXPOINT_MUST_HAVE_SHARED", os.environ, f"{other} is missing")  # as tests/shared_data.h
            self.skipTest("the practice bundles are not here")
        self.assertEqual(sorted(f.name for f in self.bundle.iterdir()), sorted(f.name for f in other.iterdir()))
        ours, theirs = (json.loads((f / "protocol.json").read_text()) for f in (self.bundle, other))
        self.assertEqual(ours.keys(), theirs.keys())
        for key in ("name", "kind"):
            self.assertEqual({s[key] for s in ours["segments"]}, {s[key] for s in theirs["segments"]})
        self.assertEqual(set().union(*ours["segments"]), set().union(*theirs["segments"]))
        for csv in ("temperature.csv", "host_clock.csv"):
            first = [(f / csv).read_text().split("\n")[0] for f in (self.bundle, other)]
            self.assertEqual(*first)


class Model(unittest.TestCase):
    def setUp(self):
        self.rng = np.random.default_rng(3)
        self.segments = draw.protocol.make("production", 100, self.rng)
        self.temperature = draw.protocol.Temperature(self.segments, self.rng)
        self.unit = unit.Unit(self.rng, 100, 400)

    def test_rotations_turn_the_vertical_as_the_name_of_the_face_says(self):
        for axis in range(3):
            for sign in (1, -1):
                for quarter in range(4):
                    r = draw.protocol.face(axis, sign, quarter * np.pi / 2)
                    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-12)
                    self.assertAlmostEqual(np.linalg.det(r), 1)
                    np.testing.assert_allclose(r @ [0, 0, 1], sign * np.eye(3)[axis], atol=1e-12)

    def test_the_bound_of_a_misalignment_is_that_of_its_arc(self):
        """0.1 degree moves an axis by 1.745 mg on each of the faces that see it; a seat scatters by 0.17 mg."""
        features = bound.Features(self.segments, self.temperature, 100, self.unit)
        features.all = features.base  # no other effect
        features.parts = {}
        e = bound.effect("misalignment", {"rotation_vector_deg": [0, 0, 0.1]})
        levels = [s for s in self.segments if abs(s.rotation[2, 2]) < 0.5]
        variance = (unit.SEATING_DEG * np.pi / 180 * 1000) ** 2 + features.white[0]
        # On faces of X and Y one axis each moves, by the same in opposite faces but for the sign.
        expected = np.sqrt(len(levels) * (0.1 * np.pi / 180 * 1000) ** 2 / variance)
        self.assertAlmostEqual(features.index(e) / expected, 1, delta=0.05)

    def test_a_seat_alone_moves_no_axis_that_points_up(self):
        features = bound.Features(self.segments, self.temperature, 100, self.unit)
        moved = np.sqrt(np.diag(features.seating(0.1))).reshape(-1, 3)
        for (segment, *_), row in zip(features.rows, moved):
            up = np.abs(segment.rotation[:, 2])
            np.testing.assert_allclose(row[up > 0.5], 0, atol=0.01)
            np.testing.assert_allclose(row[up < 0.5], 1.745 * self.unit.gain[up < 0.5], rtol=0.02)


if __name__ == "__main__":
    unittest.main()
