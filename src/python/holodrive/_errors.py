"""What is raised: one class for each kind of error, all of them :class:`Error`, in the library's words."""

from __future__ import annotations

import os
from typing import Optional, Union

__all__ = [
    "CalibrationError",
    "DisplayError",
    "Error",
    "FileError",
    "InputError",
    "Interrupted",
    "MemoryBudgetError",
    "MissingFileError",
    "OutOfRangeError",
    "ParameterError",
    "UndersampledError",
    "UnsupportedError",
    "refused",
]

_Path = Union[str, "os.PathLike[str]"]


class Error(RuntimeError):
    """Something that holodrive refuses or cannot do; its text says what, where, and what to do."""


class InputError(Error, ValueError):
    """A file says something that cannot be right; ``path`` names it."""

    path: _Path


class CalibrationError(Error, ValueError):
    """A panel's profile or calibration is wrong or does not fit; ``path`` names it."""

    path: _Path


class ParameterError(Error, ValueError):
    """An argument is out of its domain; ``parameter`` names it."""

    parameter: str


class OutOfRangeError(ParameterError):
    """A number or size lies outside the domain of its setting: ``value``, and ``limit`` in words."""

    value: str
    limit: str


class UndersampledError(Error, ValueError):
    """The pixels are too coarse for a wave: its ``frequency`` passes their ``limit`` [cycles/m]."""

    frequency: float
    limit: float


class UnsupportedError(Error, NotImplementedError):
    """Right input that this build or machine cannot handle."""


class MemoryBudgetError(Error, MemoryError):
    """The call would take more memory than it may."""


class DisplayError(Error):
    """A monitor, a window or the program that keeps a panel did not do what was asked."""


class FileError(Error, OSError):
    """The operating system refused a file; ``filename`` and ``errno`` as those of an OSError."""

    path: _Path
    errno: Optional[int]

    def __str__(self) -> str:
        # OSError's own would put its number before the library's words.
        return str(self.args[0])


class MissingFileError(FileError, FileNotFoundError):
    """There is no such file or folder."""


class Interrupted(Error, KeyboardInterrupt):
    """The work was asked to stop."""


def refused(parameter: str, what: str) -> ParameterError:
    """An argument's refusal, to be raised."""
    error = ParameterError(f"{parameter}: {what}")
    error.parameter = parameter
    return error
