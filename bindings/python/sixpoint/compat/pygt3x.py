"""``FileReader`` with the interface of pygt3x, on top of Sixpoint's reader.

>>> from sixpoint.compat.pygt3x import FileReader
>>> with FileReader("unit.gt3x") as reader:         # doctest: +SKIP
...     frame = reader.to_pandas()

A script changes its import line and nothing else. docs/python.md lists where the answers differ
from pygt3x's, and why.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np

from .. import _core
from .._errors import BadDataError
from .._paths import as_bytes
from .._recording import Recording, read

if TYPE_CHECKING:
    import pandas
    from numpy.typing import NDArray


# A line that is missing, blank or no number is None.
def _number(text: Optional[str]) -> Optional[float]:
    try:
        return float((text or "").replace(",", "."))
    except ValueError:
        return None


def _ticks(text: Optional[str]) -> Optional[int]:
    try:
        return int(text or "")
    except ValueError:
        return None


@dataclass
class Info:
    """The lines of info.txt by pygt3x's names; dates are .NET ticks (100 ns since 0001-01-01)."""

    acceleration_max: float
    acceleration_min: float
    acceleration_scale: float
    age: Optional[float]
    battery_voltage: float
    board_revision: Optional[str]
    device_type: Optional[str]
    dominance: Optional[str]
    download_date: Optional[int]
    firmware: Optional[str]
    height: Optional[float]
    last_sample_time: int
    limb: Optional[str]
    mass: Optional[str]
    race: Optional[str]
    sample_rate: int
    serial_number: Optional[str]
    sex: Optional[str]
    side: Optional[str]
    start_date: int
    stop_date: int
    subject_name: Optional[str]
    timezone: Optional[str]
    unexpected_resets: Union[str, int]

    @staticmethod
    def of(lines: dict[str, str]) -> Info:
        """Make it from the lines of info.txt."""
        get = lines.get
        return Info(
            acceleration_max=_number(get("Acceleration Max")) or 0.0,
            acceleration_min=_number(get("Acceleration Min")) or 0.0,
            acceleration_scale=_number(get("Acceleration Scale")) or 0.0,
            age=_number(get("Age")),
            battery_voltage=_number(get("Battery Voltage")) or 0.0,
            board_revision=get("Board Revision"),
            device_type=get("Device Type"),
            dominance=get("Dominance"),
            download_date=_ticks(get("Download Date")),
            firmware=get("Firmware"),
            height=_number(get("Height")),
            last_sample_time=_ticks(get("Last Sample Time")) or 0,
            limb=get("Limb"),
            mass=get("Mass"),
            race=get("Race"),
            sample_rate=round(_number(get("Sample Rate")) or 0),
            serial_number=get("Serial Number"),
            sex=get("Sex"),
            side=get("Side"),
            start_date=_ticks(get("Start Date")) or 0,
            stop_date=_ticks(get("Stop Date")) or 0,
            subject_name=get("Subject Name"),
            timezone=get("TimeZone"),
            unexpected_resets=get("Unexpected Resets", 0),
        )


class FileReader:
    """Read a .gt3x or .agdc file; the file is read when the ``with`` block is entered.

    Parameters
    ----------
    file_name : path-like
        The recording.
    num_rows : int, optional
        Not supported: pygt3x stops after so many records of the log.

    Attributes
    ----------
    info : Info
        The lines of info.txt.
    acceleration : numpy.ndarray, shape (n, 5)
        Unix time in s, X, Y, Z as stored counts, and 1 where the unit slept;
        made at every use, from the file.
    calibration : dict or None
        calibration.json of an .agdc file.
    temperature_calibration : dict or None
        temperature_calibration.json of an .agdc file.
    idle_sleep_mode_activated : bool or None
        Whether the recording has periods of idle sleep.
    """

    def __init__(
        self, file_name: Union[str, "os.PathLike[str]"], num_rows: Optional[int] = None
    ) -> None:
        if num_rows is not None:
            raise NotImplementedError("num_rows is not supported; use sixpoint.stream()")
        self.file_name = file_name
        self.nhanes: Optional[bool] = None
        self.idle_sleep_mode_activated: Optional[bool] = None
        self.calibration: Optional[dict[str, Any]] = None
        self.temperature_calibration: Optional[dict[str, Any]] = None
        self._recording: Optional[Recording] = None

    def __enter__(self) -> FileReader:
        recording = read(self.file_name, unit="g", dtype="float32")
        listed = len(recording.gaps)
        if recording.inspection.gap_count > listed:
            # Which rows behind them are no samples is not known.
            raise BadDataError(
                "bad_data",
                f"the recording has more than {listed} gaps",
                recording.path,
                "use sixpoint.read() with fill='none'",
            )
        self._recording = recording
        self.info = Info.of(recording.info)
        self.nhanes = recording.inspection.form == "gt3x_old"
        self.calibration = self._json("calibration.json")
        self.temperature_calibration = self._json("temperature_calibration.json")
        kept, self._asleep = _rows_of_pygt3x(recording)
        self._kept = kept
        self.idle_sleep_mode_activated = any(gap.kind == "idle_sleep" for gap in recording.gaps)
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is open any more."""

    def _json(self, name: str) -> Optional[dict[str, Any]]:
        text = _core.entry(as_bytes(self.file_name), name)
        if text is None:
            return None
        try:
            found = json.loads(text)
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict):
            raise BadDataError(
                "bad_data",
                f"{name} is no JSON object",
                os.fsdecode(self.file_name),
                "read the samples with sixpoint.read()",
            )
        return found

    @property
    def acceleration(self) -> NDArray[np.float64]:
        assert self._recording is not None, "open it in a with statement"
        rows = np.empty((int(np.count_nonzero(self._kept)), 5))
        rows[:, 0] = self._timestamps()
        rows[:, 1:4] = read(self.file_name, unit="lsb").acceleration[self._kept]
        rows[:, 4] = self._asleep[self._kept]
        return rows

    def _timestamps(self) -> NDArray[np.float64]:
        """Unix time in s: the second as the file has it, plus k / rate."""
        assert self._recording is not None
        nanoseconds = self._recording.time.view("int64")[self._kept]
        rate = self._recording.sample_rate_hz
        second, within = np.divmod(nanoseconds, 1_000_000_000)
        return second + np.rint(within * (rate / 1e9)) / rate

    def to_pandas(self, calibrate: bool = True) -> pandas.DataFrame:
        """Return a data frame with columns X, Y, Z, IdleSleepMode and the index Timestamp.

        Parameters
        ----------
        calibrate : bool
            Give X, Y, Z in g, as float32; else as stored counts.

        Returns
        -------
        pandas.DataFrame
            Timestamp is Unix time in s (float64) by the recording's own clock.
        """
        import pandas

        assert self._recording is not None, "open it in a with statement"
        if not calibrate and not self.nhanes:
            values = self.acceleration[:, 1:4].astype(np.float32)
        else:
            values = self._recording.acceleration[self._kept]
            if self.nhanes:
                values = np.round(values.astype(np.float64), 3).astype(np.float32)
        index = pandas.Index(self._timestamps(), name="Timestamp")
        frame = pandas.DataFrame(values, index=index, columns=["X", "Y", "Z"])
        frame["IdleSleepMode"] = self._asleep[self._kept]
        return frame


def _rows_of_pygt3x(recording: Recording) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which rows of a filled recording pygt3x has, and which of them are idle sleep."""
    kept = np.ones(len(recording), dtype=bool)
    asleep = np.zeros(len(recording), dtype=bool)
    if recording.gaps:
        seconds = recording.time.view("int64") // 1_000_000_000
        order = np.argsort(seconds, kind="stable")  # a clock may have been set back
        for begin, length, kind, filled in recording._gaps:
            if not filled:
                continue  # rows of these seconds were recorded, behind a leap of the clock
            first, last = np.searchsorted(seconds, (begin, begin + length), sorter=order)
            if kind == "idle_sleep":
                asleep[order[first:last]] = True
            else:
                kept[order[first:last]] = False
    return kept, asleep
