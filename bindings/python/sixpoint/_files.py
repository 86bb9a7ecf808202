"""Whole files: what they hold, which are affected, their constants, their repair."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Literal, Optional

from . import _core
from ._answers import Inspection, RepairResult, ScanResult, SolveReport
from ._errors import UsageError
from ._paths import Path, as_bytes, whole


def _paths(paths: Path | Iterable[Path]) -> list[bytes]:
    if isinstance(paths, (str, bytes, os.PathLike)):
        return [as_bytes(paths)]
    return [as_bytes(path) for path in paths]


def _or_empty(path: Optional[Path]) -> bytes:
    if path is None:
        return b""
    name = as_bytes(path)
    if not name:  # an empty variable would mean no store
        raise UsageError("usage", "a path is empty", "", "give a path, or None for none")
    return name


def inspect(path: Path, *, salvage: bool = False) -> Inspection:
    """Say what a .gt3x, .agdc or .agd file holds; no verdict.

    Parameters
    ----------
    path : path-like
        The file.
    salvage : bool
        Read what is left of a damaged file.

    Returns
    -------
    Inspection
        As ``sixpoint inspect --json``.
    """
    return Inspection.from_json(_core.inspect(as_bytes(path), salvage))


def scan(
    paths: Path | Iterable[Path], *, jobs: int = 0, store: Optional[Path] = None
) -> ScanResult:
    """Find the files that the vendor's case 16CPAN03 affects.

    Parameters
    ----------
    paths : path-like or iterable of them
        Files, or folders whose .gt3x, .agdc and .agd files are taken.
    jobs : int
        Files at a time; 0: one for each core.
    store : path-like, optional
        A store that knows dates of calibration; none is looked for otherwise.

    Returns
    -------
    ScanResult
        As ``sixpoint scan --json``: an answer for each file, also for those that cannot be read.
    """
    options = {"jobs": jobs, "store": _or_empty(store)}
    return ScanResult.from_json(_core.scan(_paths(paths), options))


def solve(
    path: Path,
    *,
    method: Literal["ls", "ga"] = "ls",
    seed: Optional[int] = None,
    strict_nonzero: bool = False,
    prior: Optional[Literal["population"]] = None,
    gravity: Optional[float] = None,
    latitude: Optional[float] = None,
    altitude: Optional[float] = None,
) -> SolveReport:
    """Find a unit's constants from the still periods of a recording.

    Parameters
    ----------
    path : path-like
        The recording.
    method : {"ls", "ga"}
        Least squares, or the paper's genetic algorithm.
    seed : int, optional
        Seed of the genetic algorithm.
    strict_nonzero : bool
        Reject still periods in which an axis reads exactly zero, as the paper's formula says.
    prior : {"population"}, optional
        Where sides are missing, use what units of this model are like; never verified.
    gravity : float, optional
        Local gravity in m/s2. Neither this nor a latitude: standard gravity, and its uncertainty.
    latitude, altitude : float, optional
        Or where gravity is computed from: degrees, and metres above the sea (0 where not given).

    Returns
    -------
    SolveReport
        As ``sixpoint solve --json``. Use the constants only where ``verified`` is true.
    """
    if prior not in (None, "population"):
        raise UsageError("usage", f"prior={prior!r} is not known", "", "use 'population'")
    if seed is not None:
        seed = whole("seed", seed, 0, 2**64 - 1)
    return SolveReport.from_json(
        _core.solve(
            as_bytes(path),
            method,
            seed,
            strict_nonzero,
            prior == "population",
            gravity,
            latitude,
            altitude,
        )
    )


def repair(
    paths: Path | Iterable[Path],
    output: Path,
    *,
    constants: Optional[Path] = None,
    calibration_file: Optional[Path] = None,
    scan: bool = False,
    store: Optional[Path] = None,
    or_scan: bool = False,
    no_pool: bool = False,
    wide: bool = False,
    store_only: bool = False,
    undo_rotation: bool = False,
    allow_prior: bool = False,
    salvage: bool = False,
    force: bool = False,
    dry_run: bool = False,
    resume: bool = False,
    redo_outdated: bool = False,
    link_unaffected: Optional[Literal["hard", "symbolic"]] = None,
    jobs: int = 0,
) -> RepairResult:
    """Repair affected files into another folder; the originals are never changed.

    Parameters
    ----------
    paths : path-like or iterable of them
        Files, or folders whose .gt3x files are taken.
    output : path-like
        The folder for repaired files.
    constants, calibration_file, scan, store
        Where constants come from; what is named stands alone. Nothing named: the still periods of each
        file itself. A store is only read: ``sixpoint repair`` also records there what it did.
    or_scan : bool
        The still periods of the file itself where what is named does not fit.
    no_pool : bool
        Do not take constants from the still periods of the unit's other files.
    wide : bool
        Write 16-bit records, in which nothing needs clipping.
    store_only : bool
        Store the entries of repaired files instead of deflating them.
    undo_rotation : bool
        Also turn back the axes of firmware 1.6.0 where the constants are right.
    allow_prior : bool
        Also use constants that rest on a population prior.
    salvage : bool
        Read what is left of a damaged file.
    force : bool
        Write a file also where its own still periods say that it does not help.
    dry_run : bool
        Compute everything, write nothing.
    resume, redo_outdated : bool
        Go on with an earlier run; replace outputs that would be made otherwise now.
    link_unaffected : {"hard", "symbolic"}, optional
        Links of the files that need no repair, so that the output folder holds the whole study.
    jobs : int
        Files at a time; 0: one for each core.

    Returns
    -------
    RepairResult
        As ``sixpoint repair --json``: an answer for each file, also for those that failed.
    """
    options = {
        "constants": _or_empty(constants),
        "calibration_file": _or_empty(calibration_file),
        "scan": scan,
        "store": _or_empty(store),
        "or_scan": or_scan,
        "no_pool": no_pool,
        "wide": wide,
        "store_only": store_only,
        "undo_rotation": undo_rotation,
        "allow_prior": allow_prior,
        "salvage": salvage,
        "force": force,
        "dry_run": dry_run,
        "resume": resume,
        "redo_outdated": redo_outdated,
        "link_unaffected": link_unaffected or "",
        "jobs": jobs,
    }
    return RepairResult.from_json(_core.repair(_paths(paths), as_bytes(output), options))
