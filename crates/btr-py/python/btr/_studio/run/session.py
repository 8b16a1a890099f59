"""The state of the run's page, without the page: the run so far, and its real tests beside simulations."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Union

import numpy as np

from btr._btr import BtrError
from btr._inputs import wrong
from btr._studio.replay import Replay, Run, on_clock, replayed
from btr._studio.run import folder as files
from btr._studio.run.folder import Ending, Snapshot, Truth
from btr.documents import Belief, Dimension, TestEntry
from btr.logs import load_log
from btr.model import Model

Values = dict[str, float]
"""Parameters by name, in the units of S."""


@dataclass(frozen=True)
class Course:
    """A parameter over the iterations."""

    dim: Dimension
    """Its name, unit and bounds."""
    values: list[float]
    """The estimate at first and after each iteration."""
    intervals: list[Union[tuple[float, float], None]]
    """The 95 % interval of each; None where there is none."""
    truth: Union[float, None]
    """Its true value, once that is revealed."""


@dataclass(frozen=True)
class Tested:
    """A real test, and what simulations say of it."""

    entry: TestEntry
    """The test."""
    before: Replay
    """The simulation with the estimate before its iteration."""
    after: Union[Replay, None]
    """The simulation with the estimate of its iteration; None until there is one."""

    @property
    def run(self) -> Run:
        """Its log."""
        return self.before.run

    @property
    def channels(self) -> list[str]:
        """Measured channels, positions that the simulation before missed most first."""
        simulated = [replay.simulated for replay in (self.before, self.after) if replay is not None]
        known = [name for name in self.run.log.keys() if any(name in channels for channels in simulated)]
        readings = [name for name in known if not name.startswith("cmd_")] or list(self.run.log.keys())
        positions = [name for name in readings if name.startswith("q_")]
        worst = sorted(positions, key=self._missed, reverse=True)
        return worst + [name for name in readings if name not in worst]

    def _missed(self, channel: str) -> float:
        residual = self.before.residual(channel)
        return 0.0 if residual is None else float(np.nanmean(residual**2))


@dataclass
class _Known:
    """What was read or simulated before, for one text of the experiment."""

    runs: dict[int, Union[Run, None]] = field(default_factory=dict)
    replays: dict[tuple[int, bool], Replay] = field(default_factory=dict)


class RunSession:
    """A run in a folder. `refresh` reads what is new; methods may be called on one thread at a time."""

    def __init__(
        self,
        folder: Union[str, os.PathLike[str]],
        experiment: Union[str, os.PathLike[str], None] = None,
    ) -> None:
        """Reads the run. `experiment` is its file, beside which the files that it names are found. Raises `BtrError` if
        there is no run in the folder, or a damaged one, or if its robot's files are not found."""
        self.folder = Path(folder)
        self._path = self.folder / "experiment.toml" if experiment is None else Path(experiment)
        self._stamps = files.stamps(self.folder)
        self._take(files.snapshot(self.folder))

    @property
    def name(self) -> str:
        """Name of the experiment."""
        return self.model.name

    @property
    def age_s(self) -> Union[float, None]:
        """Time since the last step; None where the folder is gone."""
        at = files.last_step_s(self.folder)
        return None if at is None else max(0.0, time.time() - at)

    def refresh(self) -> bool:
        """Reads the folder again if it has changed; whether it has. Raises `BtrError` where it cannot be read any more:
        what was known before stays."""
        stamps = files.stamps(self.folder)
        if stamps == self._stamps:
            return False
        self._take(files.snapshot(self.folder))
        self._stamps = stamps
        return True

    @property
    def truth(self) -> Union[Truth, None]:
        """The hidden twin, once it is revealed."""
        return self._ending.truth

    @property
    def conclusions(self) -> list[str]:
        """What the run comes to, as the terminal says it; empty before its end."""
        return self._ending.conclusions

    @property
    def courses(self) -> list[Course]:
        """Every parameter of S over the iterations."""
        known: Mapping[str, float] = {} if self.truth is None else self.truth.parameters
        return [self._course(dim, known.get(dim.name)) for dim in self.model.parameters]

    def run(self, test: TestEntry) -> Union[Run, None]:
        """The log of a real test; None where none can be had."""
        number = test.trial.number
        if number not in self._known.runs:
            self._known.runs[number] = self._run(number)
        return self._known.runs[number]

    def tested(self, test: TestEntry) -> Union[Tested, None]:
        """A real test beside its simulations before and after its iteration; None without a log."""
        run, iteration = self.run(test), test.trial.iteration
        if run is None:
            return None
        before = self._replay(test, run, self._estimate(iteration - 1), is_after=False)
        after = self._estimate(iteration)
        assert before is not None
        return Tested(test, before, self._replay(test, run, after, is_after=True))

    def _take(self, run: Snapshot) -> None:
        before: Union[Snapshot, None] = getattr(self, "now", None)
        if before is None or before.text != run.text:
            self.model = self._model(run.text)
            self._known = _Known()
        elif before.iterations != run.iterations[: len(before.iterations)]:
            # Another run took the place of this one.
            self._known = _Known()
        self.now = run
        """The run as its last checkpoint has it."""
        self._ending: Ending = files.ending(self.folder, run)

    def _model(self, text: str) -> Model:
        try:
            return Model(text, self._path)
        except BtrError as error:
            why = str(error).partition("\nhelp: ")[0]
            raise wrong(why, "name the file of the run's experiment as well: the files that it names are beside it")

    def _course(self, dim: Dimension, truth: Union[float, None]) -> Course:
        place = [other.name for other in self.model.parameters].index(dim.name)
        closed = self.now.iterations
        beliefs = [None if it.posterior is None else it.posterior.parameters.get(dim.name) for it in closed]
        return Course(
            dim,
            [self.now.start[place], *(it.parameters[dim.name] for it in closed)],
            [None, *map(_interval, beliefs)],
            truth,
        )

    def _estimate(self, iteration: int) -> Union[Values, None]:
        """The simulation after an iteration, from 0, the first one; None while it is not closed."""
        names = [dim.name for dim in self.model.parameters]
        if iteration == 0:
            return dict(zip(names, self.now.start))
        closed = [it for it in self.now.iterations if it.i == iteration]
        return {name: closed[0].parameters[name] for name in names} if closed else None

    def _run(self, number: int) -> Union[Run, None]:
        path = files.log_of(self.folder, number)
        if path is None:
            return None
        try:
            return Run(f"real test {number}", load_log(path, model=self.model), False, str(path))
        except BtrError:
            return None

    def _replay(self, test: TestEntry, run: Run, values: Union[Values, None], *, is_after: bool) -> Union[Replay, None]:
        if values is None:
            return None
        key = (test.trial.number, is_after)
        if key not in self._known.replays:
            self._known.replays[key] = self._simulated(test, run, values)
        return self._known.replays[key]

    def _simulated(self, test: TestEntry, run: Run, values: Values) -> Replay:
        """The test as the loop simulates it: the controller itself, or the commands of the log without one."""
        if not self.model.controllers:
            return replayed(self.model.at(values), run)
        try:
            (log,) = self.model.simulate_all(np.array([list(values.values())]), np.array([test.trial.controller]))
        except BtrError as error:
            return Replay(run, failed=str(error))
        return Replay(run, failed="the simulation diverged") if log is None else on_clock(run, log)


def _interval(belief: Union[Belief, None]) -> Union[tuple[float, float], None]:
    return None if belief is None or belief.ci95 is None else (belief.ci95[0], belief.ci95[1])
