"""The MuJoCo model of a robot with hidden effects, with MuJoCo's defaults for solver, friction and limits.

MuJoCo's own implementation of an effect is used if there is one. Its dry friction is a soft constraint that creeps
under load, as everybody has it who does not change the defaults. Effects in a servo, a sensor or a clock, and laws that
MuJoCo lacks, act around `mj_step`; see `simulation`.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field

import mujoco
import numpy as np

from .robots import GRAVITY, Robot, Vector, number, rotation, skeleton, text

# Rotor of a joint of which none is known, as a share of the inertia that the joint carries: rotor and link are apart.
ROTOR = 0.02
# Effects that put something between the rotor and the link.
APART = ("backlash", "joint_elasticity")


@dataclass
class Hidden:
    """Something that reality has and the model lacks or has wrong."""

    effect: str
    site: str
    values: dict[str, float] = field(default_factory=dict)
    # Seed of what it does at random.
    seed: int = 0

    @property
    def name(self) -> str:
        """Effect and site, as btr names them."""
        return f"{self.effect}@{self.site}"


@dataclass(frozen=True)
class Numerics:
    """Integrator and step of MuJoCo."""

    integrator: str
    step_s: float


def plant(robot: Robot, hidden: list[Hidden], numerics: Numerics, carried: Vector) -> mujoco.MjModel:
    """The robot with its servos and all that MuJoCo implements itself."""
    root = skeleton(robot)
    here = {(h.effect, h.site): h.values for h in hidden}
    gravity = here.get(("gravity_tilt", "base"))
    weight = GRAVITY if gravity is None else rotation((gravity["roll"], gravity["pitch"], 0.0)).T @ GRAVITY
    option = {"timestep": number(numerics.step_s), "integrator": numerics.integrator, "gravity": text(weight)}
    root.insert(1, ET.Element("option", option))
    actuators = ET.SubElement(root, "actuator")
    bodies = {body.get("name"): body for body in root.iter("body")}
    for i, axis in enumerate(robot.axes):
        body = bodies[axis.link]
        joint = body.find("joint")
        assert joint is not None
        change_inertia(body, axis.link, here)
        change_hinge(joint, axis.joint, here)
        for apart in APART:
            if (apart, axis.joint) in here:
                split(body, joint, i, here[apart, axis.joint], carried[i])
        position = {"name": axis.joint, "joint": axis.joint, "kp": number(axis.kp), "kv": number(axis.kd)}
        if limited(axis.joint, here):
            position["forcerange"] = "-1e6 1e6"
        ET.SubElement(actuators, "position", position)
    return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))


Here = dict[tuple[str, str], dict[str, float]]


def limited(joint: str, here: Here) -> bool:
    """Whether the motor's torque has a limit, which is set later."""
    return any((name, joint) in here for name in ("torque_limit", "speed_torque_limit"))


def change_inertia(body: ET.Element, link: str, here: Here) -> None:
    """Payload, another centre of mass, more inertia."""
    inertial = body.find("inertial")
    assert inertial is not None
    mass = float(inertial.get("mass", "0"))
    com = np.array(inertial.get("pos", "").split(), float)
    moments = np.array(inertial.get("diaginertia", "").split(), float)
    if values := here.get(("com_offset", link)):
        com += [values[axis] for axis in "xyz"]
    if values := here.get(("link_inertia", link)):
        moments += values["inertia"]
    if values := here.get(("payload", link)):
        mass += values["mass"]
    inertial.set("mass", number(mass))
    inertial.set("pos", text(com))
    inertial.set("diaginertia", text(moments))
    if values := here.get(("payload_at_end", link)):
        tip = ET.SubElement(body, "body", name="tip", pos=text(np.array([values[axis] for axis in "xyz"])))
        mass_at_end = number(values["mass"])
        ET.SubElement(tip, "geom", type="sphere", size="0.001", mass=mass_at_end, contype="0", conaffinity="0")


def change_hinge(joint: ET.Element, name: str, here: Here) -> None:
    """Effects on a hinge that MuJoCo implements itself; 1 stands for friction that is set before every step."""
    for (effect, site), values in here.items():
        if site != name:
            continue
        match effect:
            case "coulomb_friction":
                joint.set("frictionloss", number(values["torque"]))
            case "stribeck_friction" | "asymmetric_friction" | "load_dependent_friction" | "posture_friction":
                joint.set("frictionloss", "1")
            case "viscous_friction":
                joint.set("damping", number(values["coefficient"]))
            case "armature":
                joint.set("armature", number(float(joint.get("armature", "0")) + values["inertia"]))
            case "parallel_spring":
                joint.set("stiffness", number(values["stiffness"]))
                joint.set("springref", number(values["rest"]))


# Laws that MuJoCo's soft dry friction carries.
DRY = {
    "coulomb_friction", "stribeck_friction", "asymmetric_friction", "load_dependent_friction", "posture_friction",
}  # fmt: skip


def softness(robot: Robot, hidden: list[Hidden], numerics: Numerics, carried: Vector) -> list[Hidden]:
    """How MuJoCo's constraints give way: dry friction as btr's friction_creep, friction f with a + b·v = -R·f, where R
    is a share of the joint's inverse inertia (MuJoCo's documentation, chapter Computation); the flanks between which
    a joint is loose as its joint_elasticity, whose stiffness is not computed here."""
    model = plant(robot, hidden, numerics, carried)
    found = []
    for site in dict.fromkeys(h.site for h in hidden if h.effect in DRY):
        dof = int(model.joint(site).dofadr[0])
        impedance, most = model.dof_solimp[dof][:2]
        time_s = 0.5 * most * model.dof_solref[dof][0]
        creep = time_s * (1.0 - impedance) / impedance * model.dof_invweight0[dof]
        found.append(Hidden("friction_creep", site, {"creep": float(creep), "time_constant": float(time_s)}))
    return found + [Hidden("joint_elasticity", h.site, {}) for h in hidden if h.effect == "backlash"]


def split(body: ET.Element, joint: ET.Element, index: int, values: dict[str, float], carried: float) -> None:
    """Puts a second hinge between the rotor and the link: with a spring, or loose between two stops."""
    if float(joint.get("armature", "0")) <= 0.0:
        joint.set("armature", number(ROTOR * carried))
    apart = ET.Element("joint", name=f"apart_{index}", axis=joint.get("axis", ""))
    if "gap" in values:
        half = 0.5 * values["gap"]
        apart.set("limited", "true")
        apart.set("range", f"{-half:.12g} {half:.12g}")
        # Flanks of steel: with the default, they would be a spring of their own beside a light rotor.
        apart.set("solreflimit", "0.0005 1")
    else:
        apart.set("stiffness", number(values["stiffness"]))
        apart.set("damping", number(values["damping"]))
    body.insert(list(body).index(joint) + 1, apart)
