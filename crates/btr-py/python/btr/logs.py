"""Logs: from files, frames, arrays and bags, alone or many at once."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btr import _btr, _tables, _times, rosbag
from btr._btr import BtrError, Log
from btr._inputs import floats, wrong

if TYPE_CHECKING:
    import pandas

    from btr.model import Model

LogLike = Union[str, os.PathLike[str], Log, Any]
"""A path (.csv, .csv.gz, .mcap, a LeRobot data set's folder; verbs take patterns like `"monday/*.csv"`, too), a `Log`, or
columns by name with `t` in seconds (or as times): a pandas or polars frame, or a mapping of arrays. The `[channels]` of the
model it is for say what foreign names mean."""
Given = Union[Log, Path, tuple[str, Log]]
"""A log, or where it is, or what it is called and the log."""


def load_log(
    source: LogLike, name: str | None = None, *, model: Model | None = None, episode: int | None = None
) -> Log:
    """A log of a file, of an episode of a LeRobot data set's folder (`"folder#3"` is `"folder", episode=3`), of a ROS 2 bag's
    folder or an open reader of the package rosbags, or of columns with a `t` in seconds: a frame, or a mapping of arrays.
    Where `t` holds dates or durations, it counts from the first one. The others are called as in a CSV: `cmd_<joint>`,
    `q_<joint>`, `dq_<joint>`, `tau_<joint>`, with `_deg` at the end for degrees. Foreign names mean what the `[channels]` of
    a model say; what a `Log` has under btr's names stays as it is. Raises `BtrError` for what cannot be read, `TypeError` for
    what is no log."""
    if isinstance(source, (str, os.PathLike, Log)) and name is not None:
        raise TypeError("a file or a Log has a name of its own")
    if isinstance(source, Log):
        if episode is not None:
            raise TypeError("an episode is one of a data set's folder, not of a Log")
        return source if model is None else _btr.renamed(source, model._model)
    if isinstance(source, (str, os.PathLike)):
        path = Path(source if episode is None else f"{os.fspath(source)}#{episode}")
        if rosbag.is_bag(path):
            return rosbag.load_bag(path, model)
        return Log.read(path, None if model is None else model._model)
    if episode is not None:
        raise TypeError(f"an episode is one of a data set's folder, not of a {type(source).__name__}")
    if rosbag.is_reader(source):
        return rosbag.read(source, name, model)
    return _of_columns(source, name, model)


def _of_columns(source: Any, name: str | None, model: Model | None) -> Log:
    """A log of a frame or a mapping of arrays; raises `TypeError` for what is neither."""
    columns = source.keys() if isinstance(source, Mapping) else getattr(source, "columns", None)
    if columns is None:
        wanted = "a path, a Log, a reader of rosbags, or columns with a `t`"
        raise TypeError(f"a log is {wanted}, not {type(source).__name__}")
    known = None if model is None else model._model
    time = _btr.time_of([str(key) for key in columns], known)
    if time is None:
        has = ", ".join(map(str, columns))
        how = "call it so, or name it in the model's [channels]: time = ..."
        raise TypeError(f"a log needs a column `t`, the time in s; this one has {has}\nhelp: {how}")
    column, unit_s = time
    # A key may be no text.
    (key,) = [key for key in columns if str(key) == column][:1]
    others: dict[str, ArrayLike] = {str(other): _column(source[other], str(other)) for other in columns if other != key}
    return _btr.log_of_columns(_times.seconds(source[key], column, unit_s), others, name, known)


def _column(column: Any, name: str) -> NDArray[np.float64]:
    values = np.asarray(column)
    if _times.are_times(values):
        raise TypeError(f"column `{name}` holds times, not numbers\nhelp: leave it out, or give it in seconds")
    return np.ascontiguousarray(floats(values, f"column `{name}` is an array of numbers"))


def is_columns(log: object) -> bool:
    """Whether this has columns by name: a mapping, a frame."""
    return isinstance(log, Mapping) or hasattr(log, "columns")


def _is_one(log: object) -> bool:
    """Whether this is a log, not several."""
    return isinstance(log, (str, os.PathLike, Log)) or is_columns(log) or rosbag.is_reader(log)


def given(log: LogLike, model: Model) -> Log | Path:
    """A log for this model: where it is, if a file is enough."""
    if isinstance(log, (str, os.PathLike)) and not rosbag.is_bag(Path(log)):
        return Path(log)
    return load_log(log, model=model)


class Logs:
    """The logs of a call. Those without a name of their own are counted in it, from 1."""

    def __init__(self, model: Model) -> None:
        self._model = model
        # With what is counted: as long as it is there, nothing else has its id.
        self._counted: dict[int, tuple[int, object]] = {}

    def all(self, logs: LogLike | Iterable[LogLike] | None) -> list[Given]:
        """All that were given, the files of patterns sorted and each once; none for None."""
        if logs is None:
            return []
        several: Any = [logs] if _is_one(logs) else logs
        if not isinstance(several, Iterable):
            raise TypeError(f"a log is a path, a Log, a frame or a mapping of arrays, and there may be a list, not {logs!r}")
        # A file counts once, however many patterns it fits.
        paths: set[Path] = set()
        known: list[Given] = []
        for log in several:
            for path in _files(log):
                if path not in paths:
                    paths.add(path)
                    known.append(given(path, self._model))
            if not isinstance(log, (str, os.PathLike)):
                known.append(self._in_memory(log))
        return known

    def _in_memory(self, log: Any) -> Given:
        if isinstance(log, Log):
            return log if log.is_named else (self._number(log, os.fspath(log.name)), log)
        if rosbag.is_reader(log):
            return load_log(log, model=self._model)
        return load_log(log, self._number(log, "log"), model=self._model)

    def _number(self, log: object, kind: str) -> str:
        number, _ = self._counted.setdefault(id(log), (len(self._counted) + 1, log))
        return f"{kind} {number}"


def _files(log: object) -> list[Path]:
    """A file, or those whose names are like a pattern's, sorted; none where this is none."""
    if not isinstance(log, (str, os.PathLike)):
        return []
    pattern = os.fspath(log)
    # The folder of an episode (`folder#3`) may have brackets in its name.
    if not glob.has_magic(pattern) or any(map(os.path.exists, (pattern, pattern.rpartition("#")[0]))):
        return [Path(pattern)]
    found = sorted(glob.glob(pattern, recursive=True))
    if not found:
        raise wrong(f"{pattern}: no file is called like that", f"paths begin in {os.getcwd()}")
    return [Path(path) for path in found]


def frame(clock_s: NDArray[np.float64], columns: dict[str, NDArray[np.float64]]) -> pandas.DataFrame:
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
