"""Warnings at the line that called btr, whichever thread they come from."""

from __future__ import annotations

import sys
import warnings
from typing import NamedTuple


class Place(NamedTuple):
    """A line of somebody's program."""

    file: str
    line: int
    module: str


def place() -> Place:
    """Where btr was called on this thread."""
    frame = sys._getframe(1)
    while frame is not None:
        module = str(frame.f_globals.get("__name__", ""))
        if module.partition(".")[0] != "btr":
            return Place(frame.f_code.co_filename, frame.f_lineno, module)
        if frame.f_back is None:
            break
        frame = frame.f_back
    return Place("btr", 1, "btr")


def warn(text: str, at: Place | None = None) -> None:
    """Warns, each time: the next call from the same line may be about other logs that are called the same."""
    file, line, module = place() if at is None else at
    warnings.warn_explicit(text, UserWarning, file, line, module=module)
