"""Samples of a recording as numpy arrays."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from . import _core
from ._answers import Clock, Constants, Gap, Inspection
from ._errors import UsageError
from ._paths import Path, as_bytes, whole

if TYPE_CHECKING:
    import pandas
    from numpy.typing import NDArray

Unit = Literal["g", "lsb"]
Fill = Literal["vendor", "none"]

_USUAL_FILL_LIMIT_S = 3600
_MOST = 2**32  # seconds: times of a recording have 32 bits; rows of a block


def _open(
    path: Path, unit: str, fill: str, dtype: str, fill_limit_s: int, salvage: bool
) -> _core.Reading:
    for name, value, known in (
        ("unit", unit, ("g", "lsb")),
        ("fill", fill, ("vendor", "none")),
        ("dtype", dtype, ("float64", "float32")),
    ):
        if value not in known:
            raise UsageError("usage", f"{name}={value!r} is not known", "", f"use one of {known}")
    fill_limit_s = whole("fill_limit_s", fill_limit_s, 0, _MOST)
    return _core.Reading(as_bytes(path), unit, dtype, fill == "vendor", fill_limit_s, salvage)


def _text(value: bytes) -> str:
    return value.decode("utf-8", "replace")


@dataclass(eq=False)
class Recording:
    """A recording in memory; the file may be gone.

    Attributes
    ----------
    path : str
        The file it was read from.
    unit : {"g", "lsb"}
        Unit of `acceleration`.
    fill : {"vendor", "none"}
        Whether missing seconds were filled.
    acceleration : numpy.ndarray, shape (n, 3)
        X, Y, Z. float64 or float32 in g, or int16 in LSB.
    sample_rate_hz : float
        Samples per second.
    info : dict of str to str
        The lines of info.txt.
    inspection : Inspection
        What the file says beside its samples, with the keys of ``sixpoint inspect --json``; without
        still periods and clipped samples, for which `sixpoint.inspect` looks.
    """

    path: str
    unit: Unit
    fill: Fill
    acceleration: NDArray[Any]
    sample_rate_hz: float
    info: dict[str, str]
    inspection: Inspection
    # What times are made from: arrays and numbers, so that a recording can be pickled.
    _runs: NDArray[np.int64] = field(repr=False)
    _rate_hz: int = field(repr=False)
    _gaps: list[tuple[int, int, str, bool]] = field(repr=False)
    _time: NDArray[np.datetime64] | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.acceleration)

    @property
    def time(self) -> NDArray[np.datetime64]:
        """numpy.ndarray of datetime64[ns], shape (n,): when each sample was taken.

        By the recording's own clock, which `clock` names: the wearer's local time or UTC. Made at its
        first use (8 bytes for each sample).
        """
        if self._time is None:
            times = _core.times_of_runs(self._runs, self._rate_hz, len(self.acceleration))
            self._time = times.view("datetime64[ns]")
        return self._time

    @property
    def clock(self) -> Clock:
        """Which clock `time` is by, and why that is known."""
        return self.inspection.clock

    @property
    def serial(self) -> str:
        """Serial number of the unit."""
        return self.inspection.serial

    @property
    def constants(self) -> Constants | None:
        """The nine constants by which the unit scaled its samples (LSB); None where the file has none."""
        return self.inspection.constants

    @property
    def records(self) -> dict[str, int]:
        """How many records of each type the log holds."""
        return self.inspection.records

    @property
    def gaps(self) -> list[Gap]:
        """Where seconds are missing, and why; the first 10 000."""
        return self.inspection.gaps

    def gaps_unix(self) -> list[tuple[int, int, str]]:
        """Return `gaps` as (first missing second, seconds, kind), in Unix time as the file has it."""
        return [(start, seconds, kind) for start, seconds, kind, _ in self._gaps]

    @property
    def damage(self) -> dict[str, Any]:
        """What is damaged: ``stretches``, ``bytes``, ``stray_bytes``, ``losses``,
        ``checksum_failures``; with salvage also ``salvaged``."""
        damage = dict(self.inspection.damage)
        damage["checksum_failures"] = self.inspection.checksum_failures
        damage["salvaged"] = self.inspection.losses
        return damage

    def to_pandas(self) -> pandas.DataFrame:
        """Return a data frame with columns X, Y, Z and the index ``time``.

        Returns
        -------
        pandas.DataFrame
            n rows. The columns share their memory with `acceleration` where pandas allows it. The
            index is without a time zone, because the file's clock is the wearer's, or has the zone
            UTC where the clock is known to show it.
        """
        import pandas

        index = pandas.DatetimeIndex(self.time, name="time")
        if self.clock.kind == "utc":
            index = index.tz_localize("UTC")
        return pandas.DataFrame(self.acceleration, index=index, columns=["X", "Y", "Z"], copy=False)


def read(
    path: Path,
    unit: Unit = "g",
    fill: Fill = "vendor",
    *,
    dtype: Literal["float64", "float32"] = "float64",
    fill_limit_s: int = _USUAL_FILL_LIMIT_S,
    salvage: bool = False,
) -> Recording:
    """Read a .gt3x or .agdc file into memory.

    Parameters
    ----------
    path : path-like
        The recording.
    unit : {"g", "lsb"}
        g: the stored count over the file's scale, not rounded (of .agdc files by their calibration).
        lsb: the stored counts as int16.
    fill : {"vendor", "none"}
        vendor: missing seconds are filled as the vendor's CSV does (the last sample repeated, zeros
        while on USB), so that row n belongs to start + n / rate. none: what was recorded, in the order
        of the file.
    dtype : {"float64", "float32"}
        Type of values in g. A week at 100 Hz takes 1.45 GB or 0.73 GB, and 0.36 GB in LSB.
    fill_limit_s : int
        Seconds that may be missing for no known reason and are still filled.
    salvage : bool
        Read what is left of a damaged file; what was lost is in ``damage["salvaged"]``.

    Returns
    -------
    Recording

    Raises
    ------
    BadDataError, NoInputError
        The file cannot be used; ``hint`` says what to do.
    OutputError
        The samples take more than half of the machine's memory; use `stream`.
    """
    reading = _open(path, unit, fill, dtype, fill_limit_s, salvage)
    acceleration = reading.read_all()
    inspection = Inspection.from_json(reading.facts())
    info: dict[str, str] = {}
    for key, value in reading.info():
        info.setdefault(_text(key), _text(value))  # of a key that stands twice, the first
    return Recording(
        path=os.fsdecode(path),
        unit=unit,
        fill=fill,
        acceleration=acceleration,
        sample_rate_hz=float(inspection.sample_rate_hz or 0.0),
        info=info,
        inspection=inspection,
        _runs=reading.runs(),
        _rate_hz=reading.rate_hz(),
        _gaps=reading.gaps(),
    )


@dataclass(eq=False)
class Block:
    """Some rows of a recording.

    Attributes
    ----------
    first_row : int
        Number of its first row in the whole recording.
    acceleration : numpy.ndarray, shape (n, 3)
        X, Y, Z, as `read` has them.
    time : numpy.ndarray of datetime64[ns], shape (n,)
        By the recording's own clock.
    """

    first_row: int
    acceleration: NDArray[Any]
    time: NDArray[np.datetime64]

    def __len__(self) -> int:
        return len(self.acceleration)


def stream(
    path: Path,
    unit: Unit = "g",
    fill: Fill = "vendor",
    *,
    rows: int = 1_000_000,
    dtype: Literal["float64", "float32"] = "float64",
    fill_limit_s: int = _USUAL_FILL_LIMIT_S,
    salvage: bool = False,
) -> Iterator[Block]:
    """Read a recording block by block, in bounded memory.

    Parameters
    ----------
    path, unit, fill, dtype, fill_limit_s, salvage
        As in `read`.
    rows : int
        Rows of a block; the last one may have fewer.

    Yields
    ------
    Block
    """
    rows = whole("rows", rows, 1, _MOST)
    reading = _open(path, unit, fill, dtype, fill_limit_s, salvage)
    return _blocks(reading, rows)


def _blocks(reading: _core.Reading, rows: int) -> Iterator[Block]:
    while True:
        first_row = reading.rows()
        acceleration = reading.block(rows)
        if len(acceleration) == 0:
            return
        times = reading.times_ns(first_row, len(acceleration))
        yield Block(first_row, acceleration, times.view("datetime64[ns]"))
