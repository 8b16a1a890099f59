"""What people hand over: arrays of numbers, and what they are told where it is something else."""

from __future__ import annotations

import math
import operator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btr._btr import BtrError


def wrong(message: str, help: str) -> BtrError:
    """An error with what to do about it, as the compiled half writes them."""
    return BtrError(f"{message}\nhelp: {help}")


def count(number: Any, what: str) -> int:
    """A whole number that is not below 0; raises `TypeError` for what is none, `BtrError` for others."""
    try:
        number = operator.index(number)
    except TypeError:
        raise TypeError(f"{what} is a whole number, not {number!r}") from None
    if not 0 <= number < 2**63:
        raise wrong(f"{what} = {number}", "give a whole number from 0 on")
    return int(number)


def positive(number: Any, what: str) -> float:
    """A finite number above 0; raises `TypeError` for what is none, `BtrError` for others."""
    try:
        value = float(number)
    except (TypeError, ValueError):
        raise TypeError(f"{what} is a number, not {number!r}") from None
    if not (value > 0 and math.isfinite(value)):
        raise wrong(f"{what} = {number}", "give a finite number above 0")
    return value


def must_be_called(function: Any, what: str) -> None:
    """Raises `TypeError` for what is no function; `what` says what should have been there."""
    if not callable(function):
        raise TypeError(f"{what}, not {function!r}")


def floats(values: Any, expected: str) -> NDArray[np.float64]:
    """An array of floats; `expected` says in the TypeError what should have been there."""
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{expected}, not {type(values).__name__}: {error}") from error
