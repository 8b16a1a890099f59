"""Where the links of a robot are over a whole motion, for many robots that are drawn at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Union

import numpy as np
from numpy.typing import NDArray
from viser import transforms

from btr._studio.replay import Replay, Series
from btr._studio.robot import Link, Robot
from btr._studio.scene import base_of, held

FRAME_S = 1 / 25

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Poses of all links in frames of 1/25 s, each held at the end."""

    wxyz: Array
    """Orientations, shape (frames, links, 4)."""
    xyz_m: Array
    """Positions, shape (frames, links, 3)."""

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Orientations (links, 4) and positions (links, 3) at a time."""
        frame = min(max(0, round(time_s / FRAME_S)), len(self.xyz_m) - 1)
        return self.wxyz[frame], self.xyz_m[frame]


def motion_of(robot: Robot, joints: list[str], measured: Replay) -> Motion:
    """A log's motion; what no sensor saw is as the simulation beside it has it."""
    clock = measured.run.clock_s
    times = np.arange(0.0, float(clock[-1]) + FRAME_S, FRAME_S)
    positions = {joint: _series(measured, f"q_{joint}", times) for joint in joints}
    known = {joint: values for joint, values in positions.items() if values is not None}
    base = base_of(measured.run.measured)
    base = base_of(measured.simulated.get) if base is None else base
    root = None if base is None else np.stack([np.interp(times, clock, part) for part in base.T], axis=1)
    return _poses(robot, known, root, len(times))


def _series(replay: Replay, channel: str, times: Series) -> Union[Series, None]:
    values = replay.run.measured(channel)
    values = replay.simulated.get(channel) if values is None else held(values)
    return None if values is None else np.asarray(np.interp(times, replay.run.clock_s, values))


def _poses(robot: Robot, positions: Mapping[str, Series], root: Union[Array, None], frames: int) -> Motion:
    """Forward kinematics, of all frames at once."""
    base = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (frames, 1)) if root is None else root
    world = _pose(transforms.SO3(_unit(base[:, 3:])), base[:, :3])
    poses: dict[Union[str, None], transforms.SE3] = {None: world}
    for link in robot.links:
        poses[link.name] = poses[link.parent] @ _joint(link, _position(link, positions, frames))
    links = [poses[link.name] for link in robot.links]
    wxyz = np.stack([pose.rotation().wxyz for pose in links], axis=1)
    return Motion(wxyz, np.stack([pose.translation() for pose in links], axis=1))


def _position(link: Link, positions: Mapping[str, Series], frames: int) -> Series:
    leader, ratio, offset = link.joint, 1.0, 0.0
    if link.mimic is not None:
        leader, ratio, offset = link.mimic.leader, link.mimic.ratio, link.mimic.offset
    return ratio * positions.get(leader, np.zeros(frames)) + offset


def _joint(link: Link, position: Series) -> transforms.SE3:
    """The pose of a link in its parent's frame, shape (frames,)."""
    many = len(position)
    origin = np.tile(transforms.SO3.from_rpy_radians(*link.rpy_rad).wxyz, (many, 1))
    placed = _pose(transforms.SO3(origin), np.tile(link.xyz_m, (many, 1)))
    moved = np.outer(position, link.axis)
    if link.kind == "prismatic":
        return placed @ _pose(transforms.SO3.identity(batch_axes=(many,)), moved)
    turned = transforms.SO3.identity(batch_axes=(many,)) if link.kind == "fixed" else transforms.SO3.exp(moved)
    return placed @ _pose(turned, np.zeros((many, 3)))


def _pose(rotation: transforms.SO3, translation: Array) -> transforms.SE3:
    return transforms.SE3.from_rotation_and_translation(rotation, translation)


def _unit(quaternions: Array) -> Array:
    return np.asarray(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))
