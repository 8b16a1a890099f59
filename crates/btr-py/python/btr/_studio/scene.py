"""The robot in space: as it was measured, and as the model moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Union

import numpy as np
import viser
from numpy.typing import NDArray
from viser import transforms

from btr._studio.replay import BASE, Replay, Series
from btr._studio.robot import Link, Robot, Rod, Shape

Colour = tuple[int, int, int]

BODY: Colour = (196, 202, 210)
GHOST: Colour = (124, 58, 237)
GHOST_OPACITY = 0.55
# The ghost is a little thinner, so that it hides in the robot where both agree.
GHOST_SCALE = 0.9
STEPS: tuple[tuple[float, Colour], ...] = (
    (2.0, (46, 160, 90)),
    (4.0, (180, 190, 60)),
    (8.0, (240, 170, 40)),
    (16.0, (235, 110, 40)),
    (float("inf"), (205, 40, 40)),
)
"""Colours of errors up to so many noise floors."""
UNKNOWN: Colour = (140, 146, 155)


def colour_of(error: float) -> Colour:
    """The colour of an error in noise floors."""
    return next((colour for most, colour in STEPS if abs(error) <= most), UNKNOWN)


class Figure:
    """One robot: nested frames with shapes in them."""

    def __init__(
        self, server: viser.ViserServer, robot: Robot, name: str, *, ghost: bool, colour: Colour = GHOST
    ) -> None:
        """A `ghost` is transparent and has the `colour`."""
        self._robot, self._scene, self._ghost, self._colour = robot, server.scene, ghost, colour
        self._unit_m = robot.reach_m
        self.frames: dict[str, Any] = {}
        """The frame of each link, by name, each in that of its parent."""
        self._painted: dict[str, list[Any]] = {}
        self._colours: dict[str, Colour] = {}
        self.root = self._scene.add_frame(f"/{name}", show_axes=False)
        for number, link in enumerate(robot.links):
            above = f"/{name}" if link.parent is None else self.frames[link.parent].name
            self._add(link, f"{above}/{number}")

    def _add(self, link: Link, path: str) -> None:
        origin = transforms.SO3.from_rpy_radians(*link.rpy_rad)
        frame = self._scene.add_frame(path, show_axes=False, wxyz=origin.wxyz, position=link.xyz_m)
        self.frames[link.name] = frame
        parts = [self._shape(f"{path}/s{k}", shape) for k, shape in enumerate(link.shapes)]
        moves = link.kind not in ("fixed", "floating")
        if not parts:
            rods = [self._rod(f"{path}/r{k}", rod) for k, rod in enumerate(self._robot.rods(link))]
            parts = [self._marker(f"{path}/m", link)] if moves else rods
        if moves:
            self._painted[link.joint] = parts

    def _style(self, colour: Colour = BODY) -> dict[str, Any]:
        if self._ghost:
            return {"color": self._colour, "opacity": GHOST_OPACITY, "cast_shadow": False, "receive_shadow": False}
        return {"color": colour}

    def _shape(self, path: str, shape: Shape) -> Any:
        wide = GHOST_SCALE if self._ghost else 1.0
        size, style = [wide * length for length in shape.size_m], self._style()
        pose: dict[str, Any] = {"wxyz": transforms.SO3.from_rpy_radians(*shape.rpy_rad).wxyz, "position": shape.xyz_m}
        if shape.mesh is not None:
            vertices, faces = shape.mesh
            centre = vertices.mean(axis=0)
            thinner = centre + wide * (vertices - centre)
            return self._scene.add_mesh_simple(path, vertices=thinner, faces=faces, **pose, **style)
        if shape.kind == "box":
            return self._scene.add_box(path, dimensions=(size[0], size[1], size[2]), **pose, **style)
        if shape.kind == "sphere":
            return self._scene.add_icosphere(path, radius=size[0], **pose, **style)
        return self._scene.add_cylinder(path, radius=size[0], height=size[1], **pose, **style)

    def _rod(self, path: str, rod: Rod) -> Any:
        begin, end = np.array(rod.begin_m), np.array(rod.end_m)
        length = float(np.linalg.norm(end - begin))
        radius = min(0.022 * self._unit_m, 0.3 * length) * (GHOST_SCALE if self._ghost else 1.0)
        pose: dict[str, Any] = {"wxyz": along(end - begin).wxyz, "position": (begin + end) / 2}
        return self._scene.add_cylinder(path, radius=radius, height=length, **pose, **self._style())

    def _marker(self, path: str, link: Link) -> Any:
        size = 0.04 * self._unit_m * (GHOST_SCALE if self._ghost else 1.0)
        pose: dict[str, Any] = {"wxyz": along(np.array(link.axis)).wxyz}
        if link.kind == "prismatic":
            return self._scene.add_box(path, dimensions=(2 * size, 2 * size, 3 * size), **pose, **self._style(UNKNOWN))
        return self._scene.add_cylinder(path, radius=size, height=2.2 * size, **pose, **self._style(UNKNOWN))

    def pose(self, positions: Mapping[str, float], base: Union[NDArray[np.float64], None]) -> None:
        """Shows the joints at these positions, in rad or m, and a floating base at its pose (7,)."""
        if base is not None:
            self.root.position, self.root.wxyz = base[:3], base[3:]
        for link in self._robot.links:
            leader, ratio, offset = link.joint, 1.0, 0.0
            if link.mimic is not None:
                leader, ratio, offset = link.mimic.leader, link.mimic.ratio, link.mimic.offset
            if leader in positions and np.isfinite(positions[leader]):
                self._move(link, ratio * positions[leader] + offset)

    def _move(self, link: Link, position: float) -> None:
        frame, axis = self.frames[link.name], np.array(link.axis)
        origin = transforms.SO3.from_rpy_radians(*link.rpy_rad)
        if link.kind == "prismatic":
            frame.position = np.array(link.xyz_m) + origin.apply(position * axis)
        elif link.kind != "fixed":
            frame.wxyz = (origin @ transforms.SO3.exp(position * axis)).wxyz

    def paint(self, joint: str, colour: Colour) -> None:
        """Gives a joint a colour."""
        if self._colours.get(joint) != colour:
            self._colours[joint] = colour
            for part in self._painted.get(joint, []):
                part.color = colour

    def show(self, visible: bool) -> None:
        """Shows or hides all of it."""
        self.root.visible = visible


class Scene:
    """The measured robot and the model's ghost, at a time of a replay."""

    def __init__(self, server: viser.ViserServer, robot: Robot, *, floats: bool) -> None:
        """`floats` says whether the robot has a floating base, and so stands on the ground."""
        self._server = server
        self._solid = Figure(server, robot, "robot", ghost=False)
        self._ghost = Figure(server, robot, "model", ghost=True)
        reach = robot.reach_m
        wide, cell = 8 * reach, reach / 4
        self._ground = server.scene.add_grid("/ground", wide, wide, cell_size=cell, section_size=reach)
        self._section_m = reach
        far, high = (2.0, 0.6) if floats else (1.0, 0.25)
        server.initial_camera.position = (1.1 * far * reach, -1.5 * far * reach, (0.65 * far + high) * reach)
        server.initial_camera.look_at = (0.15 * reach, 0.0, high * reach)
        self.magnified = 1.0
        """By how much the ghost exaggerates its distance from the robot, in each joint."""
        self._measured: dict[str, Series] = {}
        self._simulated: dict[str, Series] = {}
        self._errors: dict[str, Series] = {}
        self._bases: tuple[Union[Series, None], Union[Series, None]] = (None, None)

    def load(self, replay: Replay, joints: list[str], floors: Mapping[str, float]) -> None:
        """Takes the positions of a replay."""
        simulated = replay.simulated
        self._simulated = {joint: simulated[f"q_{joint}"] for joint in joints if f"q_{joint}" in simulated}
        readings = {joint: replay.run.measured(f"q_{joint}") for joint in joints}
        known = {joint: held(values) for joint, values in readings.items() if values is not None}
        # What no sensor saw is shown as the model has it.
        self._measured = {**self._simulated, **known}
        self._errors = {joint: _worst(replay, joint, floors) for joint in joints}
        model_base, log_base = base_of(simulated.get), base_of(replay.run.measured)
        self._bases = (model_base if log_base is None else log_base, model_base)
        self._ghost.show(replay.failed is None)

    def at(self, sample: int) -> None:
        """Shows a sample."""
        with self._server.atomic():
            measured = {joint: float(values[sample]) for joint, values in self._measured.items()}
            simulated = {joint: float(values[sample]) for joint, values in self._simulated.items()}
            ghost = {joint: measured[joint] + self.magnified * (q - measured[joint]) for joint, q in simulated.items()}
            at = self._followed(sample)
            for figure, positions, poses in zip((self._solid, self._ghost), (measured, ghost), self._bases):
                figure.pose(positions, None if poses is None else poses[sample] - at)
            for joint, errors in self._errors.items():
                self._solid.paint(joint, colour_of(float(errors[sample])) if len(errors) else UNKNOWN)

    def _followed(self, sample: int) -> Series:
        """Where a floating robot is, as a pose (7,) without its height: the picture follows it, the ground passes."""
        at, (base, _) = np.zeros(7), self._bases
        if base is not None:
            at[:2] = base[sample, :2]
            self._ground.position = (*(-at[:2] % self._section_m - self._section_m), 0.0)
        return at

    def show(self, *, robot: bool, model: bool) -> None:
        """Shows or hides each of the two."""
        self._solid.show(robot)
        self._ghost.show(model and bool(self._simulated))


def _worst(replay: Replay, joint: str, floors: Mapping[str, float]) -> Series:
    """The largest error of a joint's channels, in noise floors; empty without any."""
    channels = [channel for kind in ("q", "dq", "tau") if floors.get(channel := f"{kind}_{joint}", 0.0) > 0]
    known = [(residual, floors[c]) for c in channels if (residual := replay.residual(c)) is not None]
    if not known:
        return np.empty(0)
    return np.asarray(np.fmax.reduce([np.abs(residual) / floor for residual, floor in known]))


def held(values: Series) -> Series:
    """The readings, the last one held where one is missing."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) == 0:
        return values
    last = np.searchsorted(known, np.arange(len(values)), side="right") - 1
    return np.asarray(values[known[np.maximum(last, 0)]])


def base_of(channel: Callable[[str], Union[Series, None]]) -> Union[Series, None]:
    """Poses of a floating base, shape (samples, 7); None if a channel is missing."""
    known = [held(values) for name in BASE if (values := channel(name)) is not None]
    return np.stack(known, axis=1) if len(known) == len(BASE) else None


def along(direction: NDArray[np.float64]) -> transforms.SO3:
    """The rotation that takes z into a direction."""
    z = direction / np.linalg.norm(direction)
    turn = np.cross([0.0, 0.0, 1.0], z)
    sine, cosine = float(np.linalg.norm(turn)), float(z[2])
    if sine < 1e-9:
        return transforms.SO3.identity() if cosine > 0 else transforms.SO3.from_x_radians(np.pi)
    return transforms.SO3.exp(turn / sine * np.arctan2(sine, cosine))
