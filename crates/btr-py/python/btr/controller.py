"""The request of a real test."""

from __future__ import annotations

from dataclasses import dataclass

from btr._btr import Log


@dataclass(frozen=True)
class Controller:
    """A controller that a robot is to execute in one real test."""

    number: int
    """Number of the real test in its run, from 0."""
    iteration: int
    """The iteration that requests the test, from 1."""
    scenario: int
    """Number of the scenario, from 0."""
    parameters: dict[str, float]
    """The controller's parameters by name, in the units of the experiment's `[drive]`; empty for a fixed drive."""
    references: Log
    """Its commands: `cmd_<joint>` at the times `clock_s` (in s), each held until the next."""
    start: dict[str, float]
    """Initial position of each joint, at rest, in rad (m): simulations start there, and so should the robot."""
    base: list[float] | None
    """Initial pose of a floating base: x, y, z in m and the quaternion w, x, y, z; None for a fixed base."""
    duration_s: float
    """Duration of the test, in s; the last reference may be slightly later."""
