"""Actuators on joints as btr's motors: position, torque, and voltage, which also describes a velocity servo."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from btr._mujoco.names import Names, name_of
from btr._mujoco.springs import NO_DAMPERS
from btr._mujoco.trees import Tree

ON_JOINT = (0, 1)
"""Transmissions to a joint (`mjtTrn`)."""
TRANSMISSIONS = {2: "a slider-crank", 3: "a tendon", 4: "a site", 5: "a body"}
NO_DYNAMICS, FILTERS, MOTOR_DYNAMICS = 0, (2, 3), 5
"""Dynamics of activations (`mjtDyn`)."""
FIXED_GAIN, DC_MOTOR = 0, 3
"""Kinds of gains (`mjtGain`)."""
NO_BIAS, AFFINE = 0, 1
"""Kinds of biases (`mjtBias`)."""


@dataclass
class Motor:
    """The actuator of one joint."""

    kind: dict[str, Any]
    """Its table in a model file."""
    factor: float = 1.0
    offset: float = 0.0
    """btr's command is `factor·ctrl + offset`."""
    control: str = ""
    """The name of MuJoCo's control, where there is one."""
    limit: float = np.inf
    lag_s: float = 0.0
    delay_s: float = 0.0
    armature: float = 0.0
    damping: float = 0.0


class Motors:
    """The motors of a robot by joint."""

    def __init__(self, mj: Any) -> None:
        self._motors: dict[int, Motor] = {}
        self.undamped = bool(mj.opt.disableflags & NO_DAMPERS)

    def set(self, joint: int, motor: Motor) -> None:
        self._motors[joint] = motor

    def get(self, joint: int) -> Motor | None:
        return self._motors.get(joint)

    def damping(self, joint: int) -> float:
        motor = self.get(joint)
        return motor.damping if motor else 0.0

    def limit(self, joint: int) -> float:
        motor = self.get(joint)
        return motor.limit if motor else np.inf

    def facts(self, joint: int) -> dict[str, Any]:
        """What the description of a robot says of a joint's motor."""
        motor = self.get(joint)
        if motor is None:
            return {"actuator": {"kind": "passive"}}
        kind, limit = dict(motor.kind), motor.limit if np.isfinite(motor.limit) else None
        if kind["kind"] in ("position", "torque") and limit is not None:
            kind["max_torque"], limit = limit, None
        command = None
        if motor.control and (motor.factor, motor.offset) != (1.0, 0.0):
            command = {"control": motor.control, "factor": motor.factor, "offset": motor.offset}
        return {
            "actuator": kind,
            "torque_limit": limit if kind["kind"] == "voltage" else None,
            "lag_s": motor.lag_s,
            "delay_s": motor.delay_s,
            "command": command,
        }


def actuators(mj: Any, tree: Tree, names: Names, mimics: Mapping[int, Any], notes: list[str]) -> Motors:
    """The motors of the joints of a tree."""
    motors, mine = Motors(mj), set(tree.joints)
    clamped: list[str] = []
    by_joint: dict[int, list[int]] = {}
    for a in range(getattr(mj, "nactuator", mj.nu)):
        joint = int(mj.actuator_trnid[a][0])
        if mj.actuator_trntype[a] not in ON_JOINT:
            what = TRANSMISSIONS.get(int(mj.actuator_trntype[a]), "something else than a joint")
            notes.append(f"the actuator `{name_of(mj, 'actuator', a)}`, which acts on {what}")
        elif joint in mimics:
            name = name_of(mj, "actuator", a)
            notes.append(f"the actuator `{name}`, whose joint follows another one, which drives it")
        elif joint in mine:
            by_joint.setdefault(joint, []).append(a)
    for joint, several in by_joint.items():
        if len(several) > 1:
            acting = ", ".join(f"`{name_of(mj, 'actuator', a)}`" for a in several)
            on = names.joint(joint)
            notes.append(f"the actuators {acting}: one joint, `{on}`, has one motor; it is passive here")
            continue
        motor = _motor(mj, several[0], notes)
        if motor is not None:
            _limit(mj, several[0], joint, motor, notes, clamped)
            motors.set(joint, motor)
    if clamped:
        notes.append(f"the clamping of controls to their range (ctrlrange): {', '.join(clamped)}")
    return motors


def _motor(mj: Any, a: int, notes: list[str]) -> Motor | None:
    """A motor without its limits; nothing for what btr does not have, which is noted."""
    name, gear = name_of(mj, "actuator", a), float(mj.actuator_gear[a][0])
    dynamics, gain, bias = (int(getattr(mj, f"actuator_{k}type")[a]) for k in ("dyn", "gain", "bias"))
    if gain == DC_MOTOR and dynamics in (NO_DYNAMICS, MOTOR_DYNAMICS):
        motor: Motor | None = _dc_motor(mj, a, gear, name, notes)
    elif gain == FIXED_GAIN and bias in (NO_BIAS, AFFINE) and dynamics in (NO_DYNAMICS, *FILTERS):
        motor = _affine(mj, a, gear)
    else:
        motor = None
    if motor is None:
        notes.append(f"the actuator `{name}`: {_kind(dynamics, gain)}; its joint is passive here")
        return None
    motor.control = name
    motor.lag_s = float(mj.actuator_dynprm[a][0]) if dynamics in FILTERS else 0.0
    motor.delay_s = float(mj.actuator_delay[a]) if hasattr(mj, "actuator_delay") else 0.0
    motor.armature = gear**2 * float(mj.actuator_armature[a]) if hasattr(mj, "actuator_armature") else 0.0
    motor.damping += gear**2 * float(mj.actuator_damping[a]) if hasattr(mj, "actuator_damping") else 0.0
    return motor


def _kind(dynamics: int, gain: int) -> str:
    if dynamics == 4 or gain == 2:
        return "btr has no muscles"
    if dynamics == 1:
        return "btr has no integrating actuators"
    return "its law is none of btr's"


def _affine(mj: Any, a: int, gear: float) -> Motor | None:
    """force = gain·ctrl + b0 + b1·length + b2·velocity, all times the gear on the joint."""
    affine = mj.actuator_biastype[a] == AFFINE
    gain = float(mj.actuator_gainprm[a][0])
    b0, b1, b2 = (float(b) if affine else 0.0 for b in mj.actuator_biasprm[a][:3])
    kp, kd = -b1 * gear**2, -b2 * gear**2
    if kp < 0 or kd < 0 or gear == 0:
        return None
    drive, constant = gear * gain, gear * b0
    if kp > 0:
        return Motor({"kind": "position", "kp": kp, "kd": kd}, drive / kp, constant / kp)
    if kd == 0:
        return Motor({"kind": "torque"}, drive, constant)
    if gain == 0:
        return Motor({"kind": "passive"}, damping=kd) if constant == 0 else None
    # tau = kt·(V - kt·dq)/R with V = ±ctrl + offset.
    kt = kd / abs(drive)
    return Motor({"kind": "voltage", "kt": kt, "resistance": kt / abs(drive)}, float(np.sign(drive)), b0 / gain)


def _dc_motor(mj: Any, a: int, gear: float, name: str, notes: list[str]) -> Motor | None:
    resistance, constant = (float(x) for x in mj.actuator_gainprm[a][:2])
    if resistance <= 0 or gear * constant <= 0:
        return None
    if np.any(mj.actuator_gainprm[a][2:]) or np.any(mj.actuator_biasprm[a]) or mj.actuator_actnum[a]:
        notes.append(f"of the motor `{name}`: its winding's inductance and heat, its cogging and its LuGre friction")
    return Motor({"kind": "voltage", "kt": gear * constant, "resistance": resistance})


def _limit(mj: Any, a: int, joint: int, motor: Motor, notes: list[str], clamped: list[str]) -> None:
    """The limits of force on the actuator and on the joint, and of its control."""
    name, gear = name_of(mj, "actuator", a), abs(float(mj.actuator_gear[a][0]))
    ranges = []
    if mj.actuator_forcelimited[a]:
        ranges.append(gear * mj.actuator_forcerange[a])
    if mj.jnt_actfrclimited[joint]:
        ranges.append(mj.jnt_actfrcrange[joint])
    # An actuator of MuJoCo 4 may have several controls; those that become motors have one.
    control = int(mj.actuator_ctrladr[a]) if hasattr(mj, "actuator_ctrladr") else a
    if mj.actuator_ctrllimited[control]:
        low, high = mj.actuator_ctrlrange[control]
        if motor.kind["kind"] == "torque" and low == -high and motor.offset == 0:
            ranges.append(abs(motor.factor) * mj.actuator_ctrlrange[control])
        else:
            clamped.append(f"`{name}` [{low:g}, {high:g}]")
    for low, high in ranges:
        if low != -high:
            notes.append(f"the limits {low:g} and {high:g} of the force of `{name}`: btr's are the same on both sides")
        motor.limit = min(motor.limit, float(max(abs(low), abs(high))))
