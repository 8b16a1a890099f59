"""Generated robots: a chain of 2 to 7 joints on a mounting, as URDF, as a model of btr, and as a told (wrong) copy."""

from __future__ import annotations

import copy
import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

Random = np.random.Generator
Vector = npt.NDArray[Any]

MOUNTS = {"up": (0.0, 0.0, 0.0), "down": (math.pi, 0.0, 0.0), "sideways": (math.pi / 2, 0.0, 0.0)}
GRAVITY = np.array([0.0, 0.0, -9.81])


def between(rng: Random, least: float, most: float) -> float:
    """A uniform number."""
    return float(rng.uniform(least, most))


def scaled(rng: Random, least: float, most: float) -> float:
    """A number whose logarithm is uniform."""
    return math.exp(between(rng, math.log(least), math.log(most)))


def sign(rng: Random) -> float:
    """Plus or minus one."""
    return 1.0 if rng.random() < 0.5 else -1.0


def text(numbers: Vector | tuple[float, ...]) -> str:
    """Numbers as URDF and MJCF write them."""
    return " ".join(f"{x:.12g}" for x in numbers)


def number(x: float) -> str:
    """A number as URDF and MJCF write it."""
    return f"{x:.15g}"


def rotation(rpy: Vector | tuple[float, ...]) -> Vector:
    """Matrix of URDF's roll, pitch and yaw."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in rpy)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def quaternion(rpy: Vector | tuple[float, ...]) -> str:
    """MJCF's quaternion of URDF's roll, pitch and yaw."""
    q = np.zeros(4)
    mujoco.mju_mat2Quat(q, rotation(rpy).ravel())
    return text(q)


@dataclass
class Axis:
    """A joint, its servo, and the link that it moves. All in SI units and in the link's frame."""

    joint: str
    link: str
    origin: Vector
    rpy: Vector
    axis: Vector
    end: Vector
    mass: float
    com: Vector
    inertia: Vector
    inertia_rpy: Vector
    kp: float = 1.0
    kd: float = 0.0
    armature: float = 0.0


@dataclass
class Robot:
    """A chain of joints on a mounting."""

    mount: str
    axes: list[Axis]
    stiff: bool = False
    middle: Vector = field(default_factory=lambda: np.zeros(0))

    @property
    def joints(self) -> list[str]:
        """Names of the joints from the base on."""
        return [axis.joint for axis in self.axes]

    @property
    def links(self) -> list[str]:
        """Names of the links that move."""
        return [axis.link for axis in self.axes]

    def at(self, site: str) -> int:
        """Index of a joint, or of the joint that moves a link."""
        return next(i for i, axis in enumerate(self.axes) if site in (axis.joint, axis.link))

    def copy(self) -> Robot:
        """An independent copy."""
        return copy.deepcopy(self)


# ---------------------------------------------------------------- generation


def generate(rng: Random) -> Robot:
    """A robot from its seed: geometry, masses, rotors, then gains that suit them."""
    count = int(rng.choice([2, 3, 4, 5, 6, 7], p=[0.2, 0.25, 0.2, 0.15, 0.1, 0.1]))
    size = scaled(rng, 0.06, 0.3)
    density = scaled(rng, 2.0, 8.0)
    axes: list[Axis] = []
    rolled = False
    for k in range(count):
        along = np.eye(3)[2 if rng.random() < 0.6 else 0]
        length = size * between(rng, 0.6, 1.4)
        axis = direction(rng, along, may_roll=not rolled)
        rolled = abs(axis @ along) > 0.9
        radius = length * between(rng, 0.12, 0.25)
        mass = density * length * between(rng, 0.6, 1.5) * 0.8**k
        thin = mass * radius**2 / 2
        long = mass * length**2 / 12 + thin / 2
        turned = rng.uniform(-0.4, 0.4, 3) if rng.random() < 0.3 else np.zeros(3)
        before = axes[-1].end if axes else np.array([0.0, 0.0, 0.5 * size])
        axes.append(
            Axis(
                joint=f"joint_{k + 1}",
                link=f"link_{k + 1}",
                origin=before,
                rpy=np.array([0.0, 0.0, 0.0]) if rng.random() < 0.6 else rng.choice([0, 0.5 * math.pi, 0.3], 3),
                axis=axis,
                end=length * along + rng.uniform(-0.1, 0.1, 3) * length,
                mass=mass,
                com=length * between(rng, 0.3, 0.6) * along + rng.uniform(-0.06, 0.06, 3) * length,
                inertia=np.where(along > 0.5, thin, long) * rng.uniform(0.98, 1.02, 3),
                inertia_rpy=turned,
            )
        )
    robot = Robot(str(rng.choice(list(MOUNTS))), axes, stiff=bool(rng.random() < 0.5))
    robot.middle = rng.uniform(-0.8, 0.8, count)
    give_rotors_and_gains(robot, rng)
    return robot


def direction(rng: Random, along: Vector, may_roll: bool) -> Vector:
    """An axis: one of the frame's, now and then oblique. Two rolls about one line never follow each other."""
    choices = [np.eye(3)[i] for i in range(3) if may_roll or along[i] < 0.5]
    axis = choices[int(rng.integers(len(choices)))] * sign(rng)
    if rng.random() < 0.15:
        axis = axis + rng.uniform(-0.5, 0.5, 3)
    return np.asarray(axis / np.linalg.norm(axis))


def give_rotors_and_gains(robot: Robot, rng: Random) -> None:
    """Rotors between nothing and thrice the link's inertia; gains from a bandwidth, which must hold the weight."""
    carried, weight = loads(robot, rng)
    geared = rng.random() < 0.75
    for i, axis in enumerate(robot.axes):
        if geared:
            axis.armature = carried[i] * scaled(rng, 0.05, 3.0)
        moved = carried[i] + axis.armature
        omega = between(rng, 22.0, 50.0) if robot.stiff else between(rng, 8.0, 18.0)
        axis.kp = max(moved * omega**2, weight[i] / (0.1 if robot.stiff else 0.25))
        axis.kd = 2.0 * between(rng, 0.3, 1.2) * math.sqrt(axis.kp * moved)


def loads(robot: Robot, rng: Random) -> tuple[Vector, Vector]:
    """Carried inertia (median) and largest torque of gravity of each joint, over poses around the middle."""
    model = mujoco.MjModel.from_xml_string(ET.tostring(skeleton(robot), encoding="unicode"))
    data = mujoco.MjData(model)
    inertias, weights = [], []
    full = np.zeros((model.nv, model.nv))
    for _ in range(30):
        data.qpos[:] = robot.middle + rng.uniform(-0.7, 0.7, model.nv)
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        inertias.append(np.diag(full).copy())
        weights.append(np.abs(data.qfrc_bias))
    return np.median(inertias, axis=0), np.max(weights, axis=0)


# ---------------------------------------------------------------- MJCF


def skeleton(robot: Robot) -> ET.Element:
    """Bodies and hinges as MJCF, without servos. Hinges have no limits, which the logs never reach."""
    root = ET.Element("mujoco", model="foreign")
    ET.SubElement(root, "compiler", angle="radian")
    world = ET.SubElement(root, "worldbody")
    parent = ET.SubElement(world, "body", name="base", quat=quaternion(MOUNTS[robot.mount]))
    for axis in robot.axes:
        parent = ET.SubElement(parent, "body", name=axis.link, pos=text(axis.origin), quat=quaternion(axis.rpy))
        turned, moments = quaternion(axis.inertia_rpy), text(axis.inertia)
        ET.SubElement(parent, "inertial", pos=text(axis.com), mass=number(axis.mass), quat=turned, diaginertia=moments)
        ET.SubElement(parent, "joint", name=axis.joint, axis=text(axis.axis), armature=number(axis.armature))
    return root


# ---------------------------------------------------------------- URDF and btr's model


def urdf(robot: Robot) -> str:
    """The robot as URDF: a mounting on the world, then the chain."""
    root = ET.Element("robot", name="foreign")
    ET.SubElement(root, "link", name="world")
    mount = ET.SubElement(root, "joint", name="mount", type="fixed")
    ET.SubElement(mount, "parent", link="world")
    ET.SubElement(mount, "child", link="base")
    ET.SubElement(mount, "origin", xyz="0 0 0", rpy=text(MOUNTS[robot.mount]))
    add_link(root, "base", 1.0, np.zeros(3), np.zeros(3), np.full(3, 0.002))
    parent = "base"
    for axis in robot.axes:
        joint = ET.SubElement(root, "joint", name=axis.joint, type="revolute")
        ET.SubElement(joint, "parent", link=parent)
        ET.SubElement(joint, "child", link=axis.link)
        ET.SubElement(joint, "origin", xyz=text(axis.origin), rpy=text(axis.rpy))
        ET.SubElement(joint, "axis", xyz=text(axis.axis))
        ET.SubElement(joint, "limit", lower="-6.2", upper="6.2", effort="1000", velocity="100")
        add_link(root, axis.link, axis.mass, axis.com, axis.inertia_rpy, axis.inertia)
        parent = axis.link
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def add_link(root: ET.Element, name: str, mass: float, com: Vector, rpy: Vector, moments: Vector) -> None:
    """A link with its inertia about its centre of mass."""
    inertial = ET.SubElement(ET.SubElement(root, "link", name=name), "inertial")
    ET.SubElement(inertial, "origin", xyz=text(com), rpy=text(rpy))
    ET.SubElement(inertial, "mass", value=number(mass))
    inertia = {f"i{a}{a}": number(m) for a, m in zip("xyz", moments)} | {"ixy": "0", "ixz": "0", "iyz": "0"}
    ET.SubElement(inertial, "inertia", inertia)


@dataclass
class Told:
    """What the user's model says about the robot."""

    robot: Robot
    # Free parameters: name to the lines after it, such as `relative = [0.8, 1.25]`.
    free: dict[str, str]
    # Effects that the model has, as inline tables.
    effects: list[str]
    noise: str = ""
    simulation: str = ""

    def write(self, folder: Path, name: str) -> Path:
        """Writes `NAME.urdf` and `NAME.toml`."""
        (folder / f"{name}.urdf").write_text(urdf(self.robot))
        lines = [f'name = "{name}"']
        if self.effects:
            lines += ["effects = [", *(f"  {effect}," for effect in self.effects), "]"]
        lines += ["[robot]", f'urdf = "{name}.urdf"', 'base = "fixed"']
        for axis in self.robot.axes:
            lines += [f"[actuators.{axis.joint}]", 'kind = "position"', f"kp = {axis.kp:.9g}", f"kd = {axis.kd:.9g}"]
        lines += [self.simulation, self.noise]
        if self.free:
            lines += ["[parameters]", *(f'"{key}" = {{ {value} }}' for key, value in self.free.items())]
        file = folder / f"{name}.toml"
        file.write_text("\n".join(line for line in lines if line) + "\n")
        return file


def known_rotors(robot: Robot, without: str = "") -> list[str]:
    """The rotors as effects of a model, except that of the joint `without`."""
    return [
        f'{{ effect = "armature", site = "{axis.joint}", inertia = {axis.armature:.9g} }}'
        for axis in robot.axes
        if axis.armature > 0.0 and axis.joint != without
    ]
