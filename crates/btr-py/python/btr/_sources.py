"""What a call takes as a log: files, frames, arrays and bags, one or several at once, read for the compiled model."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btr import _btr, _times, rosbag
from btr._btr import Log
from btr._inputs import floats, wrong

LogLike = Union[str, os.PathLike[str], Log, Any]
"""A path (.csv, .csv.gz, .mcap, the folder of a LeRobot data set; verbs also accept patterns like `"monday/*.csv"`), a
`Log`, or columns by name with `t` in seconds (or as dates or durations): a pandas or polars frame, or a mapping of
arrays. The `[channels]` of the model map foreign names to btr's."""
Given = Union[Log, Path, tuple[str, Log]]
"""A log, its path, or a pair of name and log."""


def read(source: LogLike, name: str | None, model: _btr.Model | None, episode: int | None = None) -> Log:
    """The log of one source; `btr.load_log` tells what it may be."""
    if isinstance(source, (str, os.PathLike, Log)) and name is not None:
        raise TypeError("a file or a Log already has a name")
    if isinstance(source, Log):
        if episode is not None:
            raise TypeError("an episode is one of a data set's folder, not of a Log")
        return source if model is None else _btr.renamed(source, model)
    if isinstance(source, (str, os.PathLike)):
        path = Path(source if episode is None else f"{os.fspath(source)}#{episode}")
        if rosbag.is_bag(path):
            return rosbag.load_bag(path, model)
        return Log.read(path, model)
    if episode is not None:
        raise TypeError(f"an episode is one of a data set's folder, not of a {type(source).__name__}")
    if rosbag.is_reader(source):
        return rosbag.read(source, name, model)
    return _of_columns(source, name, model)


def _of_columns(source: Any, name: str | None, model: _btr.Model | None) -> Log:
    """A log of a frame or a mapping of arrays. Raises `TypeError` for anything else."""
    columns = source.keys() if isinstance(source, Mapping) else getattr(source, "columns", None)
    if columns is None:
        kinds = "a path, a Log, a reader of rosbags, or columns with a `t`"
        raise TypeError(f"a log is {kinds}, not {type(source).__name__}")
    time = _btr.time_of([str(key) for key in columns], model)
    if time is None:
        names = ", ".join(map(str, columns))
        how = "rename the column, or name it in the model's [channels]: time = ..."
        raise TypeError(f"a log needs a column `t`, the time in s; this one has {names}\nhelp: {how}")
    column, unit_s = time
    # Keys need not be strings.
    (key,) = [key for key in columns if str(key) == column][:1]
    others: dict[str, ArrayLike] = {str(other): _column(source[other], str(other)) for other in columns if other != key}
    return _btr.log_of_columns(_times.seconds(source[key], column, unit_s), others, name, model)


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


def given(log: LogLike, model: _btr.Model) -> Log | Path:
    """A log for this model: its path, if btr reads the file itself."""
    if isinstance(log, (str, os.PathLike)) and not rosbag.is_bag(Path(log)):
        return Path(log)
    return read(log, None, model)


class Logs:
    """The logs of a call. Those without a name are numbered, from 1."""

    def __init__(self, model: _btr.Model) -> None:
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
            return read(log, None, self._model)
        return read(log, self._number(log, "log"), self._model)

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
        raise wrong(f"{pattern}: no file matches", f"paths are relative to {os.getcwd()}")
    return [Path(path) for path in found]
