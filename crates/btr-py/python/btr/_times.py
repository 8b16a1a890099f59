"""Times of frames and arrays, in seconds."""

from __future__ import annotations

import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btr._inputs import floats, wrong

_SECOND = np.timedelta64(1, "s")


def are_times(values: NDArray[Any]) -> bool:
    """Whether these are dates or durations, which NumPy would turn into numbers of whatever unit they have."""
    if values.dtype == object:
        return any(isinstance(value, (datetime.datetime, datetime.timedelta)) for value in values.flat[:1])
    return values.dtype.kind in "mM"


def seconds(column: Any, name: str, unit_s: float) -> NDArray[np.float64]:
    """A column's times: its numbers times `unit_s`; of dates and durations the seconds since the first one. Raises
    `BtrError` where one of them is missing, `TypeError` for what is no time."""
    values = np.asarray(column)
    if not are_times(values):
        return np.ascontiguousarray(floats(values, f"column `{name}` is the time in s") * unit_s)
    if values.dtype == object:
        # With a time zone, or as Python has them.
        first = values.flat[0]
        since = [(value - first).total_seconds() if value == value else np.nan for value in values.flat]
        elapsed = np.array(since, dtype=np.float64)
    else:
        elapsed = np.asarray((values - values.flat[0]) / _SECOND, dtype=np.float64) if values.size else np.empty(0)
    missing = np.flatnonzero(np.isnan(elapsed))
    if len(missing):
        raise wrong(f"column `{name}`: sample {missing[0]} has no time", "leave out the rows without one")
    return np.ascontiguousarray(elapsed)
