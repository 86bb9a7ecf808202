"""The JSON documents of the program as dataclasses.

Every class has the keys of its document as fields, with the same names. ``document`` is the whole
of it as it was, also with what stands in it only sometimes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Literal, Optional, TypeVar

Answer = TypeVar("Answer", bound="_Answer")
Vector = Optional[list[Optional[float]]]


@dataclass
class _Answer:
    document: dict[str, Any] = field(repr=False, compare=False, kw_only=True, default_factory=dict)

    @classmethod
    def from_json(cls: type[Answer], document: dict[str, Any]) -> Answer:
        """Make it from a parsed JSON document; keys without a field stay in ``document``."""
        known = {one.name for one in fields(cls)} - {"document"}
        values = {name: value for name, value in document.items() if name in known}
        for name, kind in cls._parts().items():
            if isinstance(values.get(name), list):
                values[name] = [kind.from_json(one) for one in values[name]]
            elif isinstance(values.get(name), dict):
                values[name] = kind.from_json(values[name])
        return cls(**values, document=document)

    @classmethod
    def _parts(cls) -> dict[str, type[_Answer]]:
        """Fields that hold answers themselves, or lists of them."""
        return {}


@dataclass
class Clock(_Answer):
    """Which clock the times of a recording are by.

    ``kind`` is local (the wearer's), utc or unknown; ``offset_minutes`` is local time minus UTC.
    """

    kind: Literal["local", "utc", "unknown"]
    offset_minutes: Optional[int]
    why: str


@dataclass
class Gap(_Answer):
    """Missing seconds: ``kind`` is idle_sleep, usb, damaged or unexplained."""

    start: str
    seconds: int
    kind: str


@dataclass
class Constants(_Answer):
    """The nine stored constants, X Y Z, in the sensor's raw counts."""

    positive_lsb: list[int]
    negative_lsb: list[int]
    zero_lsb: list[int]


@dataclass
class Inspection(_Answer):
    """What a file holds (``sixpoint inspect``); of an .agd file many fields are None."""

    path: str
    form: str
    serial: str
    firmware: str
    model: str
    device_type: str
    sample_rate_hz: Optional[float]
    accel_scale_lsb_per_g: Optional[float]
    clock: Clock
    start: Optional[str]
    first_after_start_s: Optional[int]
    samples: int
    duration_s: float
    records: dict[str, int]
    constants: Optional[Constants]
    calibration_time: Optional[str]
    filter: dict[str, str]
    gaps: list[Gap]
    gap_count: int
    gap_seconds: int
    irregular: dict[str, Any]
    clipped_samples: int
    checksum_failures: int
    still: Optional[dict[str, Any]]
    damage: dict[str, Any]
    losses: Optional[list[dict[str, Any]]]
    already_repaired: bool
    entries: list[dict[str, Any]]
    warnings: list[str]
    error: Optional[dict[str, str]] = None

    @classmethod
    def _parts(cls) -> dict[str, type[_Answer]]:
        return {"clock": Clock, "constants": Constants, "gaps": Gap}


@dataclass
class ScannedFile(_Answer):
    """One file of a scan. ``evidence_mg``: how far its still periods are from 1 g (95th percentile)."""

    path: str
    verdict: Literal["affected", "not_affected", "cannot_tell", "unreadable"]
    reasons: list[str]
    serial: str
    firmware: str
    calibration_time: Optional[str]
    evidence_mg: Optional[float]
    axes_rotated: bool
    sides: list[str]


@dataclass
class ScanResult(_Answer):
    """The answers of `sixpoint.scan`, how many there are of each verdict, and what units need."""

    files: list[ScannedFile]
    summary: dict[str, int]
    units: list[dict[str, Any]]

    @classmethod
    def _parts(cls) -> dict[str, type[_Answer]]:
        return {"files": ScannedFile}


@dataclass
class RepairedFile(_Answer):
    """One file of a repair (``sixpoint repair``); accelerations in mg, arrays X Y Z."""

    input: str
    output: Optional[str]
    linked: Optional[str]
    status: Literal[
        "repaired", "not_affected", "not_repairable", "already_repaired", "outdated", "failed"
    ]
    method: Optional[str]
    reasons: list[str]
    serial: str
    calibration_time: Optional[str]
    samples: int
    clipped_before: int
    clipped_after: int
    still_blocks: int
    verdict: Optional[str]
    sides: list[str]
    still_error_mg: dict[str, Optional[float]]
    rotation_undone: bool
    for_a_person: bool
    forced: bool
    cross_axis_applied: bool
    sample_uncertainty_mg: Vector
    source: Optional[dict[str, Any]]
    losses: list[dict[str, Any]]
    constants_id: Optional[str]
    input_sha256: Optional[str]
    output_sha256: Optional[str]


@dataclass
class RepairResult(_Answer):
    """The answers of `sixpoint.repair`, how many there are of each status, and what units need."""

    files: list[RepairedFile]
    summary: dict[str, Any]
    units: list[dict[str, Any]]

    @classmethod
    def _parts(cls) -> dict[str, type[_Answer]]:
        return {"files": RepairedFile}


@dataclass
class SolveReport(_Answer):
    """Constants from still periods, with a verdict (``sixpoint solve``).

    ``constants`` are in g/LSB and in the sensor's raw counts; None where the recording does not
    determine them, and then ``missing_directions`` says what it lacks. What only some recordings have
    (``least_squares``, ``efficiency``, ``trust``, ``temperature``, ``partial`` ...) is in ``document``.
    """

    file: str
    serial: str
    filter: Optional[str]
    method: str
    constants: Optional[dict[str, Any]]
    standard_uncertainty: Optional[dict[str, Any]]
    points: int
    points_found: int
    coverage_g: dict[str, Vector]
    residual_mg: dict[str, Optional[float]]
    verified: bool
    verdict: str
    reasons: list[str]
    missing_directions: list[str]
    notes: list[str]
    iterations: int
    seconds: float
    gravity_m_per_s2: float
    temperature_c: Optional[float]
    from_prior: bool
    verification: dict[str, Any]
