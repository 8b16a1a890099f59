"""Links and joints as URDF."""

from __future__ import annotations

from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from btr._mujoco.actuators import Motors
from btr._mujoco.equalities import Mimic
from btr._mujoco.names import Names
from btr._mujoco.trees import Tree

SLIDE = 2
Vector = NDArray[np.float64]
GEOMETRIES = {
    2: lambda s: f'<sphere radius="{_n(s[0])}"/>',
    3: lambda s: f'<capsule radius="{_n(s[0])}" length="{_n(2 * s[1])}"/>',
    5: lambda s: f'<cylinder radius="{_n(s[0])}" length="{_n(2 * s[1])}"/>',
    6: lambda s: f'<box size="{_v(2 * s)}"/>',
}
"""Shapes that btr has, by `mjtGeom`."""


class Links:
    """The links of a tree. A link's frame has the axes of its body; its origin is on the axis of the body's last joint,
    as URDF requires. A body with several joints becomes as many links, of which the last one has its mass."""

    def __init__(self, mj: Any, tree: Tree, names: Names) -> None:
        self.mj, self.tree, self.names = mj, tree, names
        self.anchor: dict[int, Vector] = {tree.root: np.zeros(3)}
        """The origin of the last link of each body, in its body's frame."""

    def urdf(self, name: str, mimics: dict[int, Mimic], motors: Motors) -> str:
        """The robot as a URDF text."""
        lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(name)}>"]
        root = self.tree.root
        lines += self._link(root, self.names.body(root))
        for body in self.tree.bodies:
            if body != root:
                lines += self._body(body, mimics, motors)
        return "\n".join([*lines, "</robot>\n"])

    def _body(self, body: int, mimics: dict[int, Mimic], motors: Motors) -> list[str]:
        mj, name = self.mj, self.names.body(body)
        parent = int(mj.body_parentid[body])
        before, parent_name = self.anchor[parent], self.names.body(parent)
        turn, at = rotation(mj.body_quat[body]), mj.body_pos[body] - before
        joints, lines = self.tree.joints_of(body), []
        if not joints:
            lines += self._joint(f"{name}_fixed", "fixed", parent_name, name, at, turn, [])
        reached = np.zeros(3)
        for joint in joints:
            link = name if joint == joints[-1] else self.names.between(body, joint)
            origin, axis = mj.jnt_pos[joint], mj.jnt_axis[joint]
            at, reached = at + turn @ (origin - reached), origin
            # btr's positions are MuJoCo's: the body's pose in the file belongs to the position `ref`.
            zero = float(mj.qpos0[mj.jnt_qposadr[joint]])
            if mj.jnt_type[joint] == SLIDE:
                at = at - turn @ axis * zero
            else:
                turn = turn @ about(axis, -zero)
            lines += self._moving(joint, parent_name, link, at, turn, mimics.get(joint), motors)
            if link != name:
                lines.append(f"  <link name={quoteattr(link)}/>")
            parent_name, at, turn = link, np.zeros(3), np.eye(3)
        self.anchor[body] = reached
        return lines + self._link(body, name)

    def _moving(
        self, joint: int, parent: str, child: str, at: Vector, turn: Vector, mimic: Mimic | None, motors: Motors
    ) -> list[str]:
        mj, dof = self.mj, self.mj.jnt_dofadr[joint]
        slides, limited = mj.jnt_type[joint] == SLIDE, bool(mj.jnt_limited[joint])
        kind = "prismatic" if slides else "revolute" if limited else "continuous"
        damping = 0.0 if motors.undamped else float(mj.dof_damping[dof]) + motors.damping(joint)
        inner = [
            f'<axis xyz="{_v(mj.jnt_axis[joint])}"/>',
            f'<dynamics damping="{_n(damping)}" friction="{_n(mj.dof_frictionloss[dof])}"/>',
        ]
        if limited:
            low, high = mj.jnt_range[joint]
            effort = motors.limit(joint)
            bound = f'effort="{_n(effort if np.isfinite(effort) else 1e6)}" velocity="1000000"'
            inner.append(f'<limit lower="{_n(low)}" upper="{_n(high)}" {bound}/>')
        if mimic is not None:
            leader = quoteattr(self.names.joint(mimic.leader))
            inner.append(f'<mimic joint={leader} multiplier="{_n(mimic.ratio)}" offset="{_n(mimic.offset)}"/>')
        return self._joint(self.names.joint(joint), kind, parent, child, at, turn, inner)

    def _joint(
        self, name: str, kind: str, parent: str, child: str, at: Vector, turn: Vector, inner: list[str]
    ) -> list[str]:
        head = [
            f"  <joint name={quoteattr(name)} type=\"{kind}\">",
            f"    {_origin(at, turn)}",
            f"    <parent link={quoteattr(parent)}/>",
            f"    <child link={quoteattr(child)}/>",
        ]
        return [*head, *(f"    {element}" for element in inner), "  </joint>"]

    def _link(self, body: int, name: str) -> list[str]:
        mj, anchor = self.mj, self.anchor[body]
        lines = [f"  <link name={quoteattr(name)}>"]
        if body and mj.body_mass[body] > 0:
            turn = rotation(mj.body_iquat[body])
            i = turn @ np.diag(mj.body_inertia[body]) @ turn.T
            named = zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), i[np.triu_indices(3)])
            lines += [
                "    <inertial>",
                f'      <origin xyz="{_v(mj.body_ipos[body] - anchor)}" rpy="0 0 0"/>',
                f'      <mass value="{_n(mj.body_mass[body])}"/>',
                "      <inertia " + " ".join(f'{key}="{_n(value)}"' for key, value in named) + "/>",
                "    </inertial>",
            ]
        for geom in self.tree.shapes():
            if mj.geom_bodyid[geom] == body and mj.geom_type[geom] in GEOMETRIES:
                origin = _origin(mj.geom_pos[geom] - anchor, rotation(mj.geom_quat[geom]))
                shape = GEOMETRIES[mj.geom_type[geom]](mj.geom_size[geom])
                lines += [f"    <{e}>{origin}<geometry>{shape}</geometry></{e}>" for e in ("visual", "collision")]
        return [*lines, "  </link>"]


def rotation(quaternion: Vector) -> Vector:
    """The matrix of a quaternion w, x, y, z."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def about(axis: Vector, angle: float) -> Vector:
    """The matrix of a turn about a unit axis."""
    return rotation(np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)]))


def roll_pitch_yaw(turn: Vector) -> Vector:
    """The angles of URDF. Roll is what remains after yaw and pitch: this is exact also where pitch is a right angle and
    yaw is arbitrary."""
    pitch = np.arctan2(-turn[2, 0], np.hypot(turn[0, 0], turn[1, 0]))
    yaw = np.arctan2(turn[1, 0], turn[0, 0])
    rest = about(np.array([0.0, 1.0, 0.0]), -pitch) @ about(np.array([0.0, 0.0, 1.0]), -yaw) @ turn
    return np.array([np.arctan2(rest[2, 1], rest[2, 2]), pitch, yaw])


def _origin(at: Vector, turn: Vector) -> str:
    return f'<origin xyz="{_v(at)}" rpy="{_v(roll_pitch_yaw(turn))}"/>'


def _n(value: float) -> str:
    return repr(float(value))


def _v(values: Vector) -> str:
    return " ".join(map(_n, values))
