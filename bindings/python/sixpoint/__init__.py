"""Read, judge and repair recordings of activity monitors (.gt3x, .agdc).

>>> import sixpoint
>>> recording = sixpoint.read("unit.gt3x")          # doctest: +SKIP
>>> recording.acceleration.shape                    # doctest: +SKIP
(60480000, 3)

The functions are `read`, `stream`, `inspect`, `scan`, `solve` and `repair`; docs/python.md has an
example of each. Acceleration is in g (units of standard gravity) or in LSB (stored counts), axes
come in the order X Y Z, times are by the recording's own clock. Errors are raised as
`SixpointError` with ``code``, ``what``, ``where`` and ``hint``. Long calls release the
interpreter's lock and end within a second after Ctrl-C.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ._errors import (
    BadDataError,
    NoInputError,
    OutputError,
    RefusedError,
    SixpointError,
    UsageError,
)
from ._version import __version__

if TYPE_CHECKING:
    from ._answers import (
        Inspection,
        RepairedFile,
        RepairResult,
        ScannedFile,
        ScanResult,
        SolveReport,
    )
    from ._files import inspect, repair, scan, solve
    from ._recording import Block, Recording, read, stream

__all__ = [
    "BadDataError",
    "Block",
    "Inspection",
    "NoInputError",
    "OutputError",
    "Recording",
    "RefusedError",
    "RepairResult",
    "RepairedFile",
    "ScanResult",
    "ScannedFile",
    "SixpointError",
    "SolveReport",
    "UsageError",
    "__version__",
    "inspect",
    "read",
    "repair",
    "scan",
    "solve",
    "stream",
]

# Loading numpy and the library takes longer than an import should: they are loaded at their first use.
_HOMES = {
    "Block": "_recording",
    "Inspection": "_answers",
    "Recording": "_recording",
    "RepairResult": "_answers",
    "RepairedFile": "_answers",
    "ScanResult": "_answers",
    "ScannedFile": "_answers",
    "SolveReport": "_answers",
    "inspect": "_files",
    "read": "_recording",
    "repair": "_files",
    "scan": "_files",
    "solve": "_files",
    "stream": "_recording",
}


def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'sixpoint' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"sixpoint.{home}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
