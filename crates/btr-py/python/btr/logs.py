"""Logs from files, frames, arrays and bags, one or several at once."""

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
"""A path (.csv, .csv.gz, .mcap, the folder of a LeRobot data set; verbs also accept patterns like `"monday/*.csv"`), a
`Log`, or columns by name with `t` in seconds (or as dates or durations): a pandas or polars frame, or a mapping of
arrays. The `[channels]` of the model map foreign names to btr's."""
Given = Union[Log, Path, tuple[str, Log]]
"""A log, its path, or a pair of name and log."""


def load_log(
    source: LogLike, name: str | None = None, *, model: Model | None = None, episode: int | None = None
) -> Log:
    """Reads a log from a file, an episode of a LeRobot data set's folder (`"folder#3"` is `"folder", episode=3`), the
    folder of a ROS 2 bag, an open reader of the package rosbags, or columns with `t` in seconds (a frame or a mapping
    of arrays). If `t` holds dates or durations, times count from the first one. The other columns are named as in a
    CSV: `cmd_<joint>`, `q_<joint>`, `dq_<joint>`, `tau_<joint>`, with the suffix `_deg` for degrees. The `[channels]`
    of `model` map foreign names; channels of a `Log` that have btr's names are kept. Raises `BtrError` if the log
    cannot be read, `TypeError` for a source that is not a log."""
    if isinstance(source, (str, os.PathLike, Log)) and name is not None:
        raise TypeError("a file or a Log already has a name")
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
    """A log of a frame or a mapping of arrays. Raises `TypeError` for anything else."""
    columns = source.keys() if isinstance(source, Mapping) else getattr(source, "columns", None)
    if columns is None:
        kinds = "a path, a Log, a reader of rosbags, or columns with a `t`"
        raise TypeError(f"a log is {kinds}, not {type(source).__name__}")
    known = None if model is None else model._model
    time = _btr.time_of([str(key) for key in columns], known)
    if time is None:
        names = ", ".join(map(str, columns))
        how = "rename the column, or name it in the model's [channels]: time = ..."
        raise TypeError(f"a log needs a column `t`, the time in s; this one has {names}\nhelp: {how}")
    column, unit_s = time
    # Keys need not be strings.
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
    """A log for this model: its path, if btr reads the file itself."""
    if isinstance(log, (str, os.PathLike)) and not rosbag.is_bag(Path(log)):
        return Path(log)
    return load_log(log, model=model)


class Logs:
    """The logs of a call. Those without a name are numbered, from 1."""

    def __init__(self, model: Model) -> None:
        self._model = model
        # Holds the numbered objects, so that their ids stay unique.
        self._counted: dict[int, tuple[int, object]] = {}

    def all(self, logs: LogLike | Iterable[LogLike] | None) -> list[Given]:
        """All logs; files that match a pattern are sorted, and each counts once. Empty for None."""
        if logs is None:
            return []
        several: Any = [logs] if _is_one(logs) else logs
        if not isinstance(several, Iterable):
            raise TypeError(f"a log is a path, a Log, a frame, a mapping of arrays, or a list of these, not {logs!r}")
        # A file counts once, even if it matches several patterns.
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
    """The file, or the files that match a pattern, sorted; empty for a log in memory."""
    if not isinstance(log, (str, os.PathLike)):
        return []
    pattern = os.fspath(log)
    # The folder of an episode (`folder#3`) may have brackets in its name.
    if not glob.has_magic(pattern) or any(map(os.path.exists, (pattern, pattern.rpartition("#")[0]))):
        return [Path(pattern)]
    found = sorted(glob.glob(pattern, recursive=True))
    if not found:
        raise wrong(f"{pattern}: no file is called like that", f"paths are relative to {os.getcwd()}")
    return [Path(path) for path in found]


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
