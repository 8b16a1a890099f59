#!/usr/bin/env python3
"""Effects hidden in another simulator: does `btr diagnose` find the effect that MuJoCo has and btr's model lacks?

    cargo build --release && python3 -m venv venv && venv/bin/pip install mujoco
    venv/bin/python studies/hidden_in_mujoco.py [--seeds 1000..1003] [--effects armature,backlash]

Reality is the desk arm of `robots/arm.urdf` in MuJoCo: 0.1 ms steps, `implicitfast`, servos as general actuators,
masses up to 20 % and gains up to 10 % off, noisy and quantised encoders, and one effect. MuJoCo's own implementation of
the effect is used if there is one (frictionloss, armature, damping, stiffness, forcerange, gravity, backlash or a
spring as a second hinge); effects in a servo or a sensor are implemented here. Friction is MuJoCo's soft constraint, as
stiff as its step allows: with its defaults a stuck joint creeps. Viscous friction and payloads are left out, since
gains and masses are free parameters and absorb them.

The arm has held its first command for a second when a log begins. A case takes a few seconds in MuJoCo and about half a
minute in btr on two cores. Seeds below 1000 are for tuning. It prints

    exact        the effect at its site, and nothing else
    equivalent   one effect that btr declares as similar, at the same joint
    extra        the effect and another one
    silent       "nothing is missing"
    unexplained  btr reports that its findings do not explain the logs
    wrong        something else
"""

import argparse
import csv
import math
import statistics
import tempfile
import time
import tomllib
import xml.etree.ElementTree as ET
from collections import Counter, deque
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from asking import BTR, ROOT, ask

MODEL = ROOT / "robots" / "arm.toml"

STEP_S, TICK_S, DURATION_S = 0.0001, 0.01, 4.0
# Time for which the arm has held its first command when the log begins.
SETTLE_S = 1.0
STEPS_PER_TICK = round(TICK_S / STEP_S)
NOISE_RAD, QUANTUM_RAD = 0.0005, 0.0017453
MASSES, GAINS = 0.2, 0.1
GRAVITY = np.array([0.0, 0.0, -9.81])

# Typical values of each joint: torque (N·m) and carried inertia (kg·m²) with the arm straight.
TORQUE = {"yaw": 2.0, "shoulder": 2.5, "elbow": 0.7}
INERTIA = {"yaw": 0.040, "shoulder": 0.040, "elbow": 0.0041}
# The rotor's share of a joint's carried inertia if rotor and link move separately.
ROTOR = 0.01
# The stiffest possible constraint at this step.
HARD = {"solref": "0.0005 1", "solimp": "0.999 0.9999 0.0001 0.5 2"}


@dataclass
class Hidden:
    """The effect that reality has and the model lacks; none if `effect` is "none"."""

    effect: str
    site: str = ""
    values: dict[str, float] = field(default_factory=dict)

    def on(self, effect: str, site: str = "") -> bool:
        """Whether this is the given effect at the given site."""
        return self.effect == effect and (not site or self.site == site)

    def name(self) -> str:
        return "none" if self.effect == "none" else f"{self.effect}@{self.site}"

    def describe(self) -> str:
        return ", ".join(f"{name} {value:.4g}" for name, value in self.values.items())


# ---------------------------------------------------------------- what is hidden


def between(rng: np.random.Generator, least: float, most: float) -> float:
    return float(rng.uniform(least, most))


def sign(rng: np.random.Generator) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0


def on_joint(effect: str, joint: str, rng: np.random.Generator) -> dict[str, float]:
    """An effect on a joint, large enough to be visible."""
    size, torque, inertia = between(rng, 0.7, 1.5), TORQUE[joint], INERTIA[joint]
    return {
        "coulomb_friction": {"torque": 0.1 * torque * size},
        "stribeck_friction": {"coulomb": 0.08 * torque * size, "static": 0.25 * torque * size, "velocity": 0.2},
        "asymmetric_friction": {"forward": 0.2 * torque * size, "backward": 0.05 * torque * size},
        "load_dependent_friction": {"ratio": 0.15 * size},
        "quadratic_drag": {"coefficient": 0.015 * torque * size},
        "armature": {"inertia": 0.5 * inertia * size},
        "parallel_spring": {"stiffness": 0.5 * torque * size, "rest": between(rng, -1.0, 1.0)},
        "cogging": {
            "amplitude": 0.1 * torque * size,
            "order": float(rng.integers(4, 11)),
            "phase": between(rng, -3, 3),
        },
        "torque_limit": {"torque": 1.3 * torque * size},
        "speed_torque_limit": {"torque": 1.5 * torque * size, "speed": between(rng, 4.0, 8.0)},
        "thermal_fade": {"rate": 0.05 * size / torque},
        "command_delay": {"delay": 0.02 * size},
        "motor_lag": {"time_constant": 0.03 * size},
        "command_rate_limit": {"rate": 3.5 / size},
        "command_resolution": {"step": 0.02 * size},
        "command_hysteresis": {"band": 0.02 * size},
        "command_deadband": {"band": 0.03 * size},
        "backlash": {"gap": 0.03 * size},
        "joint_elasticity": {"stiffness": 20.0 * torque / size, "damping": between(rng, 0.0, 0.01) * torque},
        "encoder_scale": {"error": 0.05 * size * sign(rng)},
        "encoder_offset": {"offset": 0.03 * size * sign(rng)},
        "encoder_delay": {"delay": 0.02 * size},
    }[effect]


ON_JOINTS = [
    "coulomb_friction", "stribeck_friction", "asymmetric_friction", "load_dependent_friction", "quadratic_drag",
    "armature", "parallel_spring", "cogging", "torque_limit", "speed_torque_limit", "thermal_fade", "command_delay",
    "motor_lag", "command_rate_limit", "command_deadband", "backlash", "joint_elasticity", "encoder_scale",
    "encoder_offset", "encoder_delay",
]  # fmt: skip
# A place in this list is part of a case's seed: new effects come last.
EFFECTS = [
    "none", *ON_JOINTS, "com_offset", "link_inertia", "gravity_tilt", "voltage_sag", "clock_skew",
    "command_resolution", "command_hysteresis",
]  # fmt: skip
# Links that carry each other's weight; the turret's centre of mass moves in a plane normal to gravity.
LINKS = {"upper": 0.040, "forearm": 0.0041}


def hide(effect: str, rng: np.random.Generator) -> Hidden:
    """An effect at a random site, of a random size."""
    # The direction of an axis without gravity torque is not identifiable.
    seen = [joint for joint in TORQUE if effect != "encoder_offset" or joint != "yaw"]
    joint = str(rng.choice(seen))
    link = str(rng.choice(list(LINKS)))
    size = between(rng, 0.7, 1.5)
    match effect:
        case "none":
            return Hidden(effect)
        case "com_offset":
            return Hidden(effect, link, {axis: 0.02 * between(rng, 0.7, 1.5) * sign(rng) for axis in "xyz"})
        case "link_inertia":
            return Hidden(effect, link, {"inertia": 0.5 * LINKS[link] * size})
        case "gravity_tilt":
            return Hidden(
                effect, "base", {axis: 0.05 * between(rng, 0.7, 1.5) * sign(rng) for axis in ("roll", "pitch")}
            )
        case "voltage_sag":
            return Hidden(effect, "*", {"sag": 0.04 * size})
        case "clock_skew":
            return Hidden(effect, "*", {"skew": 0.01 * size * sign(rng)})
        case _:
            return Hidden(effect, joint, on_joint(effect, joint, rng))


# ---------------------------------------------------------------- the arm in MuJoCo


class Arm:
    """The arm of the URDF with the model file's gains, perturbed."""

    def __init__(self, rng: np.random.Generator):
        toml = tomllib.loads(MODEL.read_text())
        robot = ET.parse(MODEL.parent / toml["robot"]["urdf"]).getroot()
        self.links = {link.get("name"): link for link in robot.iter("link")}
        self.urdf_joints = robot.findall("joint")
        self.joints = [joint.get("name") for joint in self.urdf_joints]
        off = lambda share: 1.0 + between(rng, -share, share)  # noqa: E731
        self.mass_factor = {link: off(MASSES) for link in self.links}
        gains = {joint: toml["actuators"][joint] for joint in self.joints}
        self.kp = {joint: gains[joint]["kp"] * off(GAINS) for joint in self.joints}
        self.kd = {joint: gains[joint]["kd"] * off(GAINS) for joint in self.joints}

    def mjcf(self, hidden: Hidden) -> str:
        """The whole model as MJCF; its hinges have no limits, which the logs never reach."""
        root = ET.Element("mujoco", model="arm")
        ET.SubElement(root, "compiler", angle="radian")
        gravity = text(tilted(hidden.values) if hidden.on("gravity_tilt") else GRAVITY)
        ET.SubElement(root, "option", timestep=str(STEP_S), integrator="implicitfast", gravity=gravity)
        bodies = {self.urdf_joints[0].find("parent").get("link"): ET.SubElement(root, "worldbody")}
        actuators = ET.SubElement(root, "actuator")
        for joint in self.urdf_joints:
            name, link = joint.get("name"), joint.find("child").get("link")
            parent = bodies[joint.find("parent").get("link")]
            bodies[link] = body = ET.SubElement(parent, "body", name=link, pos=joint.find("origin").get("xyz"))
            self.add_inertial(body, link, hidden)
            axis = joint.find("axis").get("xyz")
            ET.SubElement(body, "joint", name=name, type="hinge", axis=axis, **hinge(hidden, name))
            if hidden.on("backlash", name):
                half = 0.5 * hidden.values["gap"]
                hard = {"solreflimit": HARD["solref"], "solimplimit": HARD["solimp"]}
                ET.SubElement(body, "joint", name="apart", axis=axis, limited="true", range=f"{-half} {half}", **hard)
            if hidden.on("joint_elasticity", name):
                spring = {key: str(value) for key, value in hidden.values.items()}
                ET.SubElement(body, "joint", name="apart", axis=axis, **spring)
            limit = (
                {"forcerange": f"{-hidden.values['torque']} {hidden.values['torque']}"} if limited(hidden, name) else {}
            )
            bias = servo_bias(hidden, name, self.kp[name], self.kd[name])
            ET.SubElement(actuators, "general", name=name, joint=name, gainprm=str(self.kp[name]),
                          biastype="affine", biasprm=text(bias), **limit)  # fmt: skip
        return ET.tostring(root, encoding="unicode")

    def add_inertial(self, body: ET.Element, link: str, hidden: Hidden) -> None:
        inertial = self.links[link].find("inertial")
        factor, moments = self.mass_factor[link], inertial.find("inertia")
        com = np.array(inertial.find("origin").get("xyz").split(), float)
        diagonal = factor * np.array([float(moments.get(axis)) for axis in ("ixx", "iyy", "izz")])
        if hidden.on("com_offset", link):
            com += [hidden.values[axis] for axis in "xyz"]
        if hidden.on("link_inertia", link):
            diagonal += hidden.values["inertia"]
        mass = factor * float(inertial.find("mass").get("value"))
        ET.SubElement(body, "inertial", pos=text(com), mass=str(mass), diaginertia=text(diagonal))


def servo_bias(hidden: Hidden, joint: str, kp: float, kd: float) -> np.ndarray:
    """A servo's torque at zero command: constant, per angle, per speed. It works with the reading of its encoder."""
    offset = hidden.values["offset"] if hidden.on("encoder_offset", joint) else 0.0
    gain = 1.0 + (hidden.values["error"] if hidden.on("encoder_scale", joint) else 0.0)
    return -np.array([kp * offset, kp * gain, kd * gain])


def text(numbers: np.ndarray) -> str:
    return " ".join(f"{x:.12g}" for x in numbers)


def tilted(values: dict[str, float]) -> np.ndarray:
    """Gravity in the frame of a base that is rolled about x, then pitched about y."""
    roll, pitch = values["roll"], values["pitch"]
    about_x = np.array([[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]])
    about_y = np.array([[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]])
    return (about_y @ about_x).T @ GRAVITY


def limited(hidden: Hidden, joint: str) -> bool:
    return hidden.on("torque_limit", joint) or hidden.on("speed_torque_limit", joint)


def hinge(hidden: Hidden, joint: str) -> dict[str, str]:
    """Effects on a joint that MuJoCo implements itself."""
    values = hidden.values
    if hidden.site != joint:
        return {}
    hard = {"solreffriction": HARD["solref"], "solimpfriction": HARD["solimp"]}
    match hidden.effect:
        case "coulomb_friction":
            return {"frictionloss": str(values["torque"]), **hard}
        case "stribeck_friction" | "asymmetric_friction" | "load_dependent_friction":
            # Its size is set before every step.
            return {"frictionloss": "1", **hard}
        case "quadratic_drag":
            return {"damping": f"0 {values['coefficient']}"}
        case "armature":
            return {"armature": str(values["inertia"])}
        case "backlash" | "joint_elasticity":
            return {"armature": str(ROTOR * INERTIA[joint])}
        case "parallel_spring":
            return {"stiffness": str(values["stiffness"]), "springref": str(values["rest"])}
    return {}


class Around:
    """An effect that MuJoCo does not have: called before every step, with state."""

    def __init__(self, hidden: Hidden, arm: Arm, model: mujoco.MjModel):
        self.hidden, self.values, self.model, self.energy = hidden, hidden.values, model, 0.0
        self.gain, self.bias = model.actuator_gainprm.copy(), model.actuator_biasprm.copy()
        here = hidden.site in arm.joints
        self.actuator = arm.joints.index(hidden.site) if here else 0
        self.dof = model.joint(hidden.site).dofadr[0] if here else 0
        self.act = getattr(self, hidden.effect, None)

    def weaken(self, actuators: slice, factor: float) -> None:
        self.model.actuator_gainprm[actuators] = factor * self.gain[actuators]
        self.model.actuator_biasprm[actuators] = factor * self.bias[actuators]

    def voltage_sag(self, data: mujoco.MjData) -> None:
        self.weaken(slice(None), 1.0 / (1.0 + self.values["sag"] * np.abs(data.actuator_force).sum()))

    def thermal_fade(self, data: mujoco.MjData) -> None:
        if data.time < SETTLE_S:
            return
        self.energy += abs(data.actuator_force[self.actuator] * data.qvel[self.dof]) * STEP_S
        self.weaken(slice(self.actuator, self.actuator + 1), math.exp(-self.values["rate"] * self.energy))

    def speed_torque_limit(self, data: mujoco.MjData) -> None:
        most, speed = self.values["torque"], data.qvel[self.dof]
        left = most * max(0.0, 1.0 - abs(speed) / self.values["speed"])
        self.model.actuator_forcerange[self.actuator] = (-most, left) if speed > 0 else (-left, most)

    def command_deadband(self, data: mujoco.MjData) -> None:
        error, band = data.ctrl[self.actuator] - data.qpos[self.dof], self.values["band"]
        data.ctrl[self.actuator] -= max(-band, min(band, error))

    def stribeck_friction(self, data: mujoco.MjData) -> None:
        coulomb, more = self.values["coulomb"], self.values["static"] - self.values["coulomb"]
        near_rest = math.exp(-((data.qvel[self.dof] / self.values["velocity"]) ** 2))
        self.model.dof_frictionloss[self.dof] = coulomb + more * near_rest

    def asymmetric_friction(self, data: mujoco.MjData) -> None:
        # Friction within [-forward, backward] is one of equal sizes about a constant torque.
        forward, backward = self.values["forward"], self.values["backward"]
        self.model.dof_frictionloss[self.dof] = 0.5 * (forward + backward)
        data.qfrc_applied[self.dof] = -0.5 * (forward - backward)

    def load_dependent_friction(self, data: mujoco.MjData) -> None:
        self.model.dof_frictionloss[self.dof] = self.values["ratio"] * abs(data.actuator_force[self.actuator])

    def cogging(self, data: mujoco.MjData) -> None:
        angle = self.values["order"] * data.qpos[self.dof] + self.values["phase"]
        data.qfrc_applied[self.dof] = self.values["amplitude"] * math.sin(angle)


def on_the_way(hidden: Hidden, told: np.ndarray) -> np.ndarray:
    """A joint's command at every step, as it arrives at the servo."""
    if hidden.on("command_delay"):
        steps = round(hidden.values["delay"] / STEP_S)
        buffer = deque([told[0]] * steps)
        arrived = []
        for command in told:
            buffer.append(command)
            arrived.append(buffer.popleft())
        return np.array(arrived)
    if hidden.on("motor_lag"):
        share = 1.0 - math.exp(-STEP_S / hidden.values["time_constant"])
        return follow(told, lambda error: share * error)
    if hidden.on("command_rate_limit"):
        most = hidden.values["rate"] * STEP_S
        return follow(told, lambda error: max(-most, min(most, error)))
    if hidden.on("command_resolution"):
        return hidden.values["step"] * np.round(told / hidden.values["step"])
    if hidden.on("command_hysteresis"):
        return follow(told, lambda error: error if abs(error) > hidden.values["band"] else 0.0)
    return told


def follow(told: np.ndarray, move) -> np.ndarray:
    """A value that moves towards the command by `move(error)` in each step."""
    value, values = told[0], []
    for command in told:
        value += move(command - value)
        values.append(value)
    return np.array(values)


def simulate(arm: Arm, hidden: Hidden, commands: np.ndarray) -> np.ndarray:
    """All joints' angles at every step of an episode, and the last ones."""
    model = mujoco.MjModel.from_xml_string(arm.mjcf(hidden))
    data = mujoco.MjData(model)
    places = [model.joint(joint).qposadr[0] for joint in arm.joints]
    data.qpos[places] = commands[0]
    around = Around(hidden, arm, model)
    settle = round(SETTLE_S / STEP_S)
    told = np.repeat(commands[:-1], STEPS_PER_TICK, axis=0)
    told = np.concatenate([np.repeat(commands[:1], settle, axis=0), told])
    if hidden.site in arm.joints:
        told[:, around.actuator] = on_the_way(hidden, told[:, around.actuator])
    states = np.empty((len(told) + 1, model.nq))
    for step, ctrl in enumerate(told):
        states[step] = data.qpos
        data.ctrl[:] = ctrl
        if around.act:
            around.act(data)
        mujoco.mj_step(model, data)
    states[-1] = data.qpos
    angles = states[:, places]
    if hidden.effect in ("backlash", "joint_elasticity"):
        # The log has the link's angle: that of the rotor and what lies between them.
        angles[:, around.actuator] += states[:, model.joint("apart").qposadr[0]]
    return angles[settle:]


def read(arm: Arm, hidden: Hidden, angles: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The encoders' readings at every tick."""
    steps = np.arange(len(angles)) * STEP_S
    clock = steps[::STEPS_PER_TICK]
    readings = np.empty((len(clock), len(arm.joints)))
    for i, joint in enumerate(arm.joints):
        here, values = hidden.site in (joint, "*"), hidden.values
        taken = clock
        if here and hidden.on("encoder_delay"):
            taken = np.maximum(0.0, clock - values["delay"])
        if here and hidden.on("clock_skew"):
            taken = clock / (1.0 + values["skew"])
        angle = np.interp(taken, steps, angles[:, i])
        if here and hidden.on("encoder_scale"):
            angle = angle * (1.0 + values["error"])
        if here and hidden.on("encoder_offset"):
            angle = angle + values["offset"]
        readings[:, i] = angle
    noisy = readings + NOISE_RAD * rng.standard_normal(readings.shape)
    return QUANTUM_RAD * np.round(noisy / QUANTUM_RAD)


# ---------------------------------------------------------------- commands of the arm

CLOCK = np.arange(round(DURATION_S / TICK_S) + 1) * TICK_S
# Everything begins at rest and grows from zero within half a second.
EASE = np.minimum(CLOCK / 0.5, 1.0)


def multisine(rng: np.random.Generator) -> np.ndarray:
    middle, wave = between(rng, -0.6, 0.6), np.zeros_like(CLOCK)
    for k in range(5):
        amplitude, phase = between(rng, 0.06, 0.2), between(rng, 0.0, math.tau)
        frequency = 0.3 + 0.6 * k + between(rng, 0.0, 0.3)
        wave += amplitude * (np.sin(math.tau * frequency * CLOCK + phase) - math.sin(phase))
    return middle + EASE * wave


def steps(rng: np.random.Generator) -> np.ndarray:
    middle = between(rng, -0.4, 0.4)
    levels = middle + rng.uniform(-0.5, 0.5, 8)
    number = ((CLOCK - 0.4 + between(rng, 0.0, 0.3)) / 0.5).astype(int) % 8
    return np.where(CLOCK < 0.4, middle, levels[number])


def ramps(rng: np.random.Generator) -> np.ndarray:
    middle, amplitude = between(rng, -0.5, 0.5), between(rng, 0.25, 0.5)
    period, phase = between(rng, 1.6, 2.6), between(rng, 0.0, 1.0)
    triangle = lambda x: 4.0 * np.abs((x - 0.25) % 1.0 - 0.5) - 1.0  # noqa: E731
    return middle + EASE * amplitude * (triangle(CLOCK / period + phase) - triangle(phase))


def chirp(rng: np.random.Generator) -> np.ndarray:
    middle, amplitude = between(rng, -0.4, 0.4), between(rng, 0.12, 0.25)
    slow, fast = between(rng, 0.3, 0.6), between(rng, 3.0, 4.5)
    return middle + amplitude * np.sin(math.tau * (slow * CLOCK + (fast - slow) * CLOCK**2 / (2.0 * DURATION_S)))


LEARN = [multisine, steps, ramps, chirp]
HELD_OUT = [multisine, steps, ramps]


def record(folder: Path, effect: str, seed: int) -> Hidden:
    """Writes the logs of a case."""
    rng = np.random.default_rng(seed)
    arm = Arm(rng)
    episodes = [np.stack([kind(rng) for _ in arm.joints], axis=1) for kind in LEARN + HELD_OUT]
    hidden = hide(effect, np.random.default_rng([seed, EFFECTS.index(effect)]))
    for number, commands in enumerate(episodes):
        readings = read(arm, hidden, simulate(arm, hidden, commands), rng)
        kind = "learn" if number < len(LEARN) else "held"
        with open(folder / f"{kind}{number}.csv", "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["t", *(f"cmd_{joint}" for joint in arm.joints), *(f"q_{joint}" for joint in arm.joints)])
            for t, told, said in zip(CLOCK, commands, readings):
                writer.writerow([f"{t:.2f}", *(f"{x:.6f}" for x in told), *(f"{x:.7f}" for x in said)])
    return hidden


# ---------------------------------------------------------------- results of btr


@dataclass
class Outcome:
    hidden: Hidden
    seed: int
    score: str
    found: list[str]
    verdict: str
    before: float
    after: float
    rollouts: int
    seconds: float

    def line(self) -> str:
        hidden = f"{self.hidden.name()} ({self.hidden.describe()})"
        found = " + ".join(self.found) or self.verdict
        return (
            f"{self.score:<11} {self.seed:>5} {hidden:<78} -> {found:<44}"
            f"{self.before:7.2f} -> {self.after:5.2f} sigma {self.rollouts:6} rollouts {self.seconds:6.1f} s"
        )


def diagnose(btr: str, folder: Path, hidden: Hidden, seed: int, rivals: dict[str, set[str]]) -> Outcome:
    learn, held = (sorted(map(str, folder.glob(f"{kind}*.csv"))) for kind in ("learn", "held"))
    begin = time.monotonic()
    said = ask(btr, "diagnose", str(MODEL), *learn, "--held-out", *held)
    seconds = time.monotonic() - begin
    found = [f"{effect['effect']}@{effect['site']}" for effect in said["effects"]]
    ladder = [step["held_out"] for step in said["error_ladder"]]
    before = ladder[min(1, len(ladder) - 1)]
    outcome = score(said, hidden.name(), found, rivals)
    return Outcome(hidden, seed, outcome, found, said["verdict"], before, ladder[-1], said["rollouts"], seconds)


def score(said: dict, truth: str, found: list[str], rivals: dict[str, set[str]]) -> str:
    wanted = [] if truth == "none" else [truth]
    if found == wanted and (found or said["verdict"] == "nothing_missing"):
        return "exact"
    if said["verdict"] == "unexplained":
        return "unexplained"
    if not found:
        return "silent"
    if truth in found:
        return "extra"
    if len(found) == 1 and (truth in said["effects"][0]["alike"] or alike(truth, found[0], rivals)):
        return "equivalent"
    return "wrong"


# The joint that carries a link; an effect on the base or on all joints may look like one on any joint.
CARRIER = {"turret": "yaw", "upper": "shoulder", "forearm": "elbow"}


def alike(one: str, other: str, rivals: dict[str, set[str]]) -> bool:
    """Whether the library declares two effects as similar, and they act on the same joint."""
    (effect, site), (effect2, site2) = one.split("@"), other.split("@") if "@" in other else (other, "")
    joint, joint2 = CARRIER.get(site, site), CARRIER.get(site2, site2)
    everywhere = {"base", "robot", "*"}
    here = joint == joint2 or joint in everywhere or joint2 in everywhere
    return here and (effect2 in rivals.get(effect, set()) or effect in rivals.get(effect2, set()))


def summary(outcomes: list[Outcome]) -> str:
    counts = Counter(outcome.score for outcome in outcomes)
    lines = [f"\n{len(outcomes)} cases"]
    lines += [f"  {score:<12}{count:4} {100 * count / len(outcomes):6.1f} %" for score, count in counts.most_common()]
    median = lambda of: statistics.median(getattr(outcome, of) for outcome in outcomes)  # noqa: E731
    lines.append(f"held-out error, median: {median('before'):.2f} -> {median('after'):.3f} sigma")
    lines.append(f"rollouts: median {median('rollouts'):.0f}, most {max(outcome.rollouts for outcome in outcomes)}")
    lines.append(f"seconds: median {median('seconds'):.1f}, most {max(outcome.seconds for outcome in outcomes):.1f}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--btr", default=BTR)
    parser.add_argument("--seeds", default="1000..1003", help="A..B, B excluded; those below 1000 are for tuning")
    parser.add_argument("--effects", default=",".join(EFFECTS), help=f"of {', '.join(EFFECTS)}")
    parser.add_argument("--keep", type=Path, help="where to keep the logs, a folder per case")
    args = parser.parse_args()
    first, last = map(int, args.seeds.split(".."))
    rivals = {effect["effect"]: set(effect["alike"]) for effect in ask(args.btr, "effects")["effects"]}
    outcomes = []
    for seed in range(first, last):
        for effect in args.effects.split(","):
            with tempfile.TemporaryDirectory() as temporary:
                folder = args.keep / f"{effect}-{seed}" if args.keep else Path(temporary)
                folder.mkdir(parents=True, exist_ok=True)
                hidden = record(folder, effect, seed)
                outcomes.append(diagnose(args.btr, folder, hidden, seed, rivals))
            print(outcomes[-1].line(), flush=True)
    print(summary(outcomes))


if __name__ == "__main__":
    main()
