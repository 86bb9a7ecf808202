"""Exceptions: what went wrong, where, and what to do next."""

from __future__ import annotations


class SixpointError(Exception):
    """An error of the library.

    Attributes
    ----------
    code : str
        The kind of failure, a stable name such as ``"bad_data"``.
    what : str
        What happened, one sentence.
    where : str
        File, record or device; empty where there is no place.
    hint : str
        What to do next; empty where nothing can be done.
    """

    def __init__(self, code: str, what: str, where: str = "", hint: str = "") -> None:
        text = f"{where}: {what}" if where else what
        text = f"{text}; {hint}" if hint else text
        # A name that is no UTF-8 has surrogates, which no terminal takes; the attributes keep them.
        super().__init__(text.encode("utf-8", "backslashreplace").decode())
        self.code = code
        self.what = what
        self.where = where
        self.hint = hint

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.code, self.what, self.where, self.hint)


class UsageError(SixpointError, ValueError):
    """An argument is wrong (code ``usage``)."""


class BadDataError(SixpointError, ValueError):
    """The input is damaged, or is not what it claims to be (code ``bad_data``)."""


class NoInputError(SixpointError, FileNotFoundError):
    """The input does not exist or cannot be opened (code ``no_input``)."""


class OutputError(SixpointError, OSError):
    """An output cannot be made, or writing failed (codes ``cannot_create`` and ``io``)."""


class RefusedError(SixpointError, PermissionError):
    """The operating system refuses (code ``permission``)."""


_CLASSES: dict[str, type[SixpointError]] = {
    "usage": UsageError,
    "bad_data": BadDataError,
    "no_input": NoInputError,
    "cannot_create": OutputError,
    "io": OutputError,
    "permission": RefusedError,
}


def error_of(code: str, what: str, where: str, hint: str) -> SixpointError:
    """Make the exception for a code of the library."""
    return _CLASSES.get(code, SixpointError)(code, what, where, hint)
