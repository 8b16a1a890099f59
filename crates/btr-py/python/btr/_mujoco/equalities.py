"""Equality constraints: joints that follow others, and loops that btr does not have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from btr._btr import BtrError
from btr._mujoco.names import Names, name_of
from btr._mujoco.trees import Tree

CONNECT, WELD, JOINT, TENDON, DISTANCE = 0, 1, 2, 3, 7
"""Types of constraints (`mjtEq`)."""
SITE = 6
"""A kind of object (`mjtObj`)."""
LOOPS = {CONNECT: "connect", WELD: "weld", DISTANCE: "distance"}


@dataclass
class Mimic:
    """q = ratio·q_leader + offset."""

    leader: int
    ratio: float
    offset: float


def equalities(mj: Any, tree: Tree, names: Names, notes: list[str]) -> dict[int, Mimic]:
    """The joints that follow others, by joint. Raises `BtrError` for an active loop."""
    mimics: dict[int, Mimic] = {}
    for index in range(mj.neq):
        kind, name = int(mj.eq_type[index]), name_of(mj, "equality", index)
        if not mj.eq_active0[index]:
            notes.append(f"the equality `{name}`, which is not active at the start")
        elif kind in LOOPS:
            _refuse_loop(mj, tree, index, name, notes)
        elif kind == JOINT:
            _follow(mj, tree, index, name, mimics, notes)
        else:
            notes.append(f"the equality `{name}` of tendons" if kind == TENDON else f"the equality `{name}`")
    if mimics:
        notes.append("the softness of equalities (solref, solimp): what follows a joint follows it exactly")
    return mimics


def _refuse_loop(mj: Any, tree: Tree, index: int, name: str, notes: list[str]) -> None:
    bodies = [int(mj.eq_obj1id[index]), int(mj.eq_obj2id[index])]
    if mj.eq_objtype[index] == SITE:
        bodies = [int(mj.site_bodyid[site]) for site in bodies]
    if not set(bodies) & set(tree.bodies):
        notes.append(f"the equality `{name}`, which is not one of the robot")
        return
    between = " and ".join(f"`{name_of(mj, 'body', body) if body > 0 else 'world'}`" for body in bodies)
    raise BtrError(
        f"the equality `{name}` ({LOOPS[int(mj.eq_type[index])]}) closes a loop between {between}; a robot in btr is a "
        'tree\nhelp: if the robot can do without it, set active="false" on it in the MJCF, or describe a linkage by an '
        "equality of two joints"
    )


def _follow(mj: Any, tree: Tree, index: int, name: str, mimics: dict[int, Mimic], notes: list[str]) -> None:
    follower, leader = int(mj.eq_obj1id[index]), int(mj.eq_obj2id[index])
    constant, ratio, *higher = (float(c) for c in mj.eq_data[index][:5])
    if follower not in tree.joints and leader not in tree.joints:
        return
    if leader < 0:
        notes.append(f"the equality `{name}`, which holds the joint `{name_of(mj, 'joint', follower)}` in its place")
    elif any(higher):
        notes.append(f"the equality `{name}`: joints follow others linearly in btr, not by a polynomial")
    elif follower in mimics:
        joint = name_of(mj, "joint", follower)
        notes.append(f"the equality `{name}`: the joint `{joint}` already follows another one")
    else:
        zero, leader_zero = (float(mj.qpos0[mj.jnt_qposadr[joint]]) for joint in (follower, leader))
        mimics[follower] = Mimic(leader, ratio, zero + constant - ratio * leader_zero)
