"""Logs from files, frames, arrays and bags, and their tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from btr import _sources, _tables
from btr._btr import BtrError, Log
from btr._sources import LogLike
from btr.model import Model

if TYPE_CHECKING:
    import pandas

__all__ = ["LogLike", "frame", "load_log", "table"]


def load_log(
    source: LogLike, name: str | None = None, *, model: Model | None = None, episode: int | None = None
) -> Log:
    """Reads a log from a file, an episode of a LeRobot data set's folder (`"folder#3"` is `"folder", episode=3`), the
    folder of a ROS 2 bag, an open reader of the package rosbags, or columns with `t` in seconds (a frame or a mapping
    of arrays). If `t` holds dates or durations, times count from the first one. The other columns are named as in a
    CSV: `cmd_<joint>`, `q_<joint>`, `dq_<joint>`, `tau_<joint>`, with the suffix `_deg` for degrees. The `[channels]`
    of `model` map foreign names; channels of a `Log` that have btr's names are kept. Raises `BtrError` if the log
    cannot be read, `TypeError` for a source that is not a log."""
    return _sources.read(source, name, None if model is None else model._model, episode)


def frame(clock_s: NDArray[np.float64], columns: dict[str, NDArray[np.float64]]) -> pandas.DataFrame:
    """A pandas frame with the clock as column `t`. Raises `BtrError` if a channel has that name."""
    if "t" in columns:
        raise BtrError("a channel is called t, which is the clock's name in a frame\nhelp: give it another name")
    return _tables.frame({"t": clock_s, **columns})


def table(log: Log) -> str:
    """HTML table of the channels: unit, number of finite samples, lowest and highest value."""

    def row(channel: str) -> dict[str, object]:
        values = log[channel]
        known = values[np.isfinite(values)]
        low, high = (float(known.min()), float(known.max())) if len(known) else (None, None)
        return {"channel": channel, "unit": log.unit(channel), "samples": len(known), "lowest": low, "highest": high}

    return _tables.markup(repr(log)[1:-1], [row(channel) for channel in log.keys()])
