"""read() and stream(): against files made here, the program's exports, and the vendor's."""

import concurrent.futures
import gzip
import multiprocessing
import pickle
import subprocess
import sys
import threading
import unittest

import numpy as np
import sixpoint

from made import (
    INFO, START, InFolder, packed, program, program_json, real, record, samples_of, simulated, small,
    write_recording,
)


class Small(InFolder):
    def test_gives_stored_counts_and_g(self):
        path = small(self.folder, seconds=(0, 1))
        lsb = sixpoint.read(path, unit="lsb")
        expected = np.array(samples_of(0) + samples_of(1), dtype=np.int16)
        self.assertEqual(lsb.acceleration.dtype, np.int16)
        np.testing.assert_array_equal(lsb.acceleration, expected)
        g = sixpoint.read(path)
        self.assertEqual(g.acceleration.dtype, np.float64)
        np.testing.assert_array_equal(g.acceleration, expected / 256)
        self.assertEqual(sixpoint.read(path, dtype="float32").acceleration.dtype, np.float32)

    def test_reads_beside_a_name_that_is_no_utf8(self):
        info = (INFO + "Subject Name: Andr\xe9\r\n").encode("latin-1")
        log = record(0, START, packed(samples_of(0)))
        recording = sixpoint.read(write_recording(self.folder / "latin.gt3x", log, info))
        self.assertEqual(len(recording), 30)
        self.assertTrue(recording.info["Subject Name"].startswith("Andr"))

    def test_takes_the_first_line_of_a_key(self):
        log = record(0, START, packed(samples_of(0)))
        path = write_recording(self.folder / "twice.gt3x", log, INFO + "TimeZone: 01:00:00\r\n")
        self.assertEqual(sixpoint.read(path).info["TimeZone"], "-04:00:00")

    def test_tells_the_time_of_each_sample(self):
        recording = sixpoint.read(small(self.folder))
        self.assertEqual(len(recording), 7 * 30)
        self.assertEqual(recording.time.dtype, np.dtype("datetime64[ns]"))
        start = np.datetime64(START, "s")
        np.testing.assert_array_equal(
            recording.time[::30], start + np.arange(7).astype("timedelta64[s]")
        )
        self.assertEqual(recording.time[1] - recording.time[0], np.timedelta64(33_333_333, "ns"))
        self.assertIn(recording.clock.kind, ("local", "utc", "unknown"))
        self.assertTrue(recording.clock.why)

    def test_fills_as_the_vendor_does_or_not_at_all(self):
        path = small(self.folder)
        filled = sixpoint.read(path, unit="lsb")
        np.testing.assert_array_equal(filled.acceleration[90:150], [samples_of(2)[-1]] * 60)
        bare = sixpoint.read(path, unit="lsb", fill="none")
        self.assertEqual(len(bare), 5 * 30)
        self.assertEqual(bare.time[90], np.datetime64(START + 5, "s"))
        for recording in (filled, bare):
            self.assertEqual([(gap.seconds, gap.kind) for gap in recording.gaps], [(2, "unexplained")])
            self.assertEqual(recording.gaps_unix(), [(START + 3, 2, "unexplained")])
        self.assertEqual(len(sixpoint.read(path, fill_limit_s=1)), 5 * 30)
        with self.assertRaises(sixpoint.UsageError):
            sixpoint.read(path, fill_limit_s=-1)

    def test_outlives_its_file(self):
        path = small(self.folder)
        recording = sixpoint.read(path)
        acceleration, time = recording.acceleration, recording.time
        path.unlink()
        self.assertEqual(recording.records, {"ACTIVITY": 5})
        self.assertEqual(len(recording.time), len(acceleration))
        del recording
        self.assertEqual(acceleration[0, 2], 1.0)
        self.assertEqual(time[0], np.datetime64(START, "s"))

    def test_can_be_pickled_and_read_by_other_processes(self):
        path = small(self.folder)
        here = sixpoint.read(path, fill="none")
        workers = multiprocessing.get_context("spawn")
        with concurrent.futures.ProcessPoolExecutor(1, mp_context=workers) as pool:
            there = pool.submit(sixpoint.read, path, fill="none").result()
        used = pickle.dumps(here)
        self.assertLess(len(used), here.acceleration.nbytes + 20_000)
        path.unlink()
        for other in (there, pickle.loads(used)):
            np.testing.assert_array_equal(other.acceleration, here.acceleration)
            np.testing.assert_array_equal(other.time, here.time)
            self.assertEqual(other.gaps_unix(), here.gaps_unix())
            self.assertEqual(other.inspection, here.inspection)
            self.assertEqual((other.info, other.path), (here.info, str(path)))

    def test_streams_the_same_rows(self):
        path = small(self.folder)
        whole = sixpoint.read(path)
        for rows in (1, 7, 64, 1000):
            blocks = list(sixpoint.stream(path, rows=rows))
            np.testing.assert_array_equal(
                np.concatenate([block.acceleration for block in blocks]), whole.acceleration
            )
            np.testing.assert_array_equal(
                np.concatenate([block.time for block in blocks]), whole.time
            )
            self.assertEqual([block.first_row for block in blocks][:2][-1], min(rows, 210) if len(blocks) > 1 else 0)

    def test_two_threads_read_at_once(self):
        paths = [small(self.folder), simulated()]
        expected = [sixpoint.read(path).acceleration for path in paths]
        got = [None] * 8

        def work(i):
            got[i] = sixpoint.read(paths[i % 2]).acceleration

        threads = [threading.Thread(target=work, args=(i,)) for i in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for i, rows in enumerate(got):
            np.testing.assert_array_equal(rows, expected[i % 2])

    def test_to_pandas(self):
        recording = sixpoint.read(small(self.folder))
        frame = recording.to_pandas()
        self.assertEqual(list(frame.columns), ["X", "Y", "Z"])
        self.assertEqual(frame.index.name, "time")
        np.testing.assert_array_equal(frame.to_numpy(), recording.acceleration)
        np.testing.assert_array_equal(
            frame.index.tz_localize(None).to_numpy(), recording.time
        )

    def test_refuses_what_takes_more_memory_than_there_is(self):
        # Two seconds, 300 days apart: 600 GB at 1000 Hz.
        log = b"".join(record(0, START + s, packed(samples_of(0))) for s in (0, 300 * 86_400))
        path = write_recording(self.folder / "a.gt3x", log, INFO.replace("Rate: 30", "Rate: 1000"))
        with self.assertRaises(sixpoint.OutputError) as raised:
            sixpoint.read(path, fill_limit_s=400 * 86_400)
        self.assertIn("blocks", raised.exception.hint)
        self.assertEqual(len(next(sixpoint.stream(path, fill_limit_s=400 * 86_400))), 1_000_000)


class AgainstTheProgram(InFolder):
    def assert_facts_of_inspect(self, path, recording):
        """The keys that a reading has, with the values that inspect says."""
        said = program_json("inspect", path)
        for key in ("form", "serial", "firmware", "model", "sample_rate_hz", "clock", "start",
                    "samples", "records", "constants", "calibration_time", "gaps", "gap_count",
                    "gap_seconds", "checksum_failures", "damage", "filter", "entries",
                    "accel_scale_lsb_per_g", "already_repaired", "irregular", "duration_s"):
            self.assertEqual(recording.inspection.document[key], said[key], (path, key))

    def assert_rows_of_export(self, path):
        program("export", path, "--csv", "e.npy", "--format", "npy", "--force")
        program("export", path, "--csv", "r.npy", "--format", "npy", "--raw", "--force")
        g = sixpoint.read(path, dtype="float32")
        np.testing.assert_array_equal(g.acceleration, np.load("e.npy"))
        np.testing.assert_array_equal(sixpoint.read(path, unit="lsb").acceleration, np.load("r.npy"))
        program("export", path, "--csv", "n.npy", "--format", "npy", "--raw", "--no-fill", "--force")
        np.testing.assert_array_equal(
            sixpoint.read(path, unit="lsb", fill="none").acceleration, np.load("n.npy")
        )
        self.assert_facts_of_inspect(path, g)

    def test_simulated(self):
        self.assert_rows_of_export(simulated())

    def test_real_recordings(self):
        for name in ("wgt3x-bt-affected/MOS2A45130451.gt3x", "wgt3x-bt/MOS2E39180594.gt3x",
                     "gt9x/TAS1H30182785_2019-09-17.gt3x", "gt9x/TAS1E31150129.gt3x",
                     "nhanes/NEO1B34100019.gt3x", "agdc/WRIST_rawLSB_032Hz_test.agdc",
                     "idle-sleep/ISM_Enabled.gt3x"):
            with self.subTest(name):
                self.assert_rows_of_export(real(name))

    def test_times_are_those_of_the_export(self):
        path = simulated()
        program("export", path, "--csv", "t.csv", "--unix", "--force")
        stamps = np.loadtxt("t.csv", delimiter=",", skiprows=11, usecols=0)
        times = sixpoint.read(path).time.view("int64")
        np.testing.assert_array_equal(np.rint(stamps * 1000), times // 1_000_000)


class AgainstTheVendor(unittest.TestCase):
    """The vendor's own CSV of a recording: three decimals, half-way cases away from zero."""

    def test_gt9x_with_idle_sleep(self):
        path = real("gt9x/TAS1H30182785_2019-09-17.gt3x")
        with gzip.open(real("gt9x/TAS1H30182785_2019-09-17.csv.gz"), "rt") as file:
            vendor = np.loadtxt(file, delimiter=",", skiprows=11)
        ours = sixpoint.read(path).acceleration
        self.assertEqual(len(ours), len(vendor))
        mg = np.floor(np.abs(ours) * 1000 + 0.5 + 1e-9) * np.sign(ours)
        np.testing.assert_array_equal(mg, np.rint(vendor[:, -3:] * 1000))


class Import(unittest.TestCase):
    def test_loads_neither_numpy_nor_pandas(self):
        code = "import sys, sixpoint; print([m for m in ('numpy', 'pandas') if m in sys.modules])"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        self.assertEqual(done.stdout.strip(), "[]")

    def test_has_the_version_of_the_program(self):
        self.assertIn(sixpoint.__version__, program("--version"))

    def test_lists_what_it_has(self):
        for name in sixpoint.__all__:
            self.assertIsNotNone(getattr(sixpoint, name), name)
        self.assertEqual(set(dir(sixpoint)), set(sixpoint.__all__))


if __name__ == "__main__":
    unittest.main()
