"""The tried controllers side by side: one robot per real test, each in a lane of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
import trimesh
import viser
from viser import transforms

from btr._studio.robot import Link, Robot, Shape
from btr._studio.run.motion import FRAME_S, Array, Motion
from btr._studio.scene import STEPS, Colour, along

LANE = 1.0
"""Distance of two lanes, in reaches of the robot."""


@dataclass(frozen=True)
class Walker:
    """A robot of the strip."""

    name: str
    """What is written in its lane."""
    motion: Motion
    """How it moves."""
    merit: float
    """From 0, the worst of the run, to 1, the best."""


class Strip:
    """Robots that move at the same time. All that have the same link are one object, so that there may be many."""

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        self._server, self._robot = server, robot
        self._lane_m = LANE * robot.reach_m
        self._meshes = {number: mesh for number, link in enumerate(robot.links) if (mesh := _mesh(robot, link))}
        self._parts: dict[int, Any] = {}
        self._labels: list[Any] = []
        self._walkers: list[Walker] = []
        self._visible = True

    @property
    def width_m(self) -> float:
        """From the first lane to the last."""
        return max(0, len(self._walkers) - 1) * self._lane_m

    @property
    def length_m(self) -> float:
        """How far the robots go along x, at most."""
        paths = [walker.motion.xyz_m[:, 0, 0] for walker in self._walkers]
        return max((float(path.max() - path.min()) for path in paths), default=0.0)

    @property
    def end_s(self) -> float:
        """How long the longest motion is."""
        return max((FRAME_S * (len(walker.motion.xyz_m) - 1) for walker in self._walkers), default=0.0)

    def load(self, walkers: Sequence[Walker]) -> None:
        """Shows these robots at their beginning."""
        for part in [*self._parts.values(), *self._labels]:
            part.remove()
        self._walkers, self._parts, self._labels = list(walkers), {}, []
        if not walkers:
            return
        wxyz, xyz = self._poses(0.0)
        colours = np.array([colour_of_merit(walker.merit) for walker in walkers], dtype=np.uint8)
        for number, mesh in self._meshes.items():
            self._parts[number] = self._server.scene.add_batched_meshes_simple(
                f"/strip/{number}",
                mesh.vertices,
                mesh.faces,
                wxyz[:, number],
                xyz[:, number],
                batched_colors=colours,
                lod="off",
                visible=self._visible,
            )
        for lane, walker in enumerate(walkers):
            name, place = f"/lanes/{lane}", self._above(xyz[lane])
            label = self._server.scene.add_label(name, walker.name, position=place, visible=self._visible)
            self._labels.append(label)

    def at(self, time_s: float) -> None:
        """Shows a time."""
        if not self._walkers:
            return
        wxyz, xyz = self._poses(time_s)
        with self._server.atomic():
            for number, part in self._parts.items():
                part.batched_wxyzs, part.batched_positions = wxyz[:, number], xyz[:, number]
            for label, links in zip(self._labels, xyz):
                label.position = self._above(links)

    def show(self, visible: bool) -> None:
        """Shows or hides all of it."""
        self._visible = visible
        for part in [*self._parts.values(), *self._labels]:
            part.visible = visible

    def _poses(self, time_s: float) -> tuple[Array, Array]:
        """Poses of every robot's links, shapes (robots, links, 4) and (robots, links, 3)."""
        poses = [walker.motion.at(time_s) for walker in self._walkers]
        wxyz, xyz = np.stack([pose[0] for pose in poses]), np.stack([pose[1] for pose in poses])
        lanes = [self._lane_y(lane) for lane in range(len(self._walkers))]
        return wxyz, xyz + np.array([[[0.0, y, 0.0]] for y in lanes])

    def _above(self, links: Array) -> Array:
        """A place above a robot, by the positions of its links."""
        return np.array([links[0, 0], links[0, 1], links[:, 2].max() + 0.2 * self._robot.reach_m])

    def _lane_y(self, lane: int) -> float:
        # The first one is on the left of who sees them come.
        return (lane - 0.5 * (len(self._walkers) - 1)) * self._lane_m


def merits(fitness: Mapping[int, Union[float, None]]) -> dict[int, float]:
    """Where each fitness is between the worst, 0, and the best, 1; the middle where all are the same or unknown."""
    known = [value for value in fitness.values() if value is not None]
    low, high = min(known, default=0.0), max(known, default=0.0)

    def merit(value: Union[float, None]) -> float:
        return 0.5 if high == low else 0.0 if value is None else (value - low) / (high - low)

    return {number: merit(value) for number, value in fitness.items()}


def colour_of_merit(merit: float) -> Colour:
    """From red, the worst, to green, the best."""
    steps = np.array([colour for _, colour in reversed(STEPS)], dtype=np.float64)
    at = min(1.0, max(0.0, merit)) * (len(steps) - 1)
    red, green, blue = (round(float(np.interp(at, range(len(steps)), part))) for part in steps.T)
    return red, green, blue


def _mesh(robot: Robot, link: Link) -> Any:
    """The triangles of a link in its frame; None where nothing is drawn."""
    parts = [_shape(shape) for shape in link.shapes] or [*_rods(robot, link)]
    return trimesh.util.concatenate(parts) if parts else None


def _shape(shape: Shape) -> Any:
    x, y, _ = shape.size_m
    if shape.mesh is not None:
        mesh: Any = trimesh.Trimesh(*shape.mesh, process=False)
    elif shape.kind == "box":
        mesh = trimesh.creation.box(extents=shape.size_m)
    elif shape.kind == "sphere":
        mesh = trimesh.creation.icosphere(subdivisions=2, radius=x)
    else:
        mesh = trimesh.creation.cylinder(radius=x, height=y, sections=16)
    return _placed(mesh, transforms.SO3.from_rpy_radians(*shape.rpy_rad), np.array(shape.xyz_m))


def _rods(robot: Robot, link: Link) -> list[Any]:
    rods = []
    for rod in robot.rods(link):
        begin, end = np.array(rod.begin_m), np.array(rod.end_m)
        length = float(np.linalg.norm(end - begin))
        mesh = trimesh.creation.cylinder(radius=min(0.022 * robot.reach_m, 0.3 * length), height=length, sections=16)
        rods.append(_placed(mesh, along(end - begin), (begin + end) / 2))
    return rods


def _placed(mesh: Any, turned: transforms.SO3, xyz: Array) -> Any:
    mesh.apply_transform(transforms.SE3.from_rotation_and_translation(turned, xyz).as_matrix())
    return mesh
