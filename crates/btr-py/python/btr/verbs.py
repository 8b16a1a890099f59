"""The verbs: what one asks of a model and its logs."""

from __future__ import annotations

import glob
import json
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btr import _btr, _times, _warnings, rosbag
from btr import _laws as own
from btr._btr import Log
from btr._inputs import count, floats, must_be_called, wrong
from btr._laws import Law, Number
from btr.executors import ExecutorLike, hands_of
from btr.results import CheckResult, CompareResult, DiagnoseResult, EffectsResult, FitResult

if TYPE_CHECKING:
    from btr.coevolution import Controller

LogLike = Union[str, os.PathLike[str], Log, Any]
"""A path (.csv, .csv.gz, .mcap, a LeRobot data set's folder; verbs take patterns like `"monday/*.csv"`, too), a `Log`, or
columns by name with `t` in seconds (or as times): a pandas or polars frame, or a mapping of arrays. The `[channels]` of the
model it is for say what foreign names mean."""
Given = Union[Log, Path, tuple[str, Log]]
"""A log, or where it is, or what it is called and the log."""
Points = Union[ArrayLike, Mapping[str, ArrayLike], Any]
"""Points of a space, a row for each; or columns by name, in a mapping or a frame."""
Tell = Callable[[str, float, Union[float, None]], None]
"""Hears every step of the error's fall: what was done, the error on the logs to learn from, on held-out ones (None without
any), both in multiples of the noise floor. Called on another thread."""


class Model:
    """A robot's model: the text of a model file, and where relative paths in it begin."""

    def __init__(self, text: str, path: str | os.PathLike[str] = "model.toml", laws: Mapping[str, Law] | None = None) -> None:
        """A model of a text; raises `BtrError` where that makes no sense, with its line. `laws` are the functions that the
        text names: `law = "python:slip"` needs `{"slip": slip}`."""
        functions = own.by_text(laws or {})
        self._laws = dict(laws or {})
        self._model = _btr.Model(text, Path(path), functions)
        own.must_fit(self._laws, self._model.laws)

    @property
    def text(self) -> str:
        """The text of the model file, TOML."""
        return self._model.text

    @property
    def path(self) -> Path:
        """Where it stands, or would stand."""
        return Path(self._model.path)

    @property
    def laws(self) -> dict[str, Law]:
        """The functions that the text names."""
        return dict(self._laws)

    @property
    def name(self) -> str:
        """What it is called."""
        return self._model.name

    @property
    def joints(self) -> list[str]:
        """The joints that can move, in order."""
        return self._model.joints

    def simulate(self, log: LogLike | Controller | None = None, *, seed: int | None = None) -> Log:
        """One rollout: of the model's own drive, or told what `log` says the robot was told. Sampled on the model's clock
        from 0 s on, a row per `sample_every` steps of its `[simulation]`, not at the log's stamps. With noise of the model's
        sensors (its `[noise]`; without one there is none) if there is a seed. Raises `BtrError` where the simulation blows up
        or the log does not fit the model.

        It begins where the log's first positions are, and where the model's robot stands if it has none. Commands alone do not
        say where the loop begins (its drive may put a robot down elsewhere) nor when it ends: a `btr.Controller` of `coevolve`
        does, and what is simulated of it is what the loop simulates."""
        seed = None if seed is None else count(seed, "seed")
        told, begins = _told(log, self)
        return self._model.simulate(told, seed, begins)

    @property
    def parameters(self) -> list[dict[str, Any]]:
        """The numbers in doubt, S: each with its `name`, `unit`, bounds (`min`, `max`), `scale` between these (`linear` or
        `log`) and `nominal` value."""
        space: list[dict[str, Any]] = json.loads(self._model.spaces[0])
        return space

    @property
    def values(self) -> dict[str, float]:
        """The nominal values of the numbers in doubt, by name; the middle of the bounds (the geometric one on a `log` scale)
        where there is none."""
        return dict(zip((dim["name"] for dim in self.parameters), self._model.nominal[0]))

    def at(self, values: Mapping[str, float] | ArrayLike) -> Model:
        """The model with other nominal values of the numbers in doubt: by name, as `FitResult.values` has them, or all of
        them in an array of shape (len(self.parameters),). Raises `BtrError` for a name that is none of them and for a value
        outside its bounds, `ValueError` for another shape."""
        if isinstance(values, Mapping):
            places = self._model.places(False, list(values), "parameters")
            numbers = [float(floats(value, f"{name} is a number")) for name, value in values.items()]
            return self._with_text(self._model.at(list(zip(places, numbers))))
        point = floats(values, "values are numbers by name, or an array of them")
        if point.shape != (len(self.parameters),):
            raise ValueError(f"a point has shape {point.shape} where ({len(self.parameters)},) is needed")
        return self._with_text(self._model.at(list(enumerate(point.tolist()))))

    @property
    def controllers(self) -> list[dict[str, Any]]:
        """The numbers of the drive that are searched, C, as `parameters` are told; empty where it is fixed."""
        space: list[dict[str, Any]] = json.loads(self._model.spaces[1])
        return space

    def simulate_all(
        self,
        parameters: Points | None = None,
        controllers: Points | None = None,
        *,
        log: LogLike | Controller | None = None,
    ) -> list[Log | None]:
        """Many rollouts on all cores, several at once on each: `parameters` of shape (rollouts, len(self.parameters)) in
        their units, or `controllers` of shape (rollouts, len(self.controllers)), or both; or only some of either by name, as
        arrays of shape (rollouts,) or single numbers (`{"mass@bob": [0.5, 1.0, 2.0]}`, or a frame with such columns). What is
        left out has its nominal values. Driven and sampled as `simulate` does, without noise. None stands for a simulation
        that blew up. Raises `BtrError` for names that are not there and points outside their bounds, `ValueError` for wrong
        shapes."""
        s, c = _table(parameters), _table(controllers)
        rollouts = max(_rollouts(s), _rollouts(c))
        if rollouts == 0:
            raise ValueError("simulate_all needs parameters, controllers, or both: a row for every rollout, or columns by name")
        if log is not None and c is not None:
            raise ValueError("a log says what joints are told: controllers have no say then")
        rows_s, rows_c = _rows(s, self._model, "parameters", rollouts), _rows(c, self._model, "controllers", rollouts)
        return self._model.simulate_all(rows_s, rows_c, *_told(log, self))

    def add(self, *effects: str) -> Model:
        """The model with effects (`"coulomb_friction@knee"`; without a site, one at every site that it can have, all with the
        same numbers) in it, free to fit. Raises `BtrError` for an effect or a site that is not there."""
        return self._with_text(self._model.add(list(effects)))

    def add_law(self, law: str | Law, /, *, site: str, on: str = "torque", **parameters: Number) -> Model:
        """The model with a physical effect of your own at the joints `site`. On their `torque` a law adds: what it gives (in
        N·m or N) acts beside the motor's. On the `command` that reaches the servo, or on the `reading` that servo and log have
        of the position (both in rad or m), it replaces: what it gives is the new one. `"cmd + a*dq"` changes a command and
        `"q + a*dq"` a reading, where `"a*dq"` alone would forget them.

            model.add_law("-a*tanh(dq/b)", site="elbow", a=(0.0, 2.0), b=0.1)

        `law` is an expression, which the command line understands as well (`btr effects formula` lists what it may say), or a
        function `law(q, dq, ddq, cmd, tau, t, **parameters)` of position, velocity, acceleration (of the last step), command,
        motor torque (of the last step) and time, all SI. Parameters are numbers, or bounds `(least, most)` between which a
        fit looks from their middle on (the geometric one if both are positive); it calls them `formula.a@elbow`.

        A function is much slower: `-a*dq` takes 0.5 µs a call, with three calls per step and joint for a torque, all of them
        on one core, unless `executor=` of a verb hands the work to several processes. 4 s of a desk arm in steps of 1 ms take
        8 ms, and 2.7 ms with the expression. Its answer may depend on nothing but its arguments: it is asked more than once in
        a step, for velocities nearby too, and on a thread of its own. What it raises ends the verb and arrives; an answer that
        is not finite is a `BtrError`. It stays in memory once it was used. The text has its name only: whoever reads a saved
        file gives the function along (`load_model(..., laws=...)`), and pickles hold it as they hold functions, with
        cloudpickle's help where it has no module.

        Raises `BtrError` for a law or a joint that makes no sense and for names that are taken, `TypeError` for wrong kinds
        and for a function that does not take the parameters."""
        numbers, laws = own.numbers(parameters), self._laws
        if isinstance(law, str):
            text = law
        elif callable(law):
            own.must_take(law, parameters)
            name = own.name_of(law, laws)
            text, laws = own.in_text(name), {**laws, name: law}
        else:
            raise TypeError(f"a law is an expression or a function, not {type(law).__name__}")
        return Model(self._model.with_law(text, site, on, numbers), self.path, laws)

    def _with_text(self, text: str) -> Model:
        """A model of another text that stands at the same place and has the same functions."""
        return Model(text, self.path, self._laws)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the model file, whole or not at all; the files that it names are found from there. Raises `BtrError` where
        its name does not end in `.toml`, so that no log is written over, or it cannot be written."""
        if Path(path).suffix != ".toml":
            raise _btr.BtrError(f"{path}: the name of a model ends in .toml")
        self._model.save(Path(path))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and ((self.text, self.path, self._laws) == (other.text, other.path, other._laws))

    __hash__ = None  # type: ignore[assignment]

    def __copy__(self) -> Model:
        return self

    def __deepcopy__(self, memo: object) -> Model:
        # Models never change.
        return self

    def __reduce__(self) -> tuple[type[Model], tuple[Any, ...]]:
        return Model, (self.text, self.path, own.for_pickles(self._laws))

    def __repr__(self) -> str:
        return f"<Model {self.path}: {', '.join(self.joints)}>"


Table = Union[NDArray[np.float64], dict[str, NDArray[np.float64]], None]
"""Points as they were given: rows, columns by name, or none."""


def _table(points: Any) -> Table:
    if points is None:
        return None
    names = points if isinstance(points, Mapping) else getattr(points, "columns", None)
    if names is None:
        return np.asarray(points, dtype=np.float64)
    return {str(name): np.asarray(points[name], dtype=np.float64) for name in names}


def _rollouts(table: Table) -> int:
    """How many points there are."""
    if isinstance(table, dict):
        return max((column.size for column in table.values()), default=0)
    return 0 if table is None else len(np.atleast_1d(table))


def _rows(table: Table, model: _btr.Model, what: str, rollouts: int) -> list[list[float]] | None:
    """A row for every rollout of what is called `parameters` or `controllers`."""
    if table is None:
        return None
    of_controllers = what == "controllers"
    rows, nominal = table, model.nominal[of_controllers]
    if isinstance(rows, dict):
        rows = _filled(rows, model.places(of_controllers, list(rows), what), nominal, (what, rollouts))
    if rows.shape != (rollouts, len(nominal)):
        names = ", ".join(dim["name"] for dim in json.loads(model.spaces[of_controllers]))
        needed = f"({rollouts}, {len(nominal)}) is needed: a row of {names or 'nothing'}"
        raise ValueError(f"{what} has shape {rows.shape} where {needed}")
    listed: list[list[float]] = rows.tolist()
    return listed


def _filled(
    columns: dict[str, NDArray[np.float64]], places: list[int], nominal: list[float], needed: tuple[str, int]
) -> NDArray[np.float64]:
    """Columns at their places, and nominal values at the others."""
    what, rollouts = needed
    rows = np.tile(np.array(nominal), (rollouts, 1))
    for place, (name, column) in zip(places, columns.items()):
        if column.shape not in ((), (rollouts,)):
            raise ValueError(f"{what}[{name!r}] has shape {column.shape} where ({rollouts},) is needed")
        rows[:, place] = column
    return rows


def load_model(
    path: str | os.PathLike[str], settings: Mapping[str, Any] | None = None, *, laws: Mapping[str, Law] | None = None
) -> Model:
    """The model of a file; `settings` change values of it by their dotted keys (`{"simulation.duration_s": 2.0}`), as `--set`
    does; `laws` are the functions that it names (`Model.add_law`). Raises `BtrError`, with the line, where the file makes no
    sense, `TypeError` for a function that does not take the parameters that it has there."""
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"a model is the path of a file, not {path!r}")
    if settings is not None and not isinstance(settings, Mapping):
        raise TypeError(f'settings are values by dotted keys, {{"simulation.duration_s": 2.0}}, not {settings!r}')
    texts = [f"{key}={_toml(value)}" for key, value in (settings or {}).items()]
    model = _btr.Model.read(Path(path), texts, own.by_text(laws or {}))
    return Model(model.text, path, laws)


def _toml(value: Any) -> str:
    if isinstance(value, (tuple, np.ndarray, np.generic)):
        value = np.asarray(value).tolist()
    if not isinstance(value, (bool, str, int, float, list, dict)):
        raise TypeError(f"a setting is a number, a text, a list or a table, not {value!r}")
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_toml(inner)}" for key, inner in value.items()) + "}"
    return json.dumps(value)


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


def _told(log: LogLike | Controller | None, model: Model) -> tuple[Log | Path | None, _btr._Begins | None]:
    """What joints are told, and where they begin if it is not the log that says so."""
    from btr.coevolution import Controller

    if isinstance(log, Controller):
        return log.references, (list(log.start.items()), log.base, log.duration_s)
    return None if log is None else _given(log, model), None


def _is_columns(log: object) -> bool:
    """Whether this has columns by name: a mapping, a frame."""
    return isinstance(log, Mapping) or hasattr(log, "columns")


def _is_one(log: object) -> bool:
    """Whether this is a log, not several."""
    return isinstance(log, (str, os.PathLike, Log)) or _is_columns(log) or rosbag.is_reader(log)


def _given(log: LogLike, model: Model) -> Log | Path:
    """A log for this model: where it is, if a file is enough."""
    if isinstance(log, (str, os.PathLike)) and not rosbag.is_bag(Path(log)):
        return Path(log)
    return load_log(log, model=model)


class _Logs:
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
        given: list[Given] = []
        for log in several:
            for path in _files(log):
                if path not in paths:
                    paths.add(path)
                    given.append(_given(path, self._model))
            if not isinstance(log, (str, os.PathLike)):
                given.append(self._in_memory(log))
        return given

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


def _loaded(model: Model | str | os.PathLike[str]) -> Model:
    """A model, or that of a file."""
    if isinstance(model, (Model, str, os.PathLike)):
        return model if isinstance(model, Model) else load_model(model)
    raise TypeError(f"a model is a Model or the path of its file, not {model!r}")


def _warned(document: dict[str, Any]) -> dict[str, Any]:
    """Says what is bad about the logs: nothing that was found can be trusted then."""
    for doubt in document["doubts"]:
        if doubt["severity"] == "bad":
            _warnings.warn(f"{doubt['log']}: {doubt['sentence']}")
    return document


def _silent(step: str, train: float, held_out: float | None) -> None:
    """Nobody listens."""


def _heard(tell: Tell | None) -> Tell:
    listener = _silent if tell is None else tell
    must_be_called(listener, "tell is a function that hears every step")
    return listener


def effects(name: str | None = None) -> EffectsResult:
    """The physical effects that btr knows, or the one of this name: law, parameters, how it shows, where it is from, and
    which others are hard to tell from it. Raises `BtrError` for one that is not there."""
    return EffectsResult(json.loads(_btr.effects(name)))


def check(model: Model | str | os.PathLike[str], logs: LogLike | Iterable[LogLike]) -> CheckResult:
    """What logs are worth before anything is fitted to them, and what they tell about the numbers in doubt. Raises `BtrError`
    for logs that cannot be read or do not fit the model."""
    model = _loaded(model)
    return CheckResult(json.loads(_btr.check(model._model, _Logs(model).all(logs))))


def compare(model: Model | str | os.PathLike[str], logs: LogLike | Iterable[LogLike]) -> CompareResult:
    """How far the model is off on every channel, in multiples of the noise floor, and where. Raises `BtrError` for logs that
    cannot be read or have no channel in common with the model."""
    model = _loaded(model)
    document, page = _btr.compare(model._model, _Logs(model).all(logs))
    return CompareResult(json.loads(document), page)


def diagnose(
    model: Model | str | os.PathLike[str],
    logs: LogLike | Iterable[LogLike],
    *,
    held_out: LogLike | Iterable[LogLike] | None = None,
    max_effects: int = 3,
    tell: Tell | None = None,
    executor: ExecutorLike = None,
) -> DiagnoseResult:
    """Which physical effect the model lacks, on which joint, with what confidence; or that nothing is missing, or that
    nothing known explains the error. Judged on the held-out logs; without any, on the last part of each log. Errors are in
    multiples of the noise floor; `max_effects` is the most that are named, and `executor` is who does the work (see
    `btr.executors`). Raises `BtrError` for logs that tell nothing, or on which the model blows up; what `tell` raises ends
    the work."""
    model, most, hands, tell = _loaded(model), count(max_effects, "max_effects"), hands_of(executor), _heard(tell)
    given = _Logs(model)
    document, page, commands = _btr.diagnose(model._model, given.all(logs), given.all(held_out), most, tell, hands)
    return DiagnoseResult(_warned(json.loads(document)), page, commands)


def add(model: Model, *effects: str) -> Model:
    """The model with effects in it, free to fit, as `Model.add` makes it. Raises `BtrError` for an effect or a site that is
    not there."""
    return model.add(*effects)


def fit(
    model: Model | str | os.PathLike[str],
    logs: LogLike | Iterable[LogLike],
    *,
    held_out: LogLike | Iterable[LogLike] | None = None,
    add: str | Iterable[str] | None = None,
    tell: Tell | None = None,
    executor: ExecutorLike = None,
) -> FitResult:
    """The numbers in doubt at their best, with 95 % intervals and in their units, and the fitted model; `add` adds effects
    first, and `executor` is who does the work (see `btr.executors`). Raises `BtrError` where no number is in doubt, for logs
    that tell nothing, or on which the model blows up; what `tell` raises ends the work."""
    model, hands, tell = _loaded(model), hands_of(executor), _heard(tell)
    added = [add] if isinstance(add, str) else list(add or ())
    given = _Logs(model)
    document, page, space, fitted = _btr.fit(model._model, given.all(logs), given.all(held_out), added, tell, hands)
    return FitResult(_warned(json.loads(document)), page, json.loads(space), model._with_text(fitted))
