"""What a `Log` shows of itself in Python."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from btr import _tables
from btr._btr import BtrError

if TYPE_CHECKING:
    import pandas

    from btr._btr import Log

Floats = NDArray[np.float64]


def frame(clock_s: Floats, columns: dict[str, Floats]) -> pandas.DataFrame:
    """A pandas frame with the clock as column `t`; raises `BtrError` where a channel is called so."""
    if "t" in columns:
        raise BtrError("a channel is called t, as the clock is in a frame\nhelp: give it another name")
    return _tables.frame({"t": clock_s, **columns})


def table(log: Log) -> str:
    """HTML: every channel with its unit, how much of it is known, and between which values it lies."""

    def row(channel: str) -> dict[str, object]:
        values = log[channel]
        known = values[np.isfinite(values)]
        low, high = (float(known.min()), float(known.max())) if len(known) else (None, None)
        return {"channel": channel, "unit": log.unit(channel), "samples": len(known), "lowest": low, "highest": high}

    return _tables.markup(repr(log)[1:-1], [row(channel) for channel in log.keys()])
