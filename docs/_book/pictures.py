"""A picture of each effect's signature: a robot is simulated with and without it, and the difference drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import svg
from numpy.typing import ArrayLike, NDArray

import btr

Values = NDArray[np.float64]
Commands = Mapping[str, Values]
JOINTS = ("yaw", "shoulder", "elbow")
END_S, STEP_S = 6.0, 0.01
CLOCK = np.arange(0.0, END_S + STEP_S / 2, STEP_S)


def swinging(size: float = 1.0, speed: float = 1.0) -> Commands:
    """From rest, fast and slow, each joint another way."""
    rise = size * (1.0 - np.exp(-2.0 * CLOCK))
    rates = {joint: speed * (1.3 + 0.35 * k) for k, joint in enumerate(JOINTS)}
    return {j: rise * (0.6 * np.sin(w * CLOCK) + 0.25 * np.sin(2.6 * w * CLOCK)) for j, w in rates.items()}


def stepping() -> Commands:
    """Steps, held until the joint stands."""
    levels = np.array([0.0, 0.6, -0.3, 0.4, -0.6, 0.2])
    return {j: np.roll(levels, 2 * k)[np.minimum(CLOCK, END_S - STEP_S).astype(int)] for k, j in enumerate(JOINTS)}


def slow() -> Commands:
    """Slow and small."""
    return {joint: 0.12 * np.sin(1.1 * CLOCK) for joint in JOINTS}


def fast() -> Commands:
    """Large and fast."""
    return swinging(1.3, 1.5)


def repeated() -> Commands:
    """The same motion again and again."""
    return {joint: 0.5 * np.sin(2.0 * np.pi * CLOCK) for joint in JOINTS}


@dataclass(frozen=True)
class Shown:
    """How an effect is shown: a motion, the channel that is drawn, and what it follows."""

    follows: str
    motion: Callable[[], Commands] = swinging
    site: str = "shoulder"
    # Joints follow the motion exactly, and torques are compared.
    prescribed: bool = False
    # Values in the place of the typical ones.
    values: Mapping[str, float] | None = None
    # What the model has: an effect that changes another one needs that.
    beside: str = ""


VELOCITY, POSITION, LOAD, COMMAND = "velocity", "position", "torque", "speed of the command"
ACCELERATION, TIME = "acceleration", "time"
DRY = '[[effects]]\neffect = "coulomb_friction"\nsite = "shoulder"\ntorque = 0.8\n'
SHOWN: Mapping[str, Shown] = {
    "coulomb_friction": Shown(VELOCITY, prescribed=True),
    "viscous_friction": Shown(VELOCITY, prescribed=True),
    "stribeck_friction": Shown(VELOCITY, prescribed=True),
    "asymmetric_friction": Shown(VELOCITY, prescribed=True),
    "presliding_friction": Shown(POSITION, prescribed=True),
    "load_dependent_friction": Shown(LOAD, prescribed=True),
    "friction_creep": Shown(TIME, stepping, beside=DRY),
    "quadratic_drag": Shown(VELOCITY, prescribed=True),
    "armature": Shown(ACCELERATION, prescribed=True),
    "parallel_spring": Shown(POSITION, prescribed=True),
    "cogging": Shown(POSITION, prescribed=True),
    "parent_coupling": Shown("velocity of both joints", site="elbow", prescribed=True),
    "child_coupling": Shown("velocity of both joints", prescribed=True),
    "torque_limit": Shown(LOAD, stepping, site="yaw"),
    "speed_torque_limit": Shown(VELOCITY, stepping, site="yaw"),
    "voltage_sag": Shown(TIME, stepping, site=""),
    "thermal_fade": Shown(TIME, repeated),
    "command_delay": Shown(COMMAND),
    "command_resolution": Shown("command", slow, site="yaw"),
    "command_hysteresis": Shown("command", slow, site="yaw"),
    "motor_lag": Shown(COMMAND),
    "command_rate_limit": Shown(COMMAND, fast),
    "command_deadband": Shown(COMMAND, slow, site="yaw"),
    "command_offset": Shown("command"),
    "command_scale": Shown("command"),
    "payload": Shown(POSITION, site="forearm"),
    "end_payload": Shown(POSITION, site="forearm"),
    "tool_load": Shown(POSITION, site="forearm", values={"x": 0.18, "z": 0.0}),
    "com_offset": Shown(POSITION, site="forearm"),
    "link_inertia": Shown("acceleration of the link", site="forearm", prescribed=True),
    "gravity_tilt": Shown(POSITION, site=""),
    "backlash": Shown(LOAD, site="yaw"),
    "joint_elasticity": Shown(LOAD, stepping, site="yaw"),
    "encoder_scale": Shown(POSITION),
    "encoder_offset": Shown(POSITION),
    "encoder_delay": Shown(VELOCITY),
    "encoder_lead": Shown(VELOCITY, site=""),
    "torque_scale": Shown(LOAD, prescribed=True),
    "clock_skew": Shown(TIME, repeated, site=""),
}


# Effects of what a robot with a floating base touches and carries, shown by a quadruped that trots.
FLOATING = {"imu_bias": "imu_gyro_y", "ground_friction": "base_x", "contact_compliance": "base_z"}
TROT = """
[drive]
kind = "sine"
omega_rad_s = 12.566370614359172
[drive.set]
"""


def pictures(specs: list[btr.documents.EffectSpec], robots: Path) -> dict[str, str]:
    """The SVG texts by effect; a formula has none, as it may be any law."""
    drawn = {spec.effect: _of_arm(spec, SHOWN[spec.effect], robots) for spec in specs if spec.effect in SHOWN}
    return drawn | {spec.effect: _of_quadruped(spec, robots) for spec in specs if spec.effect in FLOATING}


def _of_arm(spec: btr.documents.EffectSpec, shown: Shown, robots: Path) -> str:
    text = (robots / "arm.toml").read_text(encoding="utf-8").split("[parameters]")[0] + shown.beside
    log = _log(shown)
    if shown.prescribed:
        text = text.replace('kind = "position"', 'kind = "prescribed"')
        text = "\n".join(line for line in text.splitlines() if not line.startswith(("kp", "kd"))) + "\n"
    model = btr.Model(text, robots / "arm.toml").simulate(log)
    measured = btr.Model(text + _effect(spec, shown), robots / "arm.toml").simulate(log)
    channel, unit = ("tau", "torque (N·m)") if shown.prescribed else ("q", "position (rad)")
    clock = measured.clock_s
    residual = {joint: measured[f"{channel}_{joint}"] - model[f"{channel}_{joint}"] for joint in JOINTS}
    seen = shown.site if shown.site in JOINTS else max(residual, key=lambda joint: float(np.ptp(residual[joint])))
    curves = [svg.Curve(joint, clock, residual[joint], k) for k, joint in enumerate(JOINTS)]
    over_time = svg.Panel("measured − model", "time (s)", unit, curves, width=1.9)
    if shown.follows == TIME:
        beside = _both(seen, unit, clock, measured[f"{channel}_{seen}"], model[f"{channel}_{seen}"])
    else:
        x_label, x = _followed(shown, measured, seen)
        # Without the beginning, in which the servos take up the arm's weight.
        late = clock > 0.8
        curve = svg.Curve(seen, x[late], residual[seen][late], JOINTS.index(seen))
        beside = svg.Panel(f"{seen}, over what it follows", x_label, unit, [curve], dots=True)
    return svg.drawn([over_time, beside], f"the error of a model without {spec.effect}")


def _of_quadruped(spec: btr.documents.EffectSpec, robots: Path) -> str:
    text = (robots / "quadruped.toml").read_text(encoding="utf-8").split("[parameters]")[0]
    phases = {"LF": 0.0, "RF": np.pi, "LH": np.pi, "RH": 0.0}
    text += TROT + "".join(
        f'"amplitude@{leg}_{joint}" = {size}\n"phase@{leg}_{joint}" = {phase + shift}\n'
        for leg, phase in phases.items()
        for joint, size, shift in (("hip", 0.25, 0.0), ("knee", 0.25, 1.57))
    )
    path = robots / "quadruped.toml"
    shown = Shown(TIME, site="")
    model, measured = (btr.Model(full, path).simulate() for full in (text, text + _effect(spec, shown)))
    channel = FLOATING[spec.effect]
    what = {"imu_gyro_y": "pitch rate (rad/s)", "base_x": "way forward (m)", "base_z": "height (m)"}[channel]
    clock = measured.clock_s
    error = svg.Curve(channel, clock, measured[channel] - model[channel])
    over_time = svg.Panel("measured − model", "time (s)", what, [error], width=1.9)
    beside = _both(channel, what, clock, measured[channel], model[channel])
    return svg.drawn([over_time, beside], f"the error of a model without {spec.effect}")


def _both(name: str, unit: str, clock: Values, measured: Values, model: Values) -> svg.Panel:
    curves = [svg.Curve("measured", clock, measured, 1), svg.Curve("model", clock, model, 3)]
    return svg.Panel("", "time (s)", f"{name}: {unit}", curves)


def _log(shown: Shown) -> btr.Log:
    commands = shown.motion()
    channels: dict[str, ArrayLike] = {f"cmd_{joint}": values for joint, values in commands.items()}
    if shown.prescribed:
        channels |= {f"q_{joint}": values for joint, values in commands.items()}
    return btr.Log(CLOCK, channels)


def _effect(spec: btr.documents.EffectSpec, shown: Shown) -> str:
    values = {parameter.name: parameter.typical for parameter in spec.parameters} | dict(shown.values or {})
    site = [f'site = "{shown.site}"'] if shown.site else []
    stated = [f"{name} = {value}" for name, value in values.items()]
    return "\n".join(["[[effects]]", f'effect = "{spec.effect}"', *site, *stated, ""])


def _followed(shown: Shown, log: btr.Log, joint: str) -> tuple[str, Values]:
    """The label and the values of what the error follows."""
    clock = log.clock_s
    q = log[f"q_{joint}"]
    dq = np.gradient(q, clock)
    commands = np.interp(clock, CLOCK, shown.motion()[joint])
    neighbour = "shoulder" if joint == "elbow" else "elbow"
    dq_neighbour = np.gradient(log[f"q_{neighbour}"], clock)
    followed = {
        VELOCITY: ("velocity (rad/s)", dq),
        POSITION: ("position (rad)", q),
        LOAD: ("torque of the motor (N·m)", log[f"tau_{joint}"]),
        COMMAND: ("speed of the command (rad/s)", np.gradient(commands, clock)),
        ACCELERATION: ("acceleration (rad/s²)", np.gradient(dq, clock)),
        "command": ("command (rad)", commands),
        "velocity of both joints": ("sum of both velocities (rad/s)", dq + dq_neighbour),
        # The forearm's, in the plane of shoulder and elbow.
        "acceleration of the link": ("the link's acceleration (rad/s²)", np.gradient(dq + dq_neighbour, clock)),
    }
    return followed[shown.follows]
