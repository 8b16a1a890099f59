"""Models: a robot, its actuators and its free parameters, and simulations of them."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btr import _btr
from btr import _laws as own
from btr._btr import Log
from btr._inputs import count, floats
from btr._laws import Law, Number
from btr._points import Points, rollouts_in, rows_of, table_of
from btr._sources import LogLike, given
from btr.controller import Controller
from btr.documents import Dimension, Posterior
from btr.exported import Exported


_NOT_REPRESENTED = "# not represented: "


class Model:
    """A robot's model: the text of a model file, and the base of its relative paths."""

    def __init__(
        self, text: str, path: str | os.PathLike[str] = "model.toml", laws: Mapping[str, Law] | None = None
    ) -> None:
        """A model from its text. `laws` are the functions that the text names: `law = "python:slip"` needs
        `{"slip": slip}`. Raises `BtrError` with the line if the text is invalid."""
        functions = own.by_text(laws or {})
        self._laws = dict(laws or {})
        self._model = _btr.Model(text, Path(path), functions)
        own.must_fit(self._laws, self._model.laws)

    @classmethod
    def from_mujoco(cls, model: Any, *, root: str | None = None) -> Model:
        """A model of the robot in a compiled MuJoCo model: a `mujoco.MjModel`, a `mujoco.MjSpec`, or the path of an
        MJCF, URDF or `.mjb` file. Needs the package mujoco (`btr[mujoco]`).

        Bodies, inertias, hinges, slides, a free base, rotors (armature), damping, frictionloss, springs, ranges, linear
        equalities of two joints, gravity, the time step, contact shapes on a floating base, and one actuator per joint
        (motor, position, velocity, DC motor, or a general one with an affine bias; with its gear, force limits, filter
        and delay) become btr's. The model's text holds the robot's URDF; masses and gains are free. Everything else is
        listed in `not_represented`. Where an actuator has a gear or a gain, btr's command is not MuJoCo's control but a
        position or a torque at the joint; the text says the factor.

        `root` is the first body of the robot in a scene with several. Without it, bodies that only float are objects
        beside the robot and are left out.

        Raises `BtrError` for what would make the model false (closed loops, flexes, ball joints, gravity not along z),
        for several robots, and if MuJoCo does not compile the file; `ImportError` without mujoco; `TypeError` for
        anything that is no model."""
        from btr._mujoco import described

        robot = described(model, root)
        return cls(_btr.new_model(json.dumps(robot)), f"{robot['name'].replace('/', '_')}.toml")

    @property
    def not_represented(self) -> list[str]:
        """What the robot's own file states and btr cannot represent, in words: the lines `# not represented: ...` of
        the text, which `from_mujoco` and `btr new` write."""
        marked = (line.partition(_NOT_REPRESENTED) for line in self.text.splitlines())
        return [what for before, mark, what in marked if mark and not before]

    @property
    def text(self) -> str:
        """The text of the model file, TOML."""
        return self._model.text

    @property
    def path(self) -> Path:
        """Path of the model file, existing or not."""
        return Path(self._model.path)

    @property
    def urdf(self) -> str:
        """The text of the robot's URDF, as it stands in the file that the model names or in the model; of a built-in
        robot, as btr writes it. What the model says beside its URDF is not in it: see `export`. Raises `BtrError` if
        the file cannot be read."""
        return self._model.urdf

    @property
    def laws(self) -> dict[str, Law]:
        """The functions that the text names."""
        return dict(self._laws)

    @property
    def name(self) -> str:
        """Name of the model."""
        return self._model.name

    @property
    def joints(self) -> list[str]:
        """The joints that can move, in order."""
        return self._model.joints

    def simulate(self, log: LogLike | Controller | None = None, *, seed: int | None = None) -> Log:
        """One rollout, with the model's own drive or with the commands of `log`. Sampled on the model's clock from 0 s
        on, one row per `sample_every` steps of its `[simulation]`, not at the log's timestamps. With a seed, sensor
        noise as given in the model's `[noise]` (if any) is added. Raises `BtrError` if the simulation diverges or the
        log does not match the model.

        The rollout starts at the log's first positions, or at the robot's initial pose if the log has none. Commands
        alone contain neither the initial pose of the loop's tests (the drive may start from another pose) nor their
        duration. A `btr.Controller` of `coevolve` contains both; simulating it reproduces the loop's simulation."""
        seed = None if seed is None else count(seed, "seed")
        commands, start = _commands_of(log, self._model)
        return self._model.simulate(commands, seed, start)

    def accelerations(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        torques: ArrayLike,
        *,
        base: tuple[ArrayLike, ArrayLike] | None = None,
    ) -> NDArray[np.float64]:
        """Forward dynamics in a state: of links, rotors, springs and damping under gravity and `torques`; without
        motors, dry friction, limits and contacts. `q`, `dq` and `torques` have shape (len(self.joints),), in rad, rad/s
        and N·m (m, m/s and N for slides). `base` is a floating base's pose (7,), x, y, z in m and the quaternion w, x,
        y, z, and its velocity (6,), linear in m/s and angular in rad/s, in the world's axes.

        Returns the joints' accelerations in rad/s² (m/s²), after those of a floating base: three angular ones in rad/s²
        and three linear ones in m/s², in the world's axes. Raises `ValueError` for wrong shapes."""
        many = len(self.joints)
        held = None if base is None else (_row(base[0], 7, "base's pose"), _row(base[1], 6, "base's velocity"))
        state = _row(q, many, "q"), _row(dq, many, "dq"), _row(torques, many, "torques")
        return np.array(self._model.accelerations(*state, held), dtype=np.float64)

    @property
    def parameters(self) -> list[Dimension]:
        """The free parameters, S: each with `name`, `unit`, bounds (`min`, `max`), `scale` between the bounds (`linear`
        or `log`) and `nominal` value."""
        return [Dimension(dim) for dim in json.loads(self._model.spaces[0])]

    @property
    def values(self) -> dict[str, float]:
        """Nominal values of the free parameters by name; without one, the middle of the bounds (the geometric mean on a
        `log` scale)."""
        return dict(zip((dim.name for dim in self.parameters), self._model.nominal[0]))

    def at(self, values: Mapping[str, float] | ArrayLike) -> Model:
        """The model with other nominal values of the free parameters: by name, as in `FitResult.values`, or all of them
        in an array of shape (len(self.parameters),). Raises `BtrError` for an unknown name or a value outside its
        bounds, `ValueError` for another shape."""
        if isinstance(values, Mapping):
            places = self._model.places(False, list(values), "parameters")
            numbers = [float(floats(value, f"{name} is a number")) for name, value in values.items()]
            return self._with_text(self._model.at(list(zip(places, numbers))))
        point = floats(values, "values are numbers by name, or an array of them")
        if point.shape != (len(self.parameters),):
            raise ValueError(f"a point has shape {point.shape}, but ({len(self.parameters)},) is needed")
        return self._with_text(self._model.at(list(enumerate(point.tolist()))))

    @property
    def controllers(self) -> list[Dimension]:
        """The searched parameters of the drive, C, in the form of `parameters`; empty for a fixed drive."""
        return [Dimension(dim) for dim in json.loads(self._model.spaces[1])]

    def simulate_all(
        self,
        parameters: Points | None = None,
        controllers: Points | None = None,
        *,
        log: LogLike | Controller | None = None,
    ) -> list[Log | None]:
        """Runs many rollouts on all cores, with SIMD on each: `parameters` of shape (rollouts, len(self.parameters)) in
        their units, `controllers` of shape (rollouts, len(self.controllers)), or both. Either may give only some values
        by name, as arrays of shape (rollouts,) or single numbers (`{"mass@bob": [0.5, 1.0, 2.0]}`, or a frame with such
        columns); the others keep their nominal values. Driven and sampled as in `simulate`, without noise. A simulation
        that diverged is None. Raises `BtrError` for unknown names and points outside their bounds, `ValueError` for
        wrong shapes."""
        s, c = table_of(parameters), table_of(controllers)
        rollouts = max(rollouts_in(s), rollouts_in(c))
        if rollouts == 0:
            what = "simulate_all needs parameters, controllers, or both"
            raise ValueError(f"{what}: one row per rollout, or columns by name")
        if log is not None and c is not None:
            raise ValueError("with a log, its commands drive the joints: controllers would have no effect")
        rows_s = rows_of(s, self._model, "parameters", rollouts)
        rows_c = rows_of(c, self._model, "controllers", rollouts)
        return self._model.simulate_all(rows_s, rows_c, *_commands_of(log, self._model))

    def add(self, *effects: str) -> Model:
        """The model with added effects, their parameters free (`"coulomb_friction@knee"`; without a site, at every
        possible site with parameters of its own; `"coulomb_friction@*"` shares them). Raises `BtrError` for an unknown
        effect or site."""
        return self._with_text(self._model.add(list(effects)))

    def remove(self, *effects: str) -> Model:
        """The model without effects and their parameters, free or not: the reverse of `add`. `"coulomb_friction@knee"`
        names the site as the model's text does, and `"coulomb_friction"` means all sites. Raises `BtrError` for an
        effect that the model does not have there."""
        return self._with_text(self._model.remove(list(effects)))

    def add_law(self, law: str | Law, /, *, site: str, on: str = "torque", **parameters: Number) -> Model:
        """The model with a user-defined physical effect at the joints `site`. On a `torque`, the law's value (in N·m or
        N) is added to the motor's. On the `command` that reaches the servo, or on the `reading` of the position that
        servo and log receive (both in rad or m), the law's value replaces it: `"cmd + a*dq"` changes a command and
        `"q + a*dq"` a reading, whereas `"a*dq"` alone would discard them.

            model.add_law("-a*tanh(dq/b)", site="elbow", a=(0.0, 2.0), b=0.1)

        `law` is an expression, which the command line also supports (`btr effects formula` lists its syntax), or a
        function `law(q, dq, ddq, cmd, tau, t, **parameters)` of position, velocity, acceleration (of the last step),
        command, motor torque (of the last step) and time, all in SI units. An expression on a torque or a command may
        also contain `q_parent`, `dq_parent`, `tau_parent` of the nearest movable joint towards the base and `q_child`,
        `dq_child`, `tau_child` of the first one further out, as at the beginning of a step; a function does not get
        them. Parameters are numbers, or bounds `(least, most)` of a fit that starts at their middle (the geometric mean
        if both are positive). In the fit they are named `formula.a@elbow`.

        A function is much slower: `-a*dq` takes 0.5 µs per call, with three calls per step and joint for a torque, all
        on one core unless the `executor=` of a verb distributes the work over several processes. 4 s of a desk arm in
        steps of 1 ms take 8 ms, and 2.7 ms with the expression. The function must depend on its arguments only: it is
        called several times per step, also for nearby velocities, and on a separate thread. Its exceptions end the verb
        and are raised there; a result that is not finite raises `BtrError`. A function that was used stays in memory.
        The model's text contains only its name: loading a saved file requires the function (`load_model(...,
        laws=...)`). Pickles refer to it as to any function, and use cloudpickle if it cannot be imported.

        Raises `BtrError` for an invalid law or joint and for names that are taken, `TypeError` for wrong types and for
        a function that does not take the parameters."""
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
        """A model of another text with the same path and the same functions."""
        return Model(text, self.path, self._laws)

    def export(
        self,
        to: str,
        robot: str | os.PathLike[str] | None = None,
        *,
        step_s: float = 0.005,
        randomize: Posterior | None = None,
    ) -> Exported:
        """What the model says, in a format of another simulator: `"mujoco"`, `"urdf"`, `"isaac-lab"` or `"ros2"`.
        `robot` is your file that is to be changed (MJCF, or URDF; by default the model's own URDF); only the numbers in
        it change. `step_s` is the physics step in s in which Isaac Lab counts delays. With `randomize`,
        the `posterior` of the fit that the model is from, Isaac Lab also gets ranges for domain randomisation; for MJCF
        and URDF export models at `FitResult.draws`. Raises `BtrError` for a file that is missing or of another kind."""
        posterior = None if randomize is None else json.dumps(randomize)
        place = None if robot is None else Path(robot)
        text, (carried, left, advice), effects = self._model.export(to, place, step_s, posterior)
        return Exported(text, carried, left, None if effects is None else json.loads(effects), advice)

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Writes the model file atomically, with the paths in it adapted to its folder. An earlier model is replaced,
        but with `overwrite` alone the file that this model was made from. Raises `BtrError` for that file, if the name
        does not end in `.toml` (so that no log is overwritten), and if the file cannot be written."""
        into = Path(path)
        if into.suffix != ".toml":
            raise _btr.BtrError(f"{path}: the name of a model must end in .toml")
        if not overwrite and self._is_own_file(into):
            raise _btr.BtrError(f"{path}: this model was made from it; give another name, or overwrite=True")
        self._model.save(into)

    def _is_own_file(self, path: Path) -> bool:
        """Whether a file is the one that this model was made from, with another text."""
        if not (path.is_file() and Path(self.path).is_file() and path.samefile(self.path)):
            return False
        return path.read_text(encoding="utf-8") != self.text

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Model):
            return False
        return (self.text, self.path, self._laws) == (other.text, other.path, other._laws)

    __hash__ = None  # type: ignore[assignment]

    def __copy__(self) -> Model:
        return self

    def __deepcopy__(self, memo: object) -> Model:
        # Models are immutable.
        return self

    def __reduce__(self) -> tuple[type[Model], tuple[Any, ...]]:
        return Model, (self.text, self.path, own.for_pickles(self._laws))

    def __repr__(self) -> str:
        return f"<Model {self.path}: {', '.join(self.joints)}>"


def _row(values: ArrayLike, many: int, what: str) -> list[float]:
    array = floats(values, f"{what} has numbers")
    if array.shape != (many,):
        raise ValueError(f"{what} has shape {array.shape}, but ({many},) is needed")
    return list(map(float, array))


def _commands_of(log: LogLike | Controller | None, model: _btr.Model) -> tuple[Log | Path | None, _btr._Begins | None]:
    """The log with the commands, and the start of the rollout if it is not that of the log."""
    if isinstance(log, Controller):
        return log.references, (list(log.start.items()), log.base, log.duration_s)
    return None if log is None else given(log, model), None


def load_model(
    path: str | os.PathLike[str], settings: Mapping[str, Any] | None = None, *, laws: Mapping[str, Law] | None = None
) -> Model:
    """Loads a model file. `settings` override values by their dotted keys (`{"simulation.duration_s": 2.0}`), as
    `--set` does; `laws` are the functions that the file names (`Model.add_law`). Raises `BtrError` with the line if the
    file is invalid, `TypeError` for a function that does not take the parameters given in the file."""
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


def loaded(model: Model | str | os.PathLike[str]) -> Model:
    """The model itself, or the model of a file."""
    if isinstance(model, (Model, str, os.PathLike)):
        return model if isinstance(model, Model) else load_model(model)
    raise TypeError(f"a model is a Model or the path of its file, not {model!r}")
