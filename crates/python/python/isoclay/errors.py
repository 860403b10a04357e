"""What can go wrong. Every exception that isoclay raises of its own is an :class:`IsoclayError`; all can be pickled.

Values that cannot be used at all raise plain :class:`ValueError` and :class:`TypeError`.
"""

from __future__ import annotations

__all__ = [
    "BadFile",
    "BadOption",
    "BadScript",
    "Cancelled",
    "Degenerate",
    "DocumentProblem",
    "FileFailed",
    "IsoclayError",
    "MemoryLimit",
    "NotEnoughSamples",
]


class IsoclayError(Exception):
    """The root of all of them. The text says what was met, the value, and what would help."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class Cancelled(IsoclayError):
    """A :class:`isoclay.CancelToken` asked to stop."""


class MemoryLimit(MemoryError, IsoclayError):
    """The work would hold more than ``memory`` allows."""

    def __init__(self, message: str, needed: int, limit: int) -> None:
        super().__init__(message, needed, limit)
        self.needed = needed
        """Bytes that the work would hold at once."""
        self.limit = limit
        """Bytes that were allowed."""


class NotEnoughSamples(IsoclayError, ValueError):
    """There is too little to fit."""

    def __init__(self, message: str, found: int, needed: int) -> None:
        super().__init__(message, found, needed)
        self.found = found
        """Usable samples."""
        self.needed = needed
        """Samples that a fit needs."""


class Degenerate(IsoclayError, ValueError):
    """The input cannot stand for a solid."""


class BadOption(IsoclayError, ValueError):
    """An option is out of range, or does not go with another."""

    def __init__(self, message: str, option: str, value: float) -> None:
        super().__init__(message, option, value)
        self.option = option
        """Its name."""
        self.value = value
        """Its value."""


class BadFile(IsoclayError, ValueError):
    """A file cannot be used for what is in it."""

    def __init__(self, message: str, path: str) -> None:
        super().__init__(message, path)
        self.path = path
        """The file."""


class FileFailed(IsoclayError, OSError):
    """The system refused to read or write a file."""

    def __init__(self, message: str, path: str, number: int) -> None:
        super().__init__(message, path, number)
        self.path = path
        """The file."""
        self.errno = number


class DocumentProblem(IsoclayError):
    """A document cannot be read or changed: it is open elsewhere, exists already, or has no such object."""


class BadScript(IsoclayError, ValueError):
    """A script says what cannot be done."""
