"""A robot with hidden effects in MuJoCo: laws that act around `mj_step`, episodes, and readings."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from .commands import lagged
from .plant import Hidden, Numerics, plant
from .robots import Random, Robot, Vector

# Time for which the robot has held its first command when an episode begins.
SETTLE_S = 2.0


@dataclass
class Episode:
    """What a robot is told: commands at every tick of the log, each held until the next."""

    commands: Vector
    tick_s: float
    # Ticks before the log begins.
    before: int = 0

    @property
    def clock(self) -> Vector:
        """Times of the log."""
        return np.arange(len(self.commands) - self.before) * self.tick_s

    def cut(self, seconds: float) -> Episode:
        """Its beginning."""
        return Episode(self.commands[: self.before + max(3, round(seconds / self.tick_s))], self.tick_s, self.before)


@dataclass
class Motion:
    """What an episode's robot did: joint angles, speeds and motor torques at every step, the settling left out."""

    q: Vector
    dq: Vector
    torque: Vector


# ---------------------------------------------------------------- around the step

Step = Callable[[mujoco.MjData], None]


class Around:
    """Laws that act around `mj_step`, with their state. Each method returns the law of one effect.

    What acts in a step is computed from the angles and speeds in its middle, as the last step predicts them: from those
    at its beginning, the error would fall with the step alone instead of its square."""

    def __init__(self, robot: Robot, model: mujoco.MjModel):
        self.robot, self.model = robot, model
        self.step_s = model.opt.timestep
        self.q, self.dq = np.zeros(model.nq), np.zeros(model.nv)
        self.gain, self.bias = model.actuator_gainprm.copy(), model.actuator_biasprm.copy()
        self.factor = np.ones(len(robot.axes))

    def predict(self, data: mujoco.MjData, before: Vector) -> None:
        """Angles and speeds in the middle of the coming step, from the speeds one step before it."""
        self.dq = 1.5 * data.qvel - 0.5 * before
        self.q = data.qpos + 0.5 * self.step_s * data.qvel

    def weaken(self) -> None:
        """Applies the present factors to the servos."""
        self.model.actuator_gainprm[:, 0] = self.factor * self.gain[:, 0]
        self.model.actuator_biasprm[:, 1:3] = self.factor[:, None] * self.bias[:, 1:3]

    def dof(self, site: str) -> int:
        """Address of a joint's speed; its angle has the same one."""
        return int(self.model.joint(site).dofadr[0])

    def law(self, hidden: Hidden) -> Step | None:
        """What a hidden effect does before every step, if anything."""
        build = getattr(self, hidden.effect, None)
        return build(hidden.site, hidden.values) if build else None

    def encoder_scale(self, site: str, values: dict[str, float]) -> None:
        """The servo works with the reading of its encoder."""
        self.bias[self.robot.at(site), 1:3] *= 1.0 + values["error"]
        self.weaken()

    def torque_limit(self, site: str, values: dict[str, float]) -> None:
        i = self.robot.at(site)
        self.model.actuator_forcerange[i] = (-values["torque"], values["torque"])

    def speed_torque_limit(self, site: str, values: dict[str, float]) -> Step:
        i, dof, most = self.robot.at(site), self.dof(site), values["torque"]

        def act(data: mujoco.MjData) -> None:
            speed = self.dq[dof]
            left = most * max(0.0, 1.0 - abs(speed) / values["speed"])
            self.model.actuator_forcerange[i] = (-most, left) if speed > 0 else (-left, most)

        return act

    def voltage_sag(self, site: str, values: dict[str, float]) -> Step:
        def act(data: mujoco.MjData) -> None:
            self.factor[:] = 1.0 / (1.0 + values["sag"] * np.abs(data.actuator_force).sum())
            self.weaken()

        return act

    def thermal_fade(self, site: str, values: dict[str, float]) -> Step:
        i, dof, energy = self.robot.at(site), self.dof(site), 0.0

        def act(data: mujoco.MjData) -> None:
            nonlocal energy
            if data.time >= SETTLE_S:
                energy += abs(data.actuator_force[i] * self.dq[dof]) * self.step_s
            self.factor[i] = math.exp(-values["rate"] * energy)
            self.weaken()

        return act

    def posture_gain(self, site: str, values: dict[str, float]) -> Step:
        i, dof = self.robot.at(site), self.dof(site)

        def act(data: mujoco.MjData) -> None:
            self.factor[i] = 1.0 + values["share"] * math.sin(values["order"] * self.q[dof] + values["phase"])
            self.weaken()

        return act

    def stribeck_friction(self, site: str, values: dict[str, float]) -> Step:
        dof, more = self.dof(site), values["static"] - values["coulomb"]

        def act(data: mujoco.MjData) -> None:
            near_rest = math.exp(-((self.dq[dof] / values["velocity"]) ** 2))
            self.model.dof_frictionloss[dof] = values["coulomb"] + more * near_rest

        return act

    def asymmetric_friction(self, site: str, values: dict[str, float]) -> Step:
        dof = self.dof(site)
        forward, backward = values["coulomb_forward"], values["coulomb_backward"]

        def act(data: mujoco.MjData) -> None:
            # Dry friction within [-forward, backward] is one of equal sizes about a constant torque.
            speed = self.dq[dof]
            self.model.dof_frictionloss[dof] = 0.5 * (forward + backward)
            viscous = values["viscous_forward"] if speed > 0 else values["viscous_backward"]
            data.qfrc_applied[dof] -= 0.5 * (forward - backward) + viscous * speed

        return act

    def load_dependent_friction(self, site: str, values: dict[str, float]) -> Step:
        i, dof = self.robot.at(site), self.dof(site)

        def act(data: mujoco.MjData) -> None:
            self.model.dof_frictionloss[dof] = max(1e-9, values["ratio"] * abs(data.actuator_force[i]))

        return act

    def posture_friction(self, site: str, values: dict[str, float]) -> Step:
        dof = self.dof(site)

        def act(data: mujoco.MjData) -> None:
            wave = 0.5 + 0.5 * math.sin(3.0 * self.q[dof] + values["phase"])
            self.model.dof_frictionloss[dof] = max(1e-9, values["torque"] * wave**3)

        return act

    def torque(self, site: str, law: Callable[[float, float], float]) -> Step:
        """A torque that depends on angle and speed."""
        dof = self.dof(site)

        def act(data: mujoco.MjData) -> None:
            data.qfrc_applied[dof] += law(self.q[dof], self.dq[dof])

        return act

    def quadratic_drag(self, site: str, values: dict[str, float]) -> Step:
        return self.torque(site, lambda q, dq: -values["coefficient"] * abs(dq) * dq)

    def cogging(self, site: str, values: dict[str, float]) -> Step:
        return self.torque(site, lambda q, dq: values["amplitude"] * math.sin(values["order"] * q + values["phase"]))

    def cable(self, site: str, values: dict[str, float]) -> Step:
        return self.torque(site, lambda q, dq: -values["stiffness"] * max(0.0, q - values["slack"]))

    def coupled_joints(self, site: str, values: dict[str, float]) -> Step:
        one, other = self.dof(site), self.dof(self.robot.joints[int(values["other"])])

        def act(data: mujoco.MjData) -> None:
            pull = values["stiffness"] * (self.q[one] - self.q[other])
            data.qfrc_applied[one] -= pull
            data.qfrc_applied[other] += pull

        return act

    def integral_gain(self, site: str, values: dict[str, float]) -> Step:
        i, dof, sum_s = self.robot.at(site), self.dof(site), 0.0

        def act(data: mujoco.MjData) -> None:
            nonlocal sum_s
            sum_s += (data.ctrl[i] - self.q[dof]) * self.step_s
            data.ctrl[i] += values["rate"] * sum_s

        return act

    def command_deadband(self, site: str, values: dict[str, float]) -> Step:
        i, dof, band = self.robot.at(site), self.dof(site), values["band"]

        def act(data: mujoco.MjData) -> None:
            error = data.ctrl[i] - self.q[dof]
            data.ctrl[i] -= max(-band, min(band, error))

        return act

    def hysteretic_deadband(self, site: str, values: dict[str, float]) -> Step:
        i, dof, resting = self.robot.at(site), self.dof(site), False

        def act(data: mujoco.MjData) -> None:
            nonlocal resting
            error = abs(data.ctrl[i] - self.q[dof])
            resting = error < values["wakes"] if resting else error < values["sleeps"]
            if resting:
                data.ctrl[i] = self.q[dof]

        return act


def on_the_way(hidden: Hidden, told: Vector, step_s: float, tick_steps: int) -> Vector:
    """A joint's command at every step, as it arrives at the servo."""
    values = hidden.values
    match hidden.effect:
        case "command_delay":
            late = np.arange(len(told)) - values["delay"] / step_s
            return np.asarray(np.interp(late, np.arange(len(told)), told))
        case "motor_lag":
            # The mean over a step of what the lag lets through.
            share = 1.0 - math.exp(-step_s / values["time_constant"])
            after = lagged(told, share)
            before = np.concatenate([told[:1], after[:-1]])
            return np.asarray(told - (told - before) * share * values["time_constant"] / step_s)
        case "command_rate_limit":
            # The mean over a step of a ramp that may reach the command before the step ends.
            most = values["rate"] * step_s
            after = follow(told, lambda error: max(-most, min(most, error)))
            before = np.concatenate([told[:1], after[:-1]])
            moved = after - before
            return np.asarray(before + moved * (1.0 - 0.5 * np.abs(moved) / most))
        case "command_play":
            half = 0.5 * values["gap"]
            return follow(told, lambda error: error - max(-half, min(half, error)))
        case "command_offset":
            return told + values["offset"]
        case "encoder_offset":
            # The servo works with the reading of its encoder.
            return told - values["offset"]
        case "command_resolution":
            return np.asarray(values["step"] * np.round(told / values["step"]))
        case "jittering_delay":
            ticks = math.ceil(len(told) / tick_steps)
            delays = np.random.default_rng(hidden.seed).uniform(0.0, 2.0 * values["delay"], ticks)
            late = np.arange(len(told)) - np.repeat(delays / step_s, tick_steps)[: len(told)]
            return np.asarray(told[np.clip(np.maximum.accumulate(np.round(late)), 0, None).astype(int)])
        case "dropped_commands":
            ticks = math.ceil(len(told) / tick_steps)
            rng = np.random.default_rng(hidden.seed)
            # A loss lasts for a while, as on a bad radio link.
            begins = rng.random(ticks) < values["per_s"] * tick_steps * step_s
            last, index = 0, np.zeros(len(told), int)
            lost = 0
            for tick in range(ticks):
                lost = round(values["lasts"] / (tick_steps * step_s)) if begins[tick] and not lost else max(0, lost - 1)
                last = last if lost else tick * tick_steps
                index[tick * tick_steps : (tick + 1) * tick_steps] = last
            return told[index]
    return told


def follow(told: Vector, move: Callable[[float], float]) -> Vector:
    """A value that moves towards the command by `move(error)` in each step."""
    value, values = float(told[0]), np.empty_like(told)
    for k, command in enumerate(told):
        value += move(command - value)
        values[k] = value
    return values


# ---------------------------------------------------------------- an episode


def simulate(robot: Robot, hidden: list[Hidden], episode: Episode, numerics: Numerics, carried: Vector) -> Motion:
    """The motion at every step from the episode's beginning to the last reading."""
    model = plant(robot, hidden, numerics, carried)
    data = mujoco.MjData(model)
    places = [int(model.joint(joint).qposadr[0]) for joint in robot.joints]
    tick_steps = round(episode.tick_s / numerics.step_s)
    settle = round(SETTLE_S / episode.tick_s) * tick_steps
    told = np.repeat(episode.commands[:-1], tick_steps, axis=0)
    # A clock that runs slow takes its last readings after the last tick: the robot goes on under its last command.
    skew = sum(h.values["skew"] for h in hidden if h.effect == "clock_skew")
    after = math.ceil(max(0.0, 1.0 / (1.0 + skew) - 1.0) * len(told))
    told = np.concatenate(
        [np.repeat(episode.commands[:1], settle, axis=0), told, np.repeat(episode.commands[-1:], after, axis=0)]
    )
    for h in hidden:
        if h.site in robot.joints:
            i = robot.at(h.site)
            told[:, i] = on_the_way(h, told[:, i], numerics.step_s, tick_steps)
    data.qpos[places] = told[0]
    around = Around(robot, model)
    laws = [law for law in map(around.law, hidden) if law]
    q, dq = np.empty((len(told) + 1, model.nq)), np.empty((len(told) + 1, model.nv))
    torque = np.empty((len(told) + 1, model.nu))
    for step, ctrl in enumerate(told):
        q[step], dq[step], torque[step] = data.qpos, data.qvel, data.actuator_force
        data.ctrl[:] = ctrl
        if laws:
            around.predict(data, dq[step - 1] if step else data.qvel)
            data.qfrc_applied[:] = 0.0
            for act in laws:
                act(data)
        mujoco.mj_step(model, data)
    q[-1], dq[-1], torque[-1] = data.qpos, data.qvel, data.actuator_force
    # MuJoCo starts again from the beginning where a position, speed or acceleration is out of bounds.
    bad = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
    if not np.isfinite(q).all() or any(data.warning[kind].number for kind in bad):
        raise FloatingPointError("the simulation diverged")
    for i in range(len(places)):
        # The log has the link's angle: that of the rotor and of what lies between them.
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"apart_{i}") >= 0:
            between = int(model.joint(f"apart_{i}").qposadr[0])
            q[:, places[i]] += q[:, between]
            dq[:, places[i]] += dq[:, between]
    return Motion(q[settle:, places], dq[settle:, places], torque[settle:])


@dataclass
class Sensors:
    """Noise and quantum of the encoders; noise of the speeds, which are not logged where it is zero."""

    noise: float
    quantum: float
    speed_noise: float = 0.0

    @property
    def floor(self) -> float:
        """Standard deviation of a reading."""
        return math.hypot(self.noise, self.quantum / math.sqrt(12.0))


def true_readings(
    robot: Robot, hidden: list[Hidden], episode: Episode, motion: Motion, step_s: float
) -> tuple[Vector, Vector]:
    """Angles and speeds as the encoders have them at every tick, without noise."""
    steps = np.arange(len(motion.q)) * step_s
    q, dq = (np.empty((len(episode.clock), len(robot.axes))) for _ in range(2))
    for i, joint in enumerate(robot.joints):
        here = {h.effect: h.values for h in hidden if h.site in (joint, "*")}
        taken = episode.clock
        if values := here.get("encoder_delay"):
            taken = taken - values["delay"]
        if values := here.get("clock_skew"):
            taken = taken / (1.0 + values["skew"])
        taken = taken + episode.before * episode.tick_s
        gain = 1.0 + here.get("encoder_scale", {}).get("error", 0.0)
        q[:, i] = gain * np.interp(taken, steps, motion.q[:, i]) + here.get("encoder_offset", {}).get("offset", 0.0)
        dq[:, i] = gain * np.interp(taken, steps, motion.dq[:, i])
    return q, dq


def record(readings: tuple[Vector, Vector], sensors: Sensors, rng: Random) -> tuple[Vector, Vector]:
    """Noisy and quantised readings."""
    q, dq = readings
    q = q + sensors.noise * rng.standard_normal(q.shape)
    if sensors.quantum > 0.0:
        q = sensors.quantum * np.round(q / sensors.quantum)
    return q, dq + sensors.speed_noise * rng.standard_normal(dq.shape)

