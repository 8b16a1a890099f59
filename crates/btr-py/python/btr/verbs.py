"""The verbs: what one asks of a model and its logs."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Union

import numpy as np

from btr import _btr, rosbag
from btr._btr import Log
from btr.results import CheckResult, CompareResult, DiagnoseResult, FitResult

LogLike = Union[str, os.PathLike[str], Log, Any]
"""A path (.csv, .csv.gz, .mcap, a LeRobot data set's folder), a `Log`, or a pandas or polars frame with a column `t` in seconds."""
Tell = Callable[[str, float, Union[float, None]], None]
"""Hears every step of the error's fall: what was done, the error on the logs to learn from, on held-out ones (None without any), both
in multiples of the noise floor."""


class Model:
    """A robot's model: the text of a model file, and where relative paths in it begin."""

    def __init__(self, text: str, path: str | os.PathLike[str] = "model.toml") -> None:
        """A model of a text; raises `BtrError` where that makes no sense, with its line."""
        self._model = _btr.Model(text, Path(path))

    @property
    def text(self) -> str:
        """The text of the model file."""
        return self._model.text

    @property
    def path(self) -> Path:
        """Where it stands, or would stand."""
        return Path(self._model.path)

    @property
    def joints(self) -> list[str]:
        """The joints that can move, in order."""
        return self._model.joints

    def simulate(self, log: LogLike | None = None, *, seed: int | None = None) -> Log:
        """One rollout: of the model's own drive, or told what `log` says the robot was told. With noise of the model's sensors if
        there is a seed."""
        return self._model.simulate(None if log is None else _given(log), seed)

    def add(self, *effects: str) -> Model:
        """The model with effects (`"coulomb_friction@knee"`) in it, free to fit."""
        added = self._model.add(list(effects))
        return Model(added.text, self.path)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the model file, whole or not at all; the files that it names are found from there."""
        self._model.save(Path(path))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and (self.text, self.path) == (other.text, other.path)

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[type[Model], tuple[str, Path]]:
        return Model, (self.text, self.path)

    def __repr__(self) -> str:
        return f"<Model {self.path}: {', '.join(self.joints)}>"


def load_model(path: str | os.PathLike[str], settings: Mapping[str, Any] | None = None) -> Model:
    """The model of a file; `settings` change values of it by their dotted keys, as `--set` does."""
    texts = [f"{key}={_toml(value)}" for key, value in (settings or {}).items()]
    model = _btr.Model.read(Path(path), texts)
    return Model(model.text, path)


def _toml(value: Any) -> str:
    return json.dumps(value) if isinstance(value, (bool, str, int, float, list)) else str(value)


def load_log(
    source: LogLike, name: str | None = None, *, model: Model | None = None, episode: int | None = None
) -> Log:
    """A log of a file, of an episode of a LeRobot data set's folder (`"folder#3"` is `"folder", episode=3`), of a ROS 2 bag's folder
    or an open reader of the package rosbags, or of a frame with a column `t` in seconds. A frame's other columns are called as in a
    CSV: `cmd_<joint>`, `q_<joint>`, `dq_<joint>`, `tau_<joint>`, with `_deg` at the end for degrees. Foreign names in a file or bag
    mean what the `[channels]` of a model say. Raises `BtrError` for what cannot be read, `TypeError` for what is no log."""
    if isinstance(source, Log):
        return source
    if isinstance(source, (str, os.PathLike)):
        path = Path(source if episode is None else f"{os.fspath(source)}#{episode}")
        if rosbag.is_bag(path):
            return rosbag.load_bag(path, model)
        return Log.read(path, None if model is None else model._model)
    if episode is not None:
        raise TypeError(f"an episode is one of a data set's folder, not of a {type(source).__name__}")
    if rosbag.is_reader(source):
        return rosbag.read(source, name, model)
    columns = getattr(source, "columns", None)
    if columns is None or "t" not in columns:
        wanted = "a path, a Log, a reader of rosbags, or a frame with a column `t`"
        raise TypeError(f"a log is {wanted}, not {type(source).__name__}")
    channels = {str(key): _floats(source[key]) for key in columns if key != "t"}
    return Log(_floats(source["t"]), channels, name)


def _floats(column: Any) -> np.ndarray:
    return np.ascontiguousarray(np.asarray(column, dtype=np.float64))


def _given(log: LogLike) -> Log | Path:
    return Path(log) if isinstance(log, (str, os.PathLike)) else load_log(log)


def _all(logs: LogLike | Iterable[LogLike]) -> list[Log | Path]:
    one = isinstance(logs, (str, os.PathLike, Log)) or hasattr(logs, "columns")
    return [_given(log) for log in ([logs] if one else logs)]


def _silent(step: str, train: float, held_out: float | None) -> None:
    """Nobody listens."""


def check(model: Model, logs: LogLike | Iterable[LogLike]) -> CheckResult:
    """What logs are worth before anything is fitted to them, and what they tell about the numbers in doubt."""
    return CheckResult(json.loads(_btr.check(model._model, _all(logs))))


def compare(model: Model, logs: LogLike | Iterable[LogLike]) -> CompareResult:
    """How far the model is off on every channel, in multiples of the noise floor, and where."""
    return CompareResult(json.loads(_btr.compare(model._model, _all(logs))))


def diagnose(
    model: Model,
    logs: LogLike | Iterable[LogLike],
    *,
    held_out: LogLike | Iterable[LogLike] = (),
    max_effects: int = 3,
    tell: Tell = _silent,
) -> DiagnoseResult:
    """Which physical effect the model lacks, on which joint, with what confidence; or that nothing is missing, or that nothing known
    explains the error. Judged on the held-out logs; without any, on the last part of each log."""
    answer = _btr.diagnose(model._model, _all(logs), _all(held_out), max_effects, tell)
    return DiagnoseResult(json.loads(answer))


def add(model: Model, *effects: str) -> Model:
    """The model with effects (`"coulomb_friction@knee"`) in it, free to fit."""
    return model.add(*effects)


def fit(
    model: Model,
    logs: LogLike | Iterable[LogLike],
    *,
    held_out: LogLike | Iterable[LogLike] = (),
    add: Iterable[str] = (),
    tell: Tell = _silent,
) -> FitResult:
    """The numbers in doubt at their best, with intervals, and the fitted model; `add` adds effects first."""
    document, fitted = _btr.fit(model._model, _all(logs), _all(held_out), list(add), tell)
    return FitResult(json.loads(document), Model(fitted.text, model.path))
