"""Replay of logs in MuJoCo."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btr._btr import BtrError, Log


@dataclasses.dataclass(frozen=True)
class Replayed:
    """What a log's joints did in MuJoCo, told what the log says."""

    clock_s: NDArray[np.float64]
    """Times of the log's samples, in s; shape (samples,)."""
    positions: dict[str, NDArray[np.float64]]
    """Positions of the joints as their encoders read them, in rad (m); each of shape (samples,)."""
    rmse: dict[str, float]
    """The root mean square error against the log of each joint that it measures, in rad (m)."""

    def __str__(self) -> str:
        """A line per joint."""
        return "\n".join(f"{joint}: {error:.4g} rms" for joint, error in self.rmse.items())


@contextlib.contextmanager
def integrated(mujoco: Any, model: Any, period_s: float) -> Iterator[int]:
    """Runge-Kutta steps that divide the period, no longer than the model's: how many. The model is as before then."""
    kept = model.opt.timestep, model.opt.integrator
    steps = max(1, math.ceil(period_s / model.opt.timestep - 1e-6))
    model.opt.timestep, model.opt.integrator = period_s / steps, mujoco.mjtIntegrator.mjINT_RK4
    try:
        yield steps
    finally:
        model.opt.timestep, model.opt.integrator = kept


def driven(model: Any, log: Log) -> dict[str, list[int]]:
    """The actuators of each joint whose command the log has."""
    actuators: dict[str, list[int]] = {}
    for actuator in range(model.nu):
        if model.actuator_trntype[actuator] == 0:
            actuators.setdefault(model.joint(model.actuator_trnid[actuator, 0]).name, []).append(actuator)
    found = {joint: all_of for joint, all_of in actuators.items() if f"cmd_{joint}" in log}
    if not found:
        raise BtrError(
            "the log has a command for no joint that the MuJoCo model drives\n"
            "help: load it with the model whose [channels] name its columns: load_log(path, model=model)"
        )
    return found


def run(mujoco: Any, model: Any, log: Log, stepper: Any, steps: int, period_s: float) -> dict[str, list[float]]:
    """Positions of the measured joints at the log's samples."""
    actuators, clock_s = driven(model, log), log.clock_s
    commands = {joint: log[f"cmd_{joint}"] for joint in actuators}
    joints = [model.joint(j).name for j in range(model.njnt)]
    measured = [joint for joint in joints if joint and f"q_{joint}" in log]
    data = mujoco.MjData(model)
    for joint in measured:
        data.joint(joint).qpos[0] = log[f"q_{joint}"][0]
        if f"dq_{joint}" in log:
            data.joint(joint).qvel[0] = log[f"dq_{joint}"][0]
    positions: dict[str, list[float]] = {joint: [] for joint in measured}
    done = 0
    for sample, t in enumerate(clock_s):
        # Counted from the beginning: rounding does not add up.
        due = round((t - clock_s[0]) / period_s * steps)
        for _ in range(due - done):
            stepper.step(data)
        done = due
        readings: Mapping[str, float] = stepper.readings(data)
        for joint in measured:
            positions[joint].append(readings.get(joint, float(data.joint(joint).qpos[0])))
        for joint, command in commands.items():
            if np.isfinite(command[sample]):
                data.ctrl[actuators[joint]] = command[sample]
    return positions


def error(log: Log, joint: str, positions: list[float]) -> float:
    """The root mean square error of a joint's positions, where the log has readings."""
    return float(np.sqrt(np.nanmean((np.array(positions) - log[f"q_{joint}"]) ** 2)))
