"""Bad input gives exceptions with code and hint; Ctrl-C ends a call."""

import os
import pathlib
import pickle
import random
import signal
import subprocess
import sys
import threading
import time
import zipfile

import sixpoint

from made import SOURCE, START, InFolder, packed, record, samples_of, simulated, small, write_recording


class BadInput(InFolder):
    def assert_refused(self, path, kind):
        for call in (sixpoint.read, lambda p: list(sixpoint.stream(p)), sixpoint.inspect, sixpoint.solve):
            with self.assertRaises(kind) as raised:
                call(path)
            self.assertTrue(raised.exception.what)
            self.assertTrue(raised.exception.hint, raised.exception)
        self.assertEqual(sixpoint.scan(path).files[0].verdict, "unreadable")

    def test_no_such_file(self):
        self.assert_refused(self.folder / "nowhere.gt3x", sixpoint.NoInputError)
        with self.assertRaises(FileNotFoundError) as raised:
            sixpoint.read(self.folder / "nowhere.gt3x")
        self.assertEqual(raised.exception.code, "no_input")
        again = pickle.loads(pickle.dumps(raised.exception))
        self.assertEqual((again.code, again.hint), (raised.exception.code, raised.exception.hint))

    def test_a_name_that_is_no_utf8(self):
        missing = os.fsencode(self.folder) + b"/no\xff.gt3x"
        damaged = os.fsencode(self.folder) + b"/cut\xff.gt3x"
        with open(damaged, "wb") as file:
            file.write(b"no archive")
        for name, kind in ((missing, sixpoint.NoInputError), (damaged, sixpoint.BadDataError)):
            for path in (name, os.fsdecode(name)):
                self.assert_refused(path, kind)
                with self.assertRaises(kind) as raised:
                    sixpoint.read(path)
                self.assertEqual(raised.exception.where, os.fsdecode(name))
                str(raised.exception).encode()  # can be printed
        with self.assertRaises(sixpoint.SixpointError):
            sixpoint.repair(simulated(), os.fsdecode(damaged), scan=True)
        with self.assertRaises(sixpoint.NoInputError):
            sixpoint.repair(simulated(), self.folder / "out", constants=os.fsdecode(missing))

    def test_no_archive_and_a_cut_one(self):
        path = self.folder / "a.gt3x"
        path.write_bytes(b"")
        self.assert_refused(path, sixpoint.BadDataError)
        path.write_bytes(simulated().read_bytes()[:5000])
        self.assert_refused(path, sixpoint.BadDataError)

    def test_no_rate(self):
        path = write_recording(self.folder / "a.gt3x", record(0, START, packed(samples_of(0))), "Serial Number: X\r\n")
        with self.assertRaises(sixpoint.BadDataError):
            sixpoint.read(path)

    def test_the_conformance_suite(self):
        """Every file of the project's suite: rows, or an exception of the package."""
        subprocess.run([sys.executable, SOURCE / "tests/gt3x/conformance/make.py", "suite"], check=True)
        read = refused = 0
        for path in sorted(pathlib.Path("suite").rglob("*")):
            if path.suffix not in (".gt3x", ".agdc"):
                continue
            for fill in ("vendor", "none"):
                try:
                    read += len(sixpoint.read(path, fill=fill)) > 0
                except sixpoint.SixpointError as error:
                    refused += 1
                    self.assertTrue(error.what and error.hint, path)
        self.assertGreater(read, 10)
        self.assertGreater(refused, 10)

    def test_bytes_changed_at_random(self):
        good = small(self.folder).read_bytes()
        path = self.folder / "changed.gt3x"
        order = random.Random(20140324)
        outcomes = set()
        for _ in range(300):
            changed = bytearray(good)
            for _ in range(order.randint(1, 8)):
                changed[order.randrange(len(changed))] = order.randrange(256)
            path.write_bytes(changed[: order.choice((len(good), order.randrange(len(good))))])
            try:
                sixpoint.read(path, salvage=order.random() < 0.5)
                outcomes.add("read")
            except sixpoint.SixpointError:
                outcomes.add("refused")
        self.assertEqual(outcomes, {"read", "refused"})

    def test_salvage_says_what_was_lost(self):
        path = self.folder / "a.gt3x"
        log = b"".join(record(0, START + s, packed(samples_of(s))) for s in range(20))
        write_recording(path, log, method=zipfile.ZIP_STORED)
        bytes_ = bytearray(path.read_bytes())
        bytes_[500] ^= 0xFF
        path.write_bytes(bytes_)
        with self.assertRaises(sixpoint.BadDataError):
            sixpoint.read(path)
        recording = sixpoint.read(path, salvage=True)
        self.assertGreater(len(recording), 0)
        self.assertTrue(recording.damage["salvaged"])

    def test_arguments(self):
        path = small(self.folder)
        for wrong in ({"unit": "m/s2"}, {"fill": "zeros"}, {"dtype": "int8"}):
            with self.assertRaises(sixpoint.UsageError):
                sixpoint.read(path, **wrong)
        with self.assertRaises(ValueError):
            sixpoint.solve(path, method="guess")
        with self.assertRaises(ValueError):
            sixpoint.stream(path, rows=0)
        for call in (
            lambda: sixpoint.stream(path, rows=2**70),
            lambda: sixpoint.read(path, fill_limit_s=2**70),
            lambda: sixpoint.scan(path, jobs=2**70),
            lambda: sixpoint.scan(path, jobs=2**32),
            lambda: sixpoint.scan(path, jobs=-1),
            lambda: sixpoint.solve(path, seed=2**70),
            lambda: sixpoint.solve(path, prior="another"),
            lambda: sixpoint.solve(path, altitude=500.0),
            lambda: sixpoint.solve(path, gravity=1.62),
            lambda: sixpoint.repair(path, self.folder / "out", link_unaffected="soft"),
            lambda: sixpoint.repair(path, self.folder / "out", scan=True, store=""),
            lambda: sixpoint.scan(path, store=""),
        ):
            with self.assertRaises(sixpoint.UsageError):
                call()
        for call in (lambda: sixpoint.stream(path, rows=1.5), lambda: sixpoint.read(path, fill_limit_s=1e9)):
            with self.assertRaises(TypeError):
                call()
        cut = f"{path}\0b"  # must not read what stands before the zero byte
        for name, use in (
            ("read", sixpoint.read),
            ("inspect", sixpoint.inspect),
            ("scan", lambda each: sixpoint.scan([each])),
            ("solve", sixpoint.solve),
            ("repair", lambda each: sixpoint.repair(path, each)),
        ):
            with self.subTest(name), self.assertRaises(ValueError):
                use(cut)

    def test_an_output_that_is_there(self):
        out = self.folder / "out"
        sixpoint.repair(simulated(), out, scan=True)
        again = sixpoint.repair(simulated(), out, scan=True)
        self.assertEqual(again.files[0].status, "failed")
        self.assertEqual(sixpoint.repair(simulated(), out, scan=True, resume=True).files[0].status, "repaired")


class Interrupt(InFolder):
    """A call that is repeated for ever ends with KeyboardInterrupt, and nothing else ends it."""

    def interrupted(self, call, *arguments):
        # The package loads its parts when they are first named; an interrupt in numpy's import is lost there.
        code = (
            "import sys, sixpoint\n"
            "sixpoint.read, sixpoint.scan, sixpoint.repair\n"
            "try:\n"
            "    print('begins', flush=True)\n"
            f"    while True: {call}\n"
            "except KeyboardInterrupt:\n"
            "    print('interrupted')\n"
        )
        child = subprocess.Popen(
            [sys.executable, "-c", code, *map(str, arguments)], stdout=subprocess.PIPE, text=True
        )
        self.assertEqual(child.stdout.readline(), "begins\n")
        time.sleep(0.2)
        child.send_signal(signal.SIGINT)
        out, _ = child.communicate(timeout=60)
        self.assertEqual(out, "interrupted\n")

    def long_recording(self):
        """Two seconds, 390 days apart: filling them would take minutes."""
        return small(self.folder, seconds=(0, 390 * 86_400))

    def test_read(self):
        self.interrupted(
            "sixpoint.read(sys.argv[1], unit='lsb', fill_limit_s=400 * 86400)", self.long_recording()
        )

    def test_scan_and_repair(self):
        for call in ("sixpoint.scan(sys.argv[1:])", "sixpoint.repair(sys.argv[1:], 'o', scan=True, dry_run=True)"):
            self.interrupted(call, simulated(), simulated())

    def test_repair_leaves_nothing_half_written(self):
        out = self.folder / "out"
        self.interrupted(
            "sixpoint.repair(sys.argv[1], sys.argv[2], scan=True, redo_outdated=True, wide=True)", simulated(), out
        )
        for left in out.glob("*"):
            if left.name == ".sixpoint-repair.lock":  # of one run at a time (docs/repair.md)
                continue
            self.assertEqual(left.suffix, ".gt3x", left)
            sixpoint.read(left)

    def test_other_threads_go_on_while_a_file_is_read(self):
        done = threading.Event()
        steps = 0

        def count():
            nonlocal steps
            while not done.is_set():
                steps += 1
                time.sleep(0)

        thread = threading.Thread(target=count)
        thread.start()
        before = steps
        sixpoint.read(self.long_recording(), unit="lsb", fill_limit_s=400 * 86_400)
        after = steps
        done.set()
        thread.join()
        self.assertGreater(after - before, 10)
