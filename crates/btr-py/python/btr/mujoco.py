"""Effects that MJCF has no attribute for, applied around `mujoco.mj_step`.

    model = mujoco.MjModel.from_xml_path("robot_fitted.xml")
    stepper = btr.mujoco.EffectStepper(model, "robot_fitted.effects.json")
    data = mujoco.MjData(model)
    data.ctrl[:] = command
    stepper.step(data)  # in the place of mujoco.mj_step(model, data)
    measured = stepper.readings(data)

`replay` does that with a log's commands, and says how far the motion is from what the log has.

`Model.export` and `btr export` write both files. Needs the package mujoco (`btr[mujoco]`).
"""

from __future__ import annotations

import json
import math
import os
import warnings
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from btr import _replay, _sources
from btr._btr import BtrError
from btr._optional import needed
from btr._replay import Replayed
from btr._rotors import CHANGED, Transmission
from btr._sources import LogLike

_Values = Mapping[str, float]

# Each makes a filter of a joint's command from an effect's values, the time step in s and the joint's position.
_COMMANDS: dict[str, Callable[[_Values, float], Callable[[float, float], float]]] = {}


class EffectStepper:
    """Steps a MuJoCo model with further effects.

    Commands are changed before they reach the actuators (dead time, lag, rate limit, dead bands, steps, offset), dry
    friction is set anew in each step (Stribeck's, load-dependent, asymmetric), torques are added (cogging, drag), and a
    joint with backlash or elasticity gets a rotor of its own, on which its actuators act. A rotor's inertia acts where
    the file could not state it. What of the effects it does not know is in `ignored`, and a warning."""

    def __init__(self, model: Any, effects: Mapping[str, Any] | str | os.PathLike[str]) -> None:
        """`model` is a `mujoco.MjModel`, and `effects` a file that an export has written, or its content. Raises
        `BtrError` for a joint that the model does not have."""
        self._mujoco = needed("mujoco", "mujoco")
        self._model = model
        given: Mapping[str, Any]
        if isinstance(effects, (str, os.PathLike)):
            given = json.loads(Path(effects).read_text(encoding="utf-8"))
        else:
            given = effects
        self.ignored: list[str] = [f"robot: {values['effect']}" for values in given.get("robot", [])]
        """The effects that it does not know, as `joint: effect`."""
        self._joints = [_Joint(model, name, found) for name, found in given.get("joints", {}).items()]
        for joint in self._joints:
            self.ignored.extend(joint.ignored)
        if self.ignored:
            warnings.warn(f"EffectStepper does not apply {', '.join(self.ignored)}", stacklevel=2)

    def reset(self) -> None:
        """Forgets earlier commands and readings, as after `mujoco.mj_resetData`."""
        for joint in self._joints:
            joint.reset()

    def step(self, data: Any) -> None:
        """One step of `mujoco.mj_step` with the effects. `data.ctrl`, `data.qfrc_applied` and the model are the
        caller's: they are the same afterwards."""
        command, applied = np.array(data.ctrl), np.array(data.qfrc_applied)
        kept = {name: np.array(getattr(self._model, name)) for name in ("dof_frictionloss", "dof_damping", *CHANGED)}
        for joint in self._joints:
            joint.act(self._model, data)
        self._mujoco.mj_step(self._model, data)
        data.ctrl[:], data.qfrc_applied[:] = command, applied
        for name, values in kept.items():
            getattr(self._model, name)[:] = values
        for joint in self._joints:
            joint.read(data)

    def readings(self, data: Any) -> dict[str, float]:
        """What the encoders of the joints with effects read, in rad (m): late and off by their offsets."""
        return {joint.name: joint.reading(data) for joint in self._joints}


def replay(model: Any, log: LogLike, effects: Mapping[str, Any] | str | os.PathLike[str] | None = None) -> Replayed:
    """Simulates a log's commands in a `mujoco.MjModel` from the log's first sample, with the effects that an export has
    written beside the model. Steps are those of the model, shortened to divide the log's period, and Runge-Kutta's: a
    file's default, Euler at 2 ms, errs by several noise floors. Load a log with foreign names or units by
    `load_log(path, model=model)`. Raises `BtrError` for a log without a command or reading of the model's joints."""
    mujoco, log = needed("mujoco", "mujoco"), _sources.read(log, None, None)
    if len(log.clock_s) < 2:
        raise BtrError("a log of one sample has nothing to replay")
    period_s = float(np.median(np.diff(log.clock_s)))
    with _replay.integrated(mujoco, model, period_s) as steps:
        stepper = EffectStepper(model, {} if effects is None else effects)
        positions = _replay.run(mujoco, model, log, stepper, steps, period_s)
    rmse = {joint: _replay.error(log, joint, values) for joint, values in positions.items()}
    return Replayed(log.clock_s, {joint: np.array(values) for joint, values in positions.items()}, rmse)


class _Joint:
    """The effects in one joint."""

    def __init__(self, model: Any, name: str, effects: list[dict[str, Any]]) -> None:
        try:
            joint = model.joint(name)
        except KeyError:
            missing = f"the MuJoCo model has no joint `{name}`\nhelp: export into the file of this model"
            raise BtrError(missing) from None
        self.name = name
        self._at, self._dof = int(joint.qposadr[0]), int(joint.dofadr[0])
        drives = (model.actuator_trntype == 0) & (model.actuator_trnid[:, 0] == joint.id)
        self._actuators = np.flatnonzero(drives)
        self._gears = np.array(model.actuator_gear[self._actuators, 0])
        self._dt_s = float(model.opt.timestep)
        self._model, self._joint, self._effects = model, int(joint.id), effects
        self.reset()
        known = {*_COMMANDS, *_TORQUES, *_READINGS, *(Transmission.EFFECTS if self._transmission.is_known else ())}
        # Behind a transmission, the rotor's inertia is its own.
        if not any(values["effect"] in Transmission.EFFECTS for values in effects):
            known.add("armature")
        inertias = [float(values["inertia"]) for values in effects if values["effect"] == "armature"]
        self._rotor_inertia = sum(inertias) if "armature" in known else 0.0
        self.ignored = [f"{name}: {values['effect']}" for values in effects if values["effect"] not in known]

    def reset(self) -> None:
        self._transmission = Transmission(self._model, self._joint, self._actuators, self._effects)
        steps = max((self._late(values) for values in self._effects), default=0.0)
        self._read: deque[float] = deque(maxlen=math.ceil(steps) + 2)
        self._filters = [
            [_COMMANDS[v["effect"]](v, self._dt_s) for v in self._effects if v["effect"] in _COMMANDS]
            for _ in self._actuators
        ]

    def _late(self, values: dict[str, Any]) -> float:
        """How many steps old a reading is."""
        return float(values["delay"]) / self._dt_s if values["effect"] == "encoder_delay" else 0.0

    def act(self, model: Any, data: Any) -> None:
        q, dq = float(data.qpos[self._at]), float(data.qvel[self._dof])
        of_motor = self._transmission.arrive(q, dq)
        for actuator, gear, filters in zip(self._actuators, self._gears, self._filters, strict=True):
            # Commands of an actuator with a gear are positions before it.
            command = float(data.ctrl[actuator]) / gear
            for changed in filters:
                command = changed(command, of_motor)
            data.ctrl[actuator] = command * gear
        self._transmission.act(model, data)
        model.dof_armature[self._dof] += self._rotor_inertia
        # A torque is constant during the step: it is that of the middle.
        q_mid = q + 0.5 * self._dt_s * dq
        dq_mid = dq + 0.5 * self._dt_s * float(data.qacc[self._dof])
        for values in self._effects:
            if values["effect"] in _TORQUES:
                load = float(data.qfrc_actuator[self._dof])
                torque, friction, damping = _TORQUES[values["effect"]](values, q_mid, dq_mid, load)
                data.qfrc_applied[self._dof] += torque
                model.dof_frictionloss[self._dof] += friction
                model.dof_damping[self._dof] += damping

    def read(self, data: Any) -> None:
        self._transmission.settle(data)
        self._read.append(float(data.qpos[self._at]))

    def reading(self, data: Any) -> float:
        late = max((self._late(values) for values in self._effects), default=0.0)
        q = _ago(self._read, late) if self._read else float(data.qpos[self._at])
        for values in self._effects:
            q = _READINGS.get(values["effect"], _as_it_is)(values, q)
        return q


def _ago(past: deque[float], steps: float) -> float:
    """A value some steps ago, interpolated; the first one where that is too long ago."""
    last = len(past) - 1
    whole, part = int(steps), steps - int(steps)
    newer, older = past[max(last - whole, 0)], past[max(last - whole - 1, 0)]
    return newer + part * (older - newer)


def _delay(values: _Values, dt_s: float) -> Callable[[float, float], float]:
    steps = values["delay"] / dt_s
    past: deque[float] = deque(maxlen=math.ceil(steps) + 2)

    def late(command: float, q: float) -> float:
        past.append(command)
        return _ago(past, steps)

    return late


def _following(part: Callable[[float], float]) -> Callable[[float, float], float]:
    """A command that is followed in part in each step; at its mean over the step."""
    state: list[float] = []

    def follow(command: float, q: float) -> float:
        before = state[0] if state else command
        state[:] = [before + part(command - before)]
        return 0.5 * (before + state[0])

    return follow


def _rate_limit(values: _Values, dt_s: float) -> Callable[[float, float], float]:
    most = values["rate"] * dt_s
    return _following(lambda error: min(max(error, -most), most))


def _lag(values: _Values, dt_s: float) -> Callable[[float, float], float]:
    covered = -math.expm1(-dt_s / values["time_constant"])
    return _following(lambda error: error * covered)


def _deadband(values: _Values, dt_s: float) -> Callable[[float, float], float]:
    band = values["band"]
    return lambda command, q: q if abs(command - q) <= band else command - math.copysign(band, command - q)


def _offset(values: _Values, dt_s: float) -> Callable[[float, float], float]:
    return lambda command, q: command + values["offset"]


def _scale(values: _Values, dt_s: float) -> Callable[[float, float], float]:
    return lambda command, q: (1.0 + values["error"]) * command


def _resolution(values: _Values, dt_s: float) -> Callable[[float, float], float]:
    step = values["step"]
    return lambda command, q: step * math.copysign(math.floor(abs(command) / step + 0.5), command)


def _hysteresis(values: _Values, dt_s: float) -> Callable[[float, float], float]:
    goal: list[float] = []

    def kept(command: float, q: float) -> float:
        if not goal or abs(command - goal[0]) > values["band"]:
            goal[:] = [command]
        return goal[0]

    return kept


def _reads_off(values: _Values, dt_s: float) -> Callable[[float, float], float]:
    return lambda command, q: command - values["offset"]


_COMMANDS.update(
    command_delay=_delay,
    command_rate_limit=_rate_limit,
    motor_lag=_lag,
    command_deadband=_deadband,
    command_offset=_offset,
    command_scale=_scale,
    command_resolution=_resolution,
    command_hysteresis=_hysteresis,
    # The servo closes its loop on what its encoder reads.
    encoder_offset=_reads_off,
)


def _cogging(v: _Values, q: float, dq: float, load: float) -> tuple[float, float, float]:
    return v["amplitude"] * math.sin(v["order"] * q + v["phase"]), 0.0, 0.0


def _drag(v: _Values, q: float, dq: float, load: float) -> tuple[float, float, float]:
    return -v["coefficient"] * abs(dq) * dq, 0.0, 0.0


def _stribeck(v: _Values, q: float, dq: float, load: float) -> tuple[float, float, float]:
    # Coulomb's part is in the file, as frictionloss.
    above = max(v["static"] - v["coulomb"], 0.0)
    return 0.0, above * math.exp(-((dq / v["velocity"]) ** 2)), 0.0


def _load_dependent(v: _Values, q: float, dq: float, load: float) -> tuple[float, float, float]:
    return 0.0, v["ratio"] * abs(load), 0.0


def _asymmetric(v: _Values, q: float, dq: float, load: float) -> tuple[float, float, float]:
    side = "forward" if dq >= 0.0 else "backward"
    return 0.0, v[f"coulomb_{side}"], v[f"viscous_{side}"]


# What an effect adds in a joint: torque in N·m, dry friction in N·m, damping in N·m·s/rad; by its values, position,
# velocity and the torque of the joint's actuators.
_TORQUES: dict[str, Callable[[_Values, float, float, float], tuple[float, float, float]]] = {
    "cogging": _cogging,
    "quadratic_drag": _drag,
    "stribeck_friction": _stribeck,
    "load_dependent_friction": _load_dependent,
    "asymmetric_friction": _asymmetric,
}


def _as_it_is(v: _Values, q: float) -> float:
    return q


_READINGS: dict[str, Callable[[_Values, float], float]] = {
    "encoder_offset": lambda v, q: q + v["offset"],
    "encoder_delay": _as_it_is,
}
