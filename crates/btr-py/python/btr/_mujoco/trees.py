"""Which bodies of a scene are the robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from btr._btr import BtrError
from btr._mujoco.names import name_of

FREE, BALL = 0, 1
"""Types of joints (`mjtJoint`); 2 is a slide, 3 a hinge."""
SLIGHT = 1e-3
"""How far gravity may be tilted, in rad."""
PLANE = 0
"""A type of shapes (`mjtGeom`)."""


@dataclass
class Tree:
    """The bodies of the robot, parents first."""

    mj: Any
    root: int
    """The body of the root link: the world's (0) where the base is fixed."""
    bodies: list[int]

    @property
    def floating(self) -> bool:
        return self.root != 0

    @property
    def joints(self) -> list[int]:
        """Its hinges and slides."""
        mine = set(self.bodies)
        return [j for j in range(self.mj.njnt) if self.mj.jnt_bodyid[j] in mine and self.mj.jnt_type[j] != FREE]

    def joints_of(self, body: int) -> list[int]:
        first, count = self.mj.body_jntadr[body], self.mj.body_jntnum[body]
        return [j for j in range(first, first + count) if self.mj.jnt_type[j] != FREE]

    def shapes(self) -> list[int]:
        """The geoms of the robot that collide."""
        mj, mine = self.mj, set(self.bodies)
        collides = [g for g in range(mj.ngeom) if mj.geom_contype[g] or mj.geom_conaffinity[g]]
        return [g for g in collides if mj.geom_bodyid[g] in mine]

    def planes(self) -> list[int]:
        """The world's planes that collide."""
        mj = self.mj
        collides = [g for g in range(mj.ngeom) if mj.geom_contype[g] or mj.geom_conaffinity[g]]
        return [g for g in collides if mj.geom_bodyid[g] == 0 and mj.geom_type[g] == PLANE]

    def ground_friction(self) -> float | None:
        """Of two shapes, MuJoCo takes the larger coefficient; the robot's shapes are taken as one."""
        if not (self.floating and self.planes()):
            return None
        return float(max(self.mj.geom_friction[g][0] for g in [*self.planes()[:1], *self.shapes()]))


def tree_of(mj: Any, root: str | None, notes: list[str]) -> Tree:
    """The robot of a scene: the tree of the body `root`, or the only one that there is."""
    tree = _named(mj, root) if root is not None else _only(mj, notes)
    if mj.nflex:
        raise BtrError("the model has flexes, which btr does not simulate\nhelp: remove the soft bodies from the model")
    balls = [name_of(mj, "joint", j) for j in tree.joints if mj.jnt_type[j] == BALL]
    if balls:
        raise BtrError(
            f"btr has no ball joints: {', '.join(balls)}\nhelp: replace each by three hinges with crossing axes"
        )
    aside, along = float(np.hypot(*mj.opt.gravity[:2])), abs(float(mj.opt.gravity[2]))
    if aside > SLIGHT * along:
        raise BtrError("gravity does not point along z\nhelp: turn the robot instead of gravity")
    if aside:
        notes.append(f"gravity's tilt of {aside / along:.2g} rad")
    if not tree.joints and not tree.floating:
        raise BtrError("the model has no joint that moves\nhelp: give the model of a robot")
    return tree


def _below(mj: Any, top: int) -> list[int]:
    """A body and all that it carries."""
    below = [top]
    for body in range(top + 1, mj.nbody):
        if mj.body_parentid[body] in below:
            below.append(body)
    return below


def _floats(mj: Any, body: int) -> bool:
    return bool(mj.body_jntnum[body] > 0 and mj.jnt_type[mj.body_jntadr[body]] == FREE)


def _named(mj: Any, root: str) -> Tree:
    named = [body for body in range(1, mj.nbody) if mj.body(body).name == root]
    if not named:
        known = ", ".join(mj.body(top).name for top in _tops(mj)) or "none"
        raise BtrError(f"there is no body `{root}`\nhelp: bodies that carry joints: {known}")
    top = named[0]
    if _floats(mj, top):
        return Tree(mj, top, _below(mj, top))
    above = int(mj.body_parentid[top])
    if mj.body_weldid[above] != 0:
        raise BtrError(f"the parent of the body `{root}` moves\nhelp: name the first body of the robot as its root")
    ancestors: list[int] = []
    while above:
        ancestors.insert(0, above)
        above = int(mj.body_parentid[above])
    return Tree(mj, 0, [*ancestors, *_below(mj, top)])


def _tops(mj: Any) -> list[int]:
    """The bodies in the world that have joints or carry some."""
    tops = [body for body in range(1, mj.nbody) if mj.body_parentid[body] == 0]
    return [top for top in tops if any(mj.body_jntnum[body] for body in _below(mj, top))]


def _only(mj: Any, notes: list[str]) -> Tree:
    tops = _tops(mj)
    floating = [top for top in tops if _floats(mj, top)]
    fixed = [top for top in tops if top not in floating]
    # What only floats is an object on which the robot acts, unless there is nothing else.
    robots = [top for top in floating if sum(int(mj.body_jntnum[body]) for body in _below(mj, top)) > 1]
    if not fixed and not robots:
        robots = floating
    if len(robots) > 1 or (robots and fixed):
        names = ", ".join(f"`{name_of(mj, 'body', top)}`" for top in [*robots, *fixed])
        raise BtrError(f"the model has several robots: {names}\nhelp: name the first body of one, root=...")
    objects = [name_of(mj, "body", top) for top in floating if top not in robots]
    if objects:
        notes.append(f"bodies that move freely beside the robot: {', '.join(objects)}")
    if robots:
        return Tree(mj, robots[0], _below(mj, robots[0]))
    return Tree(mj, 0, sorted(body for top in fixed for body in _below(mj, top)))
