"""A log beside what a model does with its commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Union

import numpy as np
from numpy.typing import NDArray

from btr._btr import BtrError, Log
from btr.model import Model

Series = NDArray[np.float64]

TAIL = 0.3
"""Share at the end of each log that `diagnose` and `fit` hold out if no log is."""
WHOLE = slice(None)

Errors = tuple[Union[float, None], Union[float, None]]
"""Errors on the training and on the held-out logs, in noise floors; None where there is none."""

BASE = ("base_x", "base_y", "base_z", "base_qw", "base_qx", "base_qy", "base_qz")


@dataclass(frozen=True)
class Run:
    """A log of the session."""

    name: str
    """Name, unique in the session."""
    log: Log
    """Its readings."""
    held_out: bool
    """Whether it is kept from fits."""
    path: Union[str, None]
    """The file, as the user named it; None for a log in memory."""

    @property
    def clock_s(self) -> Series:
        """Times since its first sample, in s."""
        since: Series = self.log.clock_s - self.log.clock_s[0]
        return since

    def measured(self, channel: str) -> Union[Series, None]:
        """Readings of a channel in its unit; None if the log lacks it."""
        return self.log[channel] if channel in self.log else None


@dataclass(frozen=True)
class Replay:
    """The simulation of a run's commands, at the run's times. A simulation that diverged has no channels."""

    run: Run
    """The log."""
    simulated: dict[str, Series] = field(default_factory=dict)
    """Channels of the simulation in their units, each as long as the run's clock."""
    failed: Union[str, None] = None
    """Why there is no simulation; None if there is one."""

    def residual(self, channel: str) -> Union[Series, None]:
        """Measured less simulated, in the channel's unit; NaN where a reading is missing. None without both."""
        measured, simulated = self.run.measured(channel), self.simulated.get(channel)
        return None if measured is None or simulated is None else measured - simulated

    def squares(self, floors: dict[str, float], part: slice = WHOLE) -> tuple[float, int]:
        """Sum of squared residuals of some samples in multiples of the noise floors, and number of residuals. A
        simulation that diverged has an infinite sum."""
        if self.failed is not None:
            return np.inf, 1
        known = [
            residual[part][np.isfinite(residual[part])] / floor
            for channel, floor in floors.items()
            if floor > 0 and (residual := self.residual(channel)) is not None
        ]
        return float(sum(np.sum(part**2) for part in known)), sum(len(part) for part in known)


def replayed(model: Model, run: Run) -> Replay:
    """The model's simulation of a run's commands, from the run's first positions on."""
    try:
        simulated = model.simulate(run.log)
    except BtrError as error:
        return Replay(run, failed=str(error))
    return on_clock(run, simulated)


def begun(model: Model, run: Run, until_s: float) -> Replay:
    """The beginning of the model's simulation of a run's commands; NaN after `until_s`."""
    samples = max(2, int(np.searchsorted(run.clock_s, until_s)))
    log = Log(run.log.clock_s[:samples], {name: run.log[name][:samples] for name in run.log.keys()})
    part = replayed(model, Run(run.name, log, run.held_out, None))
    rest = np.full(len(run.clock_s) - samples, np.nan)
    return Replay(run, {name: np.concatenate([values, rest]) for name, values in part.simulated.items()}, part.failed)


def on_clock(run: Run, simulated: Log) -> Replay:
    """A simulation at the times of a run."""
    clock = simulated.clock_s
    return Replay(run, {channel: np.interp(run.clock_s, clock, values) for channel, values in simulated.items()})


def learn_and_held_out(replays: Sequence[Replay], floors: dict[str, float]) -> Errors:
    """Errors of replays of all runs in noise floors: over the training and over the held-out logs. Where no log is held
    out, they are over the first 70 % and the last 30 % of each log."""
    held = [replay for replay in replays if replay.run.held_out]
    if not held:
        return error(replays, floors, tail=False), error(replays, floors, tail=True)
    return error([replay for replay in replays if not replay.run.held_out], floors), error(held, floors)


def error(replays: Sequence[Replay], floors: dict[str, float], *, tail: Union[bool, None] = None) -> Union[float, None]:
    """Root mean square error of replays in noise floors; None without readings. With `tail`, that of the last 30 % of
    each log, or of all before."""
    sums = [replay.squares(floors, _part(replay, tail)) for replay in replays]
    count = sum(many for _, many in sums)
    return float(np.sqrt(sum(total for total, _ in sums) / count)) if count else None


def _part(replay: Replay, tail: Union[bool, None]) -> slice:
    if tail is None:
        return WHOLE
    cut = int(len(replay.run.clock_s) * (1.0 - TAIL))
    return slice(cut, None) if tail else slice(cut)
