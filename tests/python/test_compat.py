"""FileReader as pygt3x documents it. The oracle is the format: records read here, byte by byte."""

import struct
import unittest
import zipfile

import numpy as np
import sixpoint
from sixpoint.compat.pygt3x import FileReader

from made import INFO, InFolder, many_gaps, packed, real, record, samples_of, small, write_recording

START = 1_428_588_240


def records_of(path):
    with zipfile.ZipFile(path) as archive:
        log = archive.read("log.bin")
    at = 0
    while at + 8 < len(log):
        if log[at] != 0x1E:
            at += 1
            continue
        _, kind, time, size = struct.unpack_from("<BBLH", log, at)
        yield kind, time, log[at + 8 : at + 8 + size]
        at += 9 + size


def unpacked(payload):
    nibbles = np.array([n for byte in payload for n in (byte >> 4, byte & 15)])
    count = len(nibbles) // 9 * 3
    values = nibbles[: count * 3].reshape(-1, 3) @ [256, 16, 1]
    values = np.where(values > 2047, values - 4096, values)
    return values.reshape(-1, 3)[:, [1, 0, 2]]


def expected_frame(path, rate, scale):
    """What pygt3x says it does: seconds of samples; idle sleep filled with the last sample."""
    times, rows, asleep = [], [], []
    last_time = last_row = None
    slept = False
    for kind, time, payload in records_of(path):
        if kind == 3 and payload == b"\x08":
            slept = True
        if kind in (0, 26) and len(payload) > 1:
            samples = unpacked(payload) if kind == 0 else np.frombuffer(payload, "<i2").reshape(-1, 3)
            if slept and last_time is not None:
                for second in range(last_time + 1, time):
                    times.append(second + np.arange(rate) / rate)
                    rows.append(np.repeat([last_row], rate, axis=0))
                    asleep += [True] * rate
            slept = False
            times.append(time + np.arange(len(samples)) / rate)
            rows.append(samples)
            asleep += [False] * len(samples)
            last_time, last_row = time, samples[-1]
    return np.concatenate(times), np.concatenate(rows) / scale, np.array(asleep)


class Drop(InFolder):
    def test_gives_columns_index_and_types(self):
        with FileReader(small(self.folder, seconds=(0, 1))) as reader:
            frame = reader.to_pandas()
            self.assertEqual(list(frame.columns), ["X", "Y", "Z", "IdleSleepMode"])
            self.assertEqual(frame.index.name, "Timestamp")
            self.assertEqual(frame.index.dtype, np.float64)
            self.assertEqual({str(t) for t in frame.dtypes}, {"float32", "bool"})
            self.assertEqual(reader.info.sample_rate, 30)
            self.assertEqual(reader.info.acceleration_scale, 256.0)
            self.assertEqual(reader.info.timezone, "-04:00:00")
            self.assertEqual(reader.acceleration.shape, (60, 5))
            self.assertEqual(reader.acceleration[30, 0], START + 1)
            np.testing.assert_array_equal(reader.to_pandas(calibrate=False)[["X", "Y", "Z"]], reader.acceleration[:, 1:4])

    def test_does_not_fill_what_no_event_explains(self):
        with FileReader(small(self.folder)) as reader:
            frame = reader.to_pandas()
        self.assertEqual(len(frame), 5 * 30)
        self.assertNotIn(START + 3, frame.index)
        self.assertEqual(frame.index[90], START + 5)

    def of_seconds(self, *pieces):
        """The frame of seconds from START on; "asleep" is an EVENT. The seconds of its rows, and of its sleep."""
        log, last = b"", 0
        for second in (second for piece in pieces for second in piece):
            if second == "asleep":
                log += record(3, START + last, b"\x08")
                continue
            log += record(0, START + second, packed(samples_of(second % 2000)))
            last = second
        with FileReader(write_recording(self.folder / "clock.gt3x", log)) as reader:
            frame = reader.to_pandas()
        seconds = (frame.index.to_numpy() // 1).astype(int)[::30] - START
        return list(seconds), list(seconds[frame["IdleSleepMode"].to_numpy()[::30]])

    def test_keeps_what_was_recorded_where_the_clock_was_set_back(self):
        rows, asleep = self.of_seconds(range(7200, 7500), range(120), range(180, 240))
        self.assertEqual(rows, [*range(7200, 7500), *range(120), *range(180, 240)])
        self.assertEqual(asleep, [])
        rows, asleep = self.of_seconds(range(7200, 7500), range(120), ["asleep"], range(180, 240))
        self.assertEqual(rows, [*range(7200, 7500), *range(240)])
        self.assertEqual(asleep, [*range(120, 180)])

    def test_keeps_what_was_recorded_in_a_gap_after_the_clock_came_back(self):
        rows, _ = self.of_seconds(range(10), range(7200, 7220), range(10, 40))
        self.assertEqual(rows, [*range(10), *range(7200, 7220), *range(10, 40)])

    def test_takes_lines_of_info_that_are_blank(self):
        info = INFO.replace("Rate: 30", "Rate: 30.0") + "Age: \r\nHeight: tall\r\nDownload Date: \r\nStop Date: \r\n"
        path = write_recording(self.folder / "blank.gt3x", record(0, START, packed(samples_of(0))), info)
        with FileReader(path) as reader:
            self.assertEqual((reader.info.age, reader.info.height, reader.info.download_date), (None, None, None))
            self.assertEqual((reader.info.stop_date, reader.info.start_date), (0, 635_641_850_400_000_000))
            self.assertEqual(reader.info.sample_rate, 30)
            self.assertIsInstance(reader.info.sample_rate, int)

    def test_reads_what_stands_in_the_archive_as_read_does(self):
        path = small(self.folder, seconds=(0, 1))
        with zipfile.ZipFile(path, "a") as archive:
            archive.writestr("calibration.json", '\ufeff{"isCalibrated": true}')
        with open(path, "ab") as file:
            file.write(bytes(70_000))  # zipfile finds no archive in it
        with FileReader(path) as reader:
            self.assertEqual(len(reader.to_pandas()), 60)
            self.assertEqual(reader.calibration, {"isCalibrated": True})
            self.assertIsNone(reader.temperature_calibration)

    def test_a_calibration_that_is_no_json_is_bad_data(self):
        for i, text in enumerate(("{oops", "[1]", "\xff".encode("latin-1"), "[" * 100_000)):
            path = small(self.folder, seconds=(0, 1)).rename(self.folder / f"{i}.gt3x")
            with zipfile.ZipFile(path, "a") as archive:
                archive.writestr("temperature_calibration.json", text)
            with self.assertRaisesRegex(sixpoint.BadDataError, "temperature_calibration.json is no JSON"):
                FileReader(path).__enter__()

    def test_refuses_more_gaps_than_are_listed(self):
        with self.assertRaisesRegex(sixpoint.BadDataError, "more than 10000 gaps"):
            FileReader(many_gaps(self.folder)).__enter__()


class Real(unittest.TestCase):
    def assert_frame(self, name, rate, scale):
        path = real(name)
        with FileReader(path) as reader:
            frame = reader.to_pandas()
            slept = reader.idle_sleep_mode_activated
        times, rows, asleep = expected_frame(path, rate, scale)
        np.testing.assert_array_equal(frame.index.to_numpy()[: len(times)], times)
        np.testing.assert_array_equal(frame[["X", "Y", "Z"]].to_numpy()[: len(times)], rows.astype(np.float32))
        np.testing.assert_array_equal(frame["IdleSleepMode"].to_numpy()[: len(times)], asleep)
        # Behind the last record: idle sleep up to the file's Last Sample Time.
        self.assertTrue(frame["IdleSleepMode"].iloc[len(times) :].all())
        self.assertEqual(slept, bool(frame["IdleSleepMode"].any()))
        return slept

    def test_idle_sleep(self):
        self.assertTrue(self.assert_frame("idle-sleep/ISM_Enabled.gt3x", 30, 256.0))
        self.assertFalse(self.assert_frame("idle-sleep/ISM_Disabled.gt3x", 30, 256.0))

    def test_its_own_test_of_idle_sleep(self):
        """As pygt3x's tests say: asleep or awake, the two have the same index."""
        with FileReader(real("idle-sleep/ISM_Enabled.gt3x")) as reader:
            enabled = reader.to_pandas()
        with FileReader(real("idle-sleep/ISM_Disabled.gt3x")) as reader:
            disabled = reader.to_pandas()
        asleep = enabled.loc[1616169537:1616169574, "X"]
        self.assertTrue((asleep == asleep.iloc[0]).all())
        self.assertTrue((enabled.index[: len(disabled)] == disabled.index).all())

    def test_gt9x_and_bt(self):
        self.assert_frame("gt9x/TAS1H30182785_2019-09-17.gt3x", 100, 256.0)
        self.assert_frame("wgt3x-bt/MOS2E39180594.gt3x", 30, 256.0)

    def test_agdc_is_calibrated(self):
        path = real("agdc/WRIST_rawLSB_032Hz_test.agdc")
        csv = real("agdc/WRIST_rawCalibrated_032Hz.csv")
        with FileReader(path) as reader:
            frame = reader.to_pandas()
            self.assertIsNotNone(reader.calibration)
        with open(csv) as file:
            lines = [line.strip().split(",") for line in file]
        numbers = []
        for line in lines:
            try:
                numbers.append([float(value) for value in line[-3:]])
            except ValueError:
                continue
        expected = np.array(numbers)
        count = min(len(expected), len(frame))
        self.assertGreater(count, 1000)
        np.testing.assert_allclose(frame[["X", "Y", "Z"]].to_numpy()[:count], expected[:count], atol=0.0006)

    def test_nhanes_is_rounded(self):
        with FileReader(real("nhanes/NEO1B34100019.gt3x")) as reader:
            frame = reader.to_pandas()
            self.assertTrue(reader.nhanes)
        mg = frame[["X", "Y", "Z"]].to_numpy().astype(float) * 1000
        np.testing.assert_allclose(mg, np.rint(mg), atol=1e-3)
        self.assertEqual(len(frame), 10_467)
