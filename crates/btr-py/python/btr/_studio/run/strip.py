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

LANE = 1.2
"""Distance of two lanes, in reaches of the robot."""
MOST_IN_ROW = 6
"""Number of robots side by side; others are in rows behind these."""
LABEL = 0.14
"""Height of what is written, in reaches of the robot."""


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
        self._meshes = {number: mesh for number, link in enumerate(robot.links) if (mesh := _mesh(robot, link))}
        self._parts: dict[int, Any] = {}
        self._labels: list[Any] = []
        self._walkers: list[Walker] = []
        self._visible = True

    @property
    def size_m(self) -> tuple[float, float]:
        """How far it reaches along x and y: paths of the robots, lanes and rows."""
        if not self._walkers:
            return 0.0, 0.0
        long, wide = np.ptp(self._places(), axis=0)
        return float(long + self._path_m()), float(wide)

    @property
    def front_m(self) -> float:
        """How far the foremost robot gets along x."""
        return max((float(walker.motion.xyz_m[:, 0, 0].max()) for walker in self._walkers), default=0.0)

    def _path_m(self) -> float:
        """How far the robots go along x, at most."""
        return max(float(np.ptp(walker.motion.xyz_m[:, 0, 0])) for walker in self._walkers)

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
            size: dict[str, Any] = {"font_size_mode": "scene", "font_scene_height": LABEL * self._robot.reach_m}
            shown: dict[str, Any] = {"position": place, "visible": self._visible, "anchor": "bottom-center"}
            self._labels.append(self._server.scene.add_label(name, walker.name, **size, **shown))

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
        at = np.zeros((len(self._walkers), 1, 3))
        at[:, 0, :2] = self._places()
        return wxyz, xyz + at

    def _above(self, links: Array) -> Array:
        """A place above a robot, by the positions of its links."""
        return np.array([links[0, 0], links[0, 1], links[:, 2].max() + 0.2 * self._robot.reach_m])

    def _places(self) -> Array:
        """Where the robots begin, shape (robots, 2)."""
        reach = self._robot.reach_m
        return places(len(self._walkers)) * (1.5 * reach + self._path_m(), LANE * reach)


def places(many: int) -> Array:
    """Rows and lanes of so many robots, shape (robots, 2): the last row is in front, and the first robot of each is on
    the left of who sees them come."""
    number = np.arange(many)
    rows = -(-many // MOST_IN_ROW)
    in_row = -(-many // max(1, rows))
    row, lane = number // in_row, number % in_row
    return np.stack([row - (rows - 1.0), lane - 0.5 * (in_row - 1)], axis=1)


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
