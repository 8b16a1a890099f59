"""What people hand over: arrays of numbers, and what they are told where it is something else."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from btr._btr import BtrError


def wrong(message: str, help: str) -> BtrError:
    """An error with what to do about it, as the compiled half writes them."""
    return BtrError(f"{message}\nhelp: {help}")


def floats(values: Any, expected: str) -> NDArray[np.float64]:
    """An array of floats; `expected` says in the TypeError what should have been there."""
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{expected}, not {type(values).__name__}: {error}") from error
