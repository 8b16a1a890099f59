"""What can be hidden, where, and how large: laws of size from what a joint usually does."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .robots import Random, Robot, Vector, between, sign

# Values of an effect at a size; 1 is a usual one.
Values = Callable[[float], dict[str, float]]


@dataclass
class Usual:
    """What the joints do without anything hidden: a number for each joint."""

    torque: Vector
    peak_torque: Vector
    speed: Vector
    peak_speed: Vector
    energy: Vector
    # Inertia that the joint moves, its rotor included.
    inertia: Vector


ON_JOINT = (
    "coulomb_friction", "viscous_friction", "stribeck_friction", "asymmetric_friction", "load_dependent_friction",
    "quadratic_drag", "armature", "parallel_spring", "cogging", "torque_limit", "speed_torque_limit", "thermal_fade",
    "command_delay", "motor_lag", "command_rate_limit", "command_deadband", "command_offset", "backlash",
    "joint_elasticity", "encoder_scale", "encoder_offset", "encoder_delay",
)  # fmt: skip
ON_LINK = ("payload", "com_offset", "link_inertia", "payload_at_end")
ON_ROBOT = {"gravity_tilt": "base", "voltage_sag": "*", "clock_skew": "*"}
EFFECTS = (*ON_JOINT, *ON_LINK, *ON_ROBOT)
OUTSIDE = (
    "hysteretic_deadband", "command_resolution", "jittering_delay", "coupled_joints", "posture_gain",
    "command_play", "dropped_commands", "posture_friction", "cable", "integral_gain",
)  # fmt: skip
# Effects that are drawn with those outside, so that a seed stays the same case, and that the library has.
KNOWN = (*EFFECTS, "command_resolution")
CONSTANTS = (
    "armature_stated", "mass_stated", "kp_stated", "kd_stated", "length_stated", "com_stated", "armature_free",
    "mass_free",
)  # fmt: skip
# Effects that change the servo's gain exclude each other in MuJoCo's model.
GAINS = {"voltage_sag", "thermal_fade", "posture_gain", "encoder_scale"}


def site(effect: str, robot: Robot, rng: Random) -> str:
    """A place for an effect."""
    if effect in ON_ROBOT:
        return ON_ROBOT[effect]
    names = robot.links if effect in ON_LINK else robot.joints
    return str(rng.choice(names))


def values(effect: str, where: str, robot: Robot, usual: Usual, rng: Random) -> Values:
    """The law of an effect's size at a site."""
    if effect in ON_ROBOT:
        return on_robot(effect, usual, rng)
    return on_link(effect, where, robot, rng) if effect in ON_LINK else on_joint(effect, where, robot, usual, rng)


def on_robot(effect: str, usual: Usual, rng: Random) -> Values:
    """Effects on the whole robot."""
    way, side, total = between(rng, 0.0, math.tau), sign(rng), float(usual.torque.sum())
    return {
        "gravity_tilt": lambda s: dict(zip(("roll", "pitch"), tilt(min(0.2, 0.04 * s), way))),
        "voltage_sag": lambda s: {"sag": 0.1 * s / total},
        "clock_skew": lambda s: {"skew": 0.004 * s * side},
    }[effect]


def tilt(angle: float, way: float) -> tuple[float, float]:
    """Roll and pitch of a small tilt."""
    return angle * math.cos(way), angle * math.sin(way)


def on_link(effect: str, where: str, robot: Robot, rng: Random) -> Values:
    """Effects on a link."""
    axis = robot.axes[robot.at(where)]
    way = rng.standard_normal(3)
    way *= 0.1 * float(np.linalg.norm(axis.end)) / float(np.linalg.norm(way))
    end = dict(zip("xyz", map(float, axis.end)))
    return {
        "payload": lambda s: {"mass": 0.2 * axis.mass * s},
        "payload_at_end": lambda s: {"mass": 0.1 * axis.mass * s, **end},
        "com_offset": lambda s: dict(zip("xyz", map(float, s * way))),
        "link_inertia": lambda s: {"inertia": 0.5 * float(axis.inertia.max()) * s},
    }[effect]


def on_joint(effect: str, where: str, robot: Robot, usual: Usual, rng: Random) -> Values:
    """Effects on a joint."""
    i = robot.at(where)
    axis, inertia, energy = robot.axes[i], float(usual.inertia[i]), float(usual.energy[i])
    torque, peak, speed, fastest = (
        float(of[i]) for of in (usual.torque, usual.peak_torque, usual.speed, usual.peak_speed)
    )
    side, phase, low = sign(rng), between(rng, -3.0, 3.0), between(rng, 0.05, 0.3)
    order, rest, ripple = float(rng.integers(4, 25)), between(rng, -1.0, 1.0), float(rng.integers(1, 4))
    other = (i + 1) % len(robot.axes)
    return {
        "coulomb_friction": lambda s: {"torque": 0.15 * torque * s},
        "viscous_friction": lambda s: {"coefficient": 0.15 * torque / speed * s},
        "stribeck_friction": lambda s: {"coulomb": 0.1 * torque * s, "static": 0.25 * torque * s, "velocity": low},
        "asymmetric_friction": lambda s: {
            "coulomb_forward": 0.2 * torque * s,
            "coulomb_backward": 0.05 * torque * s,
            "viscous_forward": 0.05 * torque / speed * s,
            "viscous_backward": 0.02 * torque / speed * s,
        },
        "load_dependent_friction": lambda s: {"ratio": min(0.6, 0.12 * s)},
        "quadratic_drag": lambda s: {"coefficient": 0.1 * torque / speed**2 * s},
        "armature": lambda s: {"inertia": 0.3 * inertia * s},
        "parallel_spring": lambda s: {"stiffness": 0.4 * torque * s, "rest": rest},
        "cogging": lambda s: {"amplitude": 0.1 * torque * s, "order": order, "phase": phase},
        "torque_limit": lambda s: {"torque": peak * max(0.3, math.exp(-0.5 * s))},
        "speed_torque_limit": lambda s: {"torque": 1.1 * peak, "speed": max(0.3, 3.0 / s) * fastest},
        "thermal_fade": lambda s: {"rate": 0.3 * s / energy},
        "command_delay": lambda s: {"delay": min(0.15, 0.02 * s)},
        "motor_lag": lambda s: {"time_constant": min(0.3, 0.03 * s)},
        "command_rate_limit": lambda s: {"rate": max(0.3, 3.0 / s)},
        "command_deadband": lambda s: {"band": min(0.2, 0.02 * s)},
        "command_offset": lambda s: {"offset": 0.02 * s * side},
        "backlash": lambda s: {"gap": min(0.2, 0.02 * s)},
        "joint_elasticity": lambda s: {"stiffness": axis.kp * max(1.0, 8.0 / s), "damping": 0.02 * axis.kd * 8.0},
        "encoder_scale": lambda s: {"error": min(0.1, 0.03 * s) * side},
        "encoder_offset": lambda s: {"offset": min(0.12, 0.03 * s) * side},
        "encoder_delay": lambda s: {"delay": min(0.15, 0.015 * s)},
        "hysteretic_deadband": lambda s: {"sleeps": min(0.05, 0.008 * s), "wakes": min(0.2, 0.03 * s)},
        "command_resolution": lambda s: {"step": min(0.05, 0.01 * s)},
        "jittering_delay": lambda s: {"delay": min(0.15, 0.03 * s)},
        "coupled_joints": lambda s: {"stiffness": 0.1 * axis.kp * s, "other": float(other)},
        "posture_gain": lambda s: {"share": min(0.6, 0.15 * s), "order": ripple, "phase": phase},
        "command_play": lambda s: {"gap": min(0.2, 0.02 * s)},
        "dropped_commands": lambda s: {"per_s": 0.4, "lasts": min(0.6, 0.1 * s)},
        "posture_friction": lambda s: {"torque": 0.5 * torque * s, "phase": phase},
        "cable": lambda s: {"stiffness": 0.5 * axis.kp * s, "slack": float(robot.middle[i]) + 0.2},
        "integral_gain": lambda s: {"rate": 0.5 * s},
    }[effect]
