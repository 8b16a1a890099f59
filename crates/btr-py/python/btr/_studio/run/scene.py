"""The run in space: all tried controllers side by side, or one real test with its simulations as ghosts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Union

import numpy as np
import viser

from btr._studio.replay import Replay, Series
from btr._studio.robot import Robot
from btr._studio.run.session import Tested
from btr._studio.run.strip import Strip, Walker
from btr._studio.scene import GHOST, Colour, Figure, base_of, held

BEFORE: Colour = (240, 150, 40)
AFTER: Colour = GHOST

NARROW = 0.9
"""Width per height of a picture from which on the camera stays where it is."""
Place = tuple[float, float, float]
Poses = tuple[Mapping[str, Series], Union[Series, None]]
"""Positions of the joints and poses of a floating base, over the samples of a log."""
NOTHING: Poses = ({}, None)


class RunScene:
    """What is drawn of a run."""

    def __init__(self, server: viser.ViserServer, robot: Robot, joints: list[str], *, floats: bool) -> None:
        """`floats` says whether the robot has a floating base, and so stands on the ground."""
        self._server, self._joints, self._reach_m, self._floats = server, joints, robot.reach_m, floats
        self._figures = (
            Figure(server, robot, "robot", ghost=False),
            Figure(server, robot, "before", ghost=True, colour=BEFORE),
            Figure(server, robot, "after", ghost=True, colour=AFTER),
        )
        self.strip = Strip(server, robot)
        wide = 16 * self._reach_m
        self._ground = server.scene.add_grid(
            "/ground", wide, wide, cell_size=self._reach_m / 4, section_size=self._reach_m
        )
        self._poses: tuple[Poses, ...] = (NOTHING,) * 3
        self._clock: Series = np.zeros(1)
        self._test: Union[Tested, None] = None

    def show_strip(self, walkers: Sequence[Walker]) -> None:
        """Shows the tried controllers side by side."""
        for figure in self._figures:
            figure.show(False)
        self._test = None
        self._ground.position = (0.0, 0.0, 0.0)
        self.strip.load(walkers)
        self.strip.show(True)

    def show_test(self, test: Tested) -> None:
        """Shows a real test with its simulations."""
        self.strip.show(False)
        self._test, self._clock = test, test.run.clock_s
        self._poses = (self._measured(test.before), self._simulated(test.before), self._simulated(test.after))
        for figure, poses in zip(self._figures, self._poses):
            figure.show(bool(poses[0]))

    def at(self, time_s: float) -> None:
        """Shows a time."""
        if self._test is None:
            self.strip.at(time_s)
            return
        sample = int(np.clip(np.searchsorted(self._clock, time_s), 0, len(self._clock) - 1))
        with self._server.atomic():
            at = self._followed(sample)
            for figure, (positions, base) in zip(self._figures, self._poses):
                joints = {joint: float(values[sample]) for joint, values in positions.items()}
                figure.pose(joints, None if base is None else base[sample] - at)

    def look(self) -> None:
        """Lets every browser look at what is shown."""
        self._server.initial_camera.position, self._server.initial_camera.look_at = self._view()
        for client in self._server.get_clients().values():
            self.look_of(client, client.camera.aspect)

    def look_of(self, client: viser.ClientHandle, aspect: float) -> None:
        """Lets a browser look at what is shown, from further away where its picture is narrow."""
        position, towards = self._view()
        away = max(1.0, NARROW / max(0.2, aspect))
        client.camera.position = np.array(towards) + away * (np.array(position) - np.array(towards))
        client.camera.look_at = towards

    def _view(self) -> tuple[Place, Place]:
        """Where the camera is and what it looks at."""
        reach, high = self._reach_m, 0.6 if self._floats else 0.25
        if self._test is not None:
            far = reach * (2.0 if self._floats else 1.0)
            return (1.1 * far, -1.5 * far, 0.65 * far + high * reach), (0.15 * reach, 0.0, high * reach)
        long, wide = self.strip.size_m
        far, ahead = 0.8 * max(wide, long) + 1.6 * reach, self.strip.front_m - 0.5 * long
        return (ahead + 0.5 * long + 0.8 * far, 0.3 * far, 0.7 * far), (ahead, 0.0, 0.3 * reach)

    def _measured(self, replay: Replay) -> Poses:
        """As the log has it; what no sensor saw is as the simulation has it."""
        simulated, base = self._simulated(replay)
        readings = {joint: replay.run.measured(f"q_{joint}") for joint in self._joints}
        known = {joint: held(values) for joint, values in readings.items() if values is not None}
        measured = base_of(replay.run.measured)
        return {**simulated, **known}, base if measured is None else measured

    def _simulated(self, replay: Union[Replay, None]) -> Poses:
        if replay is None:
            return NOTHING
        known = replay.simulated
        return {joint: known[f"q_{joint}"] for joint in self._joints if f"q_{joint}" in known}, base_of(known.get)

    def _followed(self, sample: int) -> Series:
        """Where the robot is, without its height: the picture follows it, the ground passes."""
        at, base = np.zeros(7), self._poses[0][1]
        if base is not None:
            at[:2] = base[sample, :2]
            self._ground.position = (*(-at[:2] % self._reach_m - self._reach_m), 0.0)
        return at
