"""Names of files and numbers, as the library takes them."""

from __future__ import annotations

import operator
import os
from typing import Union

from ._errors import UsageError

Path = Union[str, bytes, "os.PathLike[str]", "os.PathLike[bytes]"]


# Names go as bytes: of one that is no UTF-8, Python's text holds surrogates (PEP 383). The library would take a name as
# far as a zero byte; Python's own open() refuses one with the same words.
def as_bytes(path: Path) -> bytes:
    name = os.fsencode(path)
    if b"\0" in name:
        raise ValueError("embedded null byte")
    return name


def whole(name: str, value: int, low: int, high: int) -> int:
    """Return a whole number as it is; TypeError for what is none, UsageError out of its range."""
    number = operator.index(value)
    if not low <= number <= high:
        raise UsageError("usage", f"{name}={number} is out of range", "", f"use {low} to {high}")
    return number
