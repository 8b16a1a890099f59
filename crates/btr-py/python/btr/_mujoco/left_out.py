"""Everything else of a model that btr cannot represent, in words."""

from __future__ import annotations

from typing import Any

import numpy as np

from btr._mujoco.links import GEOMETRIES
from btr._mujoco.names import Names, name_of
from btr._mujoco.trees import FREE, Tree


def left_out(mj: Any, tree: Tree, names: Names, notes: list[str]) -> None:
    """Appends what the robot or its world has and btr does not."""
    _joints(mj, tree, names, notes)
    _tendons(mj, notes)
    _contacts(mj, tree, names, notes)
    _world(mj, tree, names, notes)


def _joints(mj: Any, tree: Tree, names: Names, notes: list[str]) -> None:
    for j in range(mj.njnt):
        if mj.jnt_type[j] != FREE or mj.jnt_bodyid[j] != tree.root:
            continue
        dofs = slice(mj.jnt_dofadr[j], mj.jnt_dofadr[j] + 6)
        for what in ("damping", "armature", "frictionloss"):
            if np.any(getattr(mj, f"dof_{what}")[dofs]):
                notes.append(f"{what} of the base's own motion: only joints have it")
        if not np.allclose(np.abs(mj.body_quat[tree.root]), [1, 0, 0, 0]) or np.any(mj.body_pos[tree.root][:2]):
            notes.append("the base's initial place and direction: a robot starts upright at the origin, or as its log")
    for what, values, index in (
        ("a damping that is not linear", "dof_dampingpoly", mj.jnt_dofadr),
        ("a spring that is not linear", "jnt_stiffnesspoly", np.arange(mj.njnt)),
        ("a spring that yields", "jnt_springyield", np.arange(mj.njnt)),
    ):
        all_values = getattr(mj, values, np.zeros(mj.nv))
        having = [names.joint(j) for j in tree.joints if np.any(all_values[index[j]])]
        if having:
            notes.append(f"{what}, of the joints {', '.join(having)}")


def _tendons(mj: Any, notes: list[str]) -> None:
    """Tendons that do something by themselves; their actuators and equalities are noted with those."""
    forces = ("stiffness", "damping", "frictionloss", "armature", "limited")
    for tendon in range(mj.ntendon):
        does = [what for what in forces if np.any(getattr(mj, f"tendon_{what}")[tendon])]
        what = f"with its {', '.join(does)}" if does else "which has no force of its own"
        notes.append(f"the tendon `{name_of(mj, 'tendon', tendon)}`, {what}")


def _contacts(mj: Any, tree: Tree, names: Names, notes: list[str]) -> None:
    shapes = tree.shapes()
    if not tree.floating:
        if shapes:
            notes.append("contacts: a robot with a fixed base touches nothing in btr")
        return
    strange = sorted({names.body(mj.geom_bodyid[g]) for g in shapes if mj.geom_type[g] not in GEOMETRIES})
    if strange:
        notes.append(f"contact shapes that are no box, sphere, cylinder or capsule, of the links {', '.join(strange)}")
    if len({float(mj.geom_friction[g][0]) for g in shapes}) > 1:
        notes.append("the shapes' different friction: the ground has one coefficient, the largest")
    notes.append("the softness of contacts (solref, solimp), and contacts between links: the ground is hard")
    planes = tree.planes()
    flat = [g for g in planes if mj.geom_pos[g][2] == 0 and np.allclose(np.abs(mj.geom_quat[g]), [1, 0, 0, 0])]
    if not planes:
        notes.append("the absence of a ground: btr has one at z = 0 m under a floating base")
    elif not flat:
        notes.append("the place of the ground: btr's is level and at z = 0 m")


def _world(mj: Any, tree: Tree, names: Names, notes: list[str]) -> None:
    if mj.opt.density or mj.opt.viscosity or np.any(mj.opt.wind):
        notes.append("the fluid (density, viscosity, wind)")
    lifted = [names.body(body) for body in tree.bodies if mj.body_gravcomp[body]]
    if lifted:
        notes.append(f"gravity compensation (gravcomp) of the links {', '.join(lifted)}")
    joints = np.array(tree.joints, dtype=int)
    if np.any(mj.dof_frictionloss[mj.jnt_dofadr[joints]]):
        notes.append("the creep of dry friction (frictionloss is a soft constraint): btr's holds at rest")
    if np.any(mj.jnt_limited[joints]):
        notes.append("the softness of the joints' limits (solref, solimp, margin)")
    world_shapes = [g for g in range(mj.ngeom) if mj.geom_bodyid[g] not in tree.bodies and g not in tree.planes()]
    if tree.floating and any(mj.geom_contype[g] or mj.geom_conaffinity[g] for g in world_shapes):
        notes.append("obstacles: the world is a level ground")
    places = "keyframes: a log says where it begins"
    counts = ((mj.nplugin, "plug-ins"), (mj.nkey, places), (mj.nsensor, "sensors"))
    notes += [what for count, what in counts if count]
