"""Rotors behind transmissions that give or have play, beside the joints of a MuJoCo model.

MuJoCo's joint is the link's. Servo and encoder are on the motor's side, at a rotor whose angle is kept here. Rotor,
servo and spring are solved together for the middle of each step, as in btr's own simulation
(`btr-physics/src/effects/rotor.rs`), so that no stiffness makes a step unstable. What reaches the link is
`constant - damping·dq` with the link's own velocity in the step. For MuJoCo that is a torque at the velocity before the
step, and an armature for the change of the velocity, which all its integrators take implicitly. With RK4 the motion is
btr's own; the other integrators of MuJoCo add their error of first order.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

# Rotor inertia as a share of the joint's, where neither the model has an armature nor the export states it.
_SHARE = 0.01
# Stiffness of a play's flanks relative to inertia/dt².
_FLANK = 100.0
_RK4 = 1  # mujoco.mjtIntegrator.mjINT_RK4

CHANGED = ("dof_armature", "actuator_gainprm", "actuator_biasprm", "actuator_biastype")
"""What of a MuJoCo model is changed for a step."""


@dataclass
class _Law:
    """A torque `constant - stiffness·q - damping·dq`."""

    constant: float
    stiffness: float = 0.0
    damping: float = 0.0

    def at(self, q: float, dq: float) -> float:
        return self.constant - self.stiffness * q - self.damping * dq


@dataclass
class _Spring:
    """Between rotor and link during a step; the deflection is that before the step."""

    stiffness: float
    damping: float
    deflection: float


class _Rotor:
    """A rotor and the transmission on its link's side."""

    def __init__(self, values: Mapping[str, Any], inertia: float, carried: float, dt_s: float) -> None:
        self._values, self._inertia, self._carried, self._dt_s = values, inertia, carried, dt_s
        self._started = self._loaded = False
        self.angle = self.velocity = self._link = 0.0
        # Its mean velocity is that of the link, times `_b`, and `_a`.
        self._a = self._b = self._kept = 0.0

    def arrive(self, q: float, dq: float, mean_dq: float) -> tuple[float, float, float]:
        """Angle, velocity, and mean velocity in the last step, after the link's side moved here."""
        mean = mean_dq
        if self._started:
            mean = self.mean(mean_dq)
            self.velocity = mean + self._kept * (mean - self.velocity)
            self.angle += self._dt_s * mean
        else:
            self._started, self.angle, self.velocity = True, q, dq
        self._link = q
        return self.angle, self.velocity, mean

    def mean(self, dq: float) -> float:
        """Its mean velocity in the step, for the link's."""
        return self._a + self._b * dq

    def transmit(self, motor: _Law, dq: float) -> _Law:
        """What a torque on the rotor is on the link's side, which has the velocity `dq` before the step."""
        if not self._loaded:
            self._loaded, self.angle = True, self._balance(_Law(motor.at(0.0, self.velocity), motor.stiffness))
        return self._solve(motor, self._spring(motor, dq))

    def _balance(self, motor: _Law) -> float:
        """Where it rests under its load, before the first step."""
        q, stiffness = self._link, self._values.get("stiffness")
        if stiffness is not None:
            return float((motor.constant + stiffness * q) / (motor.stiffness + stiffness))
        resting = math.copysign(math.inf, motor.constant)
        if motor.stiffness > 0.0:
            resting = motor.constant / motor.stiffness
        play = 0.5 * self._values["gap"]
        return float(min(max(resting, q - play), q + play))

    def _spring(self, motor: _Law, dq: float) -> _Spring:
        if "stiffness" in self._values:
            return _Spring(self._values["stiffness"], self._values["damping"], self.angle - self._link)
        # Where the flanks would be at the end of the step if nothing held the rotor.
        dt_s, play = self._dt_s, 0.5 * self._values["gap"]
        push = dt_s * (motor.constant - motor.stiffness * self.angle)
        resistance = self._inertia + dt_s * motor.damping + dt_s * dt_s * motor.stiffness
        loose = self.angle + dt_s * (self._inertia * self.velocity + push) / resistance
        gap = loose - (self._link + dt_s * dq)
        stiffness = _FLANK * (self._inertia + self._carried) / (dt_s * dt_s) if abs(gap) > play else 0.0
        return _Spring(stiffness, dt_s * stiffness, self.angle - self._link - math.copysign(play, gap))

    def _solve(self, motor: _Law, spring: _Spring) -> _Law:
        half_s, inertia = 0.5 * self._dt_s, self._inertia

        def damped(stiffness: float, damping: float) -> float:
            """With what keeps the rotor from overshooting in the second half of the step."""
            return max(damping, half_s * stiffness - inertia / half_s)

        pull = spring.stiffness * spring.deflection
        impedance = half_s * spring.stiffness + damped(spring.stiffness, spring.damping)
        servo = half_s * motor.stiffness + damped(motor.stiffness, motor.damping)
        push = motor.constant - motor.stiffness * self.angle
        # A rotor with very little inertia would oscillate from step to step: it continues from the middle of the last.
        light = inertia < 0.5 * half_s * (servo + impedance)
        carried = 0.5 * inertia if light else inertia
        self._kept = 0.0 if light else 1.0
        resistance = carried + half_s * (servo + impedance)
        self._a = (carried * self.velocity + half_s * (push - pull)) / resistance
        self._b = half_s * impedance / resistance
        return _Law(pull + impedance * self._a, 0.0, impedance * (1.0 - self._b))


class _Servo:
    """An actuator on a joint, on the motor's side of its transmission."""

    def __init__(self, model: Any, actuator: int) -> None:
        self._at, self._activation = actuator, int(model.actuator_actadr[actuator])
        self._gear = float(model.actuator_gear[actuator, 0])
        fixed, affine = model.actuator_gaintype[actuator] == 0, model.actuator_biastype[actuator] in (0, 1)
        self.is_known = bool(fixed and affine and model.actuator_dyntype[actuator] in (0, 1, 2, 3))

    def law(self, model: Any, data: Any) -> _Law:
        """Its torque, by the motor's position and velocity."""
        command = float(data.ctrl[self._at])
        if model.actuator_ctrllimited[self._at]:
            command = float(np.clip(command, *model.actuator_ctrlrange[self._at]))
        if self._activation >= 0:
            command = float(data.act[self._activation])
        bias = model.actuator_biasprm[self._at] if model.actuator_biastype[self._at] else np.zeros(3)
        gear = self._gear
        constant = gear * (model.actuator_gainprm[self._at, 0] * command + bias[0])
        return _Law(float(constant), -float(bias[1]) * gear * gear, -float(bias[2]) * gear * gear)

    def limits(self, model: Any) -> tuple[float, float]:
        """Its least and largest torque."""
        if not model.actuator_forcelimited[self._at]:
            return -math.inf, math.inf
        low, high = sorted(self._gear * model.actuator_forcerange[self._at])
        return float(low), float(high)

    def hold(self, model: Any, torque: float) -> None:
        """Has MuJoCo give it this torque for a step."""
        model.actuator_gainprm[self._at] = 0.0
        model.actuator_biasprm[self._at] = 0.0
        model.actuator_biasprm[self._at, 0] = torque / self._gear
        model.actuator_biastype[self._at] = 1


def _within(torque: float, limit: tuple[float, float]) -> float:
    return min(max(torque, limit[0]), limit[1])


class Transmission:
    """The rotors of a joint, from its link to its motor, and the actuators that act on the last of them."""

    EFFECTS = ("backlash", "joint_elasticity")

    def __init__(self, model: Any, joint: int, actuators: Any, effects: list[dict[str, Any]]) -> None:
        self._joint, self._at, self._dof = joint, int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        self._servos = [_Servo(model, int(actuator)) for actuator in actuators]
        self._dt_s = float(model.opt.timestep)
        # The others of MuJoCo move a joint by its velocity at the end of the step.
        self._moves_by_mean = bool(model.opt.integrator == _RK4)
        armature = float(model.dof_armature[self._dof])
        self._link = float(model.dof_M0[self._dof]) - armature
        self._solved_s, self._before = self._dt_s, 0.0
        self.is_known = all(servo.is_known for servo in self._servos)
        """Whether all actuators of the joint are of kinds whose torques it knows. It does nothing otherwise."""
        found = [values for values in effects if values["effect"] in self.EFFECTS and self.is_known]
        rotors = [float(values.get("rotor_inertia", _SHARE * self._link)) for values in found]
        if armature > 0.0:
            rotors[-1:] = [armature for _ in rotors[-1:]]
        self._rotors = [
            _Rotor(values, rotor, self._link, self._dt_s) for values, rotor in zip(found, rotors, strict=True)
        ]

    def arrive(self, q: float, dq: float) -> float:
        """The motor's position, for the link's position and velocity after the last step."""
        mean = dq if self._solved_s == self._dt_s else 0.5 * (self._before + dq)
        self._before = dq
        for rotor in self._rotors:
            q, dq, mean = rotor.arrive(q, dq, mean)
        return q

    def act(self, model: Any, data: Any) -> None:
        """Replaces, for the coming step, the actuators' torque on the link by what the transmission makes of it."""
        if not self._rotors:
            return
        dq = float(data.qvel[self._dof])
        laws = [servo.law(model, data) for servo in self._servos]
        limits = [servo.limits(model) for servo in self._servos]
        together = self._together(model, limits)
        transmitted = self._solve(laws, together, dq)
        at = self._motor(dq)
        torques = [_within(law.at(*at), limit) for law, limit in zip(laws, limits, strict=True)]
        for servo, torque in zip(self._servos, torques, strict=True):
            servo.hold(model, torque)
        data.qfrc_applied[self._dof] += transmitted.at(0.0, dq) - _within(sum(torques), together)
        self._solved_s = self._until_s(transmitted.damping)
        model.dof_armature[self._dof] = self._solved_s * transmitted.damping

    def settle(self, data: Any) -> None:
        """After a step that was solved for its end: has the link moved with the velocity there."""
        if self._rotors and self._moves_by_mean and self._solved_s == self._dt_s:
            data.qpos[self._at] += 0.5 * self._dt_s * (data.qvel[self._dof] - self._before)

    def _until_s(self, damping: float) -> float:
        """How far into the step the velocity is that the damping acts on, in s: to its end where MuJoCo moves by that,
        and where the link would bounce otherwise."""
        bounces = damping * self._dt_s >= self._link
        return 0.5 * self._dt_s if self._moves_by_mean and not bounces else self._dt_s

    def _together(self, model: Any, limits: list[tuple[float, float]]) -> tuple[float, float]:
        """The limits of all actuators together."""
        low, high = sum(least for least, _ in limits), sum(most for _, most in limits)
        if model.jnt_actfrclimited[self._joint]:
            least, most = model.jnt_actfrcrange[self._joint]
            low, high = max(low, float(least)), min(high, float(most))
        return low, high

    def _solve(self, laws: list[_Law], limit: tuple[float, float], dq: float) -> _Law:
        """What the link has of the actuators' laws; where they exceed their limit, of that."""
        stiffness, damping = sum(law.stiffness for law in laws), sum(law.damping for law in laws)
        motor = _Law(sum(law.constant for law in laws), stiffness, damping)
        transmitted = self._transmit(motor, dq)
        torque = motor.at(*self._motor(dq))
        bound = _within(torque, limit)
        return transmitted if torque == bound else self._transmit(_Law(bound), dq)

    def _transmit(self, law: _Law, dq: float) -> _Law:
        """A torque on the motor's side, as the link has it."""
        sides = [dq, *(rotor.velocity for rotor in self._rotors[:-1])]
        for rotor, side in zip(reversed(self._rotors), reversed(sides), strict=True):
            law = rotor.transmit(law, side)
        return law

    def _motor(self, dq: float) -> tuple[float, float]:
        """Position and velocity of the motor where the step is solved, if the link moves at `dq`."""
        for rotor in self._rotors:
            dq = rotor.mean(dq)
        return self._rotors[-1].angle + 0.5 * self._dt_s * dq, dq
