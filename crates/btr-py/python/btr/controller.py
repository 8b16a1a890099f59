"""What a robot is asked to do."""

from __future__ import annotations

from dataclasses import dataclass

from btr._btr import Log


@dataclass(frozen=True)
class Controller:
    """What a robot is asked to do in one real test."""

    number: int
    """Counts the real tests of a run, from 0."""
    iteration: int
    """The iteration that asks, from 1."""
    scenario: int
    """The situation to try it in, from 0."""
    parameters: dict[str, float]
    """The controller's parameters by name, in the units of the experiment's `[drive]`; empty where the drive is fixed."""
    references: Log
    """The commands that it stands for: `cmd_<joint>` at the times `clock_s` (in s), each held until the next."""
    start: dict[str, float]
    """Where each joint is when the test begins, at rest, in rad (m): simulations begin there, and so should the robot."""
    base: list[float] | None
    """Where a floating robot's base is then: x, y, z in m and its quaternion w, x, y, z; None for a robot on a fixed base."""
    duration_s: float
    """How long the test lasts, in s; the last reference may stand a little later."""
