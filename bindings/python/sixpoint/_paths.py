"""Names of files, as the library takes them."""

from __future__ import annotations

import os
from typing import Union

Path = Union[str, "os.PathLike[str]"]


# Names go as bytes: of one that is no UTF-8, Python's text holds surrogates (PEP 383). The library would take a name as
# far as a zero byte; Python's own open() refuses one with the same words.
def as_bytes(path: Path) -> bytes:
    name = os.fsencode(path)
    if b"\0" in name:
        raise ValueError("embedded null byte")
    return name
