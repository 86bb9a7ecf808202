"""inspect, scan, solve and repair: the same documents as the program's."""

import dataclasses
import hashlib
import os
import pathlib
import pickle
import shutil

import sixpoint

from made import InFolder, program, program_json, real, simulated


def without_time(document):
    return {key: value for key, value in document.items() if key not in ("schema", "seconds", "stored_id")}


def fields_of(answer):
    return {one.name for one in dataclasses.fields(answer)} - {"document"}


class SameAnswers(InFolder):
    def test_inspect(self):
        for path in (simulated(), real("gt9x/TAS1H30182785_2019-09-17.gt3x"), real("agd/example1sec.agd")):
            answer = sixpoint.inspect(path)
            said = program_json("inspect", path)
            self.assertEqual(without_time(said), answer.document)
            self.assertEqual(set(answer.document) | {"error"}, fields_of(answer))
            self.assertEqual(answer.serial, said["serial"])

    def test_scan(self):
        broken = self.folder / "broken.gt3x"
        broken.write_bytes(b"no archive")
        paths = [simulated(), broken]
        answer = sixpoint.scan(paths)
        said = program_json("scan", *paths, expected=(65,))
        self.assertEqual(without_time(said), answer.document)
        self.assertEqual(fields_of(answer.files[0]), set(said["files"][0]))
        self.assertEqual([file.verdict for file in answer.files], ["affected", "unreadable"])
        self.assertEqual(answer.summary["affected"], 1)

    def test_scan_of_real_affected_files(self):
        folder = real("wgt3x-bt-affected")
        answer = sixpoint.scan(folder, jobs=1)
        self.assertEqual([file.verdict for file in answer.files], ["affected", "affected"])
        said = program_json("scan", folder, expected=(1,))
        self.assertEqual(without_time(said), answer.document)

    def test_solve(self):
        answer = sixpoint.solve(simulated())
        said = program_json("solve", simulated(), expected=(0, 1))
        ours = dict(answer.document)
        del ours["seconds"]
        self.assertEqual(without_time(said), ours)
        self.assertLessEqual(fields_of(answer), set(answer.document))
        self.assertEqual(answer.verified, said["verified"])

    def test_solve_has_the_notes_of_the_command(self):
        legacy = simulated(firmware="1.3.0")
        notes = sixpoint.solve(legacy).document["notes"]
        self.assertTrue(any("legacy configuration" in note for note in notes), notes)
        self.assertEqual(notes, program_json("solve", legacy, expected=(0, 1))["notes"])

    def test_solve_by_local_gravity(self):
        for ours, theirs in (
            ({"gravity": 9.81}, ("--gravity", "9.81")),
            ({"latitude": 48.1, "altitude": 520.0}, ("--latitude", "48.1", "--altitude", "520")),
            ({"latitude": -33.9}, ("--latitude", "-33.9")),
        ):
            answer = sixpoint.solve(simulated(), **ours)
            said = program_json("solve", simulated(), *theirs, expected=(0, 1))
            self.assertNotEqual(answer.gravity_m_per_s2, 9.80665)
            self.assertEqual(answer.gravity_m_per_s2, said["gravity_m_per_s2"])
            self.assertEqual(answer.constants, said["constants"])

    def test_repair_links_what_needs_no_repair(self):
        sixpoint.repair(simulated(), self.folder / "first", scan=True)
        repaired = self.folder / "first" / simulated().name
        for kind in ("hard", "symbolic"):
            out = self.folder / kind
            answer = sixpoint.repair(repaired, out, scan=True, link_unaffected=kind)
            self.assertEqual(answer.files[0].status, "already_repaired")
            linked = pathlib.Path(answer.files[0].linked)
            self.assertTrue(linked.samefile(repaired))
            self.assertEqual(linked.is_symlink(), kind == "symbolic")

    def test_a_name_that_is_no_utf8(self):
        path = os.fsencode(self.folder) + b"/bad\xff\xfe.gt3x"
        shutil.copy(simulated(), path)
        name = os.fsdecode(path)
        self.assertEqual(sixpoint.inspect(name).serial, sixpoint.inspect(simulated()).serial)
        for paths in (name, path, [name], [path]):
            found = sixpoint.scan(paths).files[0]
            self.assertEqual((found.verdict, found.path), ("affected", name))
        self.assertEqual(sixpoint.solve(name).constants, sixpoint.solve(simulated()).constants)
        self.assertEqual(len(sixpoint.read(name)), len(sixpoint.read(simulated())))
        answer = sixpoint.repair(name, self.folder / "fixed", scan=True)
        self.assertEqual(answer.files[0].status, "repaired")
        self.assertGreater(len(sixpoint.read(answer.files[0].output)), 0)  # the name can be used
        constants = os.fsencode(self.folder) + b"/c\xff.json"
        program("solve", simulated(), "-o", os.fsdecode(constants), expected=(0, 1))
        answer = sixpoint.repair(name, self.folder / "by", constants=os.fsdecode(constants))
        self.assertEqual(answer.files[0].status, "repaired")

    def test_repair(self):
        before = hashlib.sha256(simulated().read_bytes()).hexdigest()
        answer = sixpoint.repair(simulated(), self.folder / "python", scan=True)
        said = program_json("repair", simulated(), "-o", self.folder / "program", "--scan", expected=(0, 1))
        ours = dict(answer.document["files"][0])
        theirs = dict(said["files"][0])
        self.assertEqual(fields_of(answer.files[0]), set(theirs))
        self.assertEqual(answer.files[0].status, "repaired")
        for one in (ours, theirs):  # the marks in the files name when they were made
            one.pop("output_sha256")
            one.pop("output")
            one["source"].pop("made_at")
        self.assertEqual(ours, theirs)
        self.assertEqual(answer.summary, said["summary"])
        output = pathlib.Path(answer.files[0].output)
        self.assertEqual(hashlib.sha256(output.read_bytes()).hexdigest(), answer.files[0].output_sha256)
        self.assertEqual(hashlib.sha256(simulated().read_bytes()).hexdigest(), before)
        repaired = sixpoint.read(output)
        self.assertTrue(repaired.inspection.already_repaired)
        self.assertLess(answer.files[0].still_error_mg["after"], answer.files[0].still_error_mg["before"])

    def test_a_dry_run_writes_nothing(self):
        answer = sixpoint.repair([simulated()], self.folder / "none", scan=True, dry_run=True)
        self.assertEqual(answer.files[0].status, "repaired")
        self.assertFalse((self.folder / "none").exists())

    def test_two_inputs_of_one_name_are_refused(self):
        copy = self.folder / "a" / simulated().name
        copy.parent.mkdir()
        copy.write_bytes(simulated().read_bytes())
        answer = sixpoint.repair([simulated(), copy], self.folder / "out", scan=True, dry_run=True)
        self.assertEqual([file.status for file in answer.files], ["repaired", "failed"])

    def test_answers_can_be_pickled(self):
        answer = sixpoint.scan(simulated())
        self.assertEqual(pickle.loads(pickle.dumps(answer)), answer)
