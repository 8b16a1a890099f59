"""What the folder of a run says: its last checkpoint, the truth once it is revealed, and the logs of real tests."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union

from btr import _btr
from btr.documents import Iteration, TestEntry

Stamp = tuple[int, int, int]


@dataclass(frozen=True)
class Scores:
    """A generation's scores; None if all individuals failed."""

    iteration: int
    """Its iteration, from 1."""
    best: Union[float, None]
    """The best score."""
    mean: Union[float, None]
    """The mean score."""


@dataclass(frozen=True)
class Truth:
    """The hidden twin, revealed."""

    parameters: dict[str, float]
    """True values by name, in the units of S."""
    effects: tuple[str, ...]
    """Effects that the model did not have."""


@dataclass(frozen=True)
class Ending:
    """What a run writes at its end."""

    truth: Union[Truth, None]
    """The hidden twin; None for any other reality."""
    conclusions: list[str]
    """What the run comes to, as the terminal says it."""


NO_ENDING = Ending(None, [])


@dataclass(frozen=True)
class Distance:
    """The distance that phi is the mean of."""

    name: str
    """Its name in experiments."""
    compares: str
    """What it compares."""


@dataclass(frozen=True)
class Snapshot:
    """A run as its last checkpoint has it."""

    text: str
    """The text of its experiment, in its present S."""
    planned: Union[int, None]
    """The iterations that its plan has."""
    distance: Union[Distance, None]
    """The distance of its plan."""
    iteration: int
    """The iteration being worked on, from 1."""
    activity: str
    """What it does next."""
    stop_reason: Union[str, None]
    """Why it stopped; None while it has not."""
    cause: Union[str, None]
    """What its last diagnosis says."""
    start: list[float]
    """The simulation it began with, in the order of S."""
    controllers: list[Scores]
    """Generations of controllers, scored by fitness."""
    simulators: list[Scores]
    """Generations of simulations, scored by phi."""
    iterations: list[Iteration]
    """Every closed iteration."""
    tests: list[TestEntry]
    """The ledger of real tests."""
    simulated: int
    """Simulated behaviours so far."""

    @property
    def done(self) -> list[TestEntry]:
        """The real tests that gave a behaviour."""
        return [test for test in self.tests if test.verdict.done is not None]

    @property
    def failed(self) -> int:
        """Number of real tests that failed."""
        return len(self.tests) - len(self.done)


def snapshot(folder: Path) -> Snapshot:
    """The run in a folder. Raises `BtrError` if there is none, or a damaged one."""
    document: dict[str, Any] = json.loads(_btr.snapshot(folder))
    generations = document["generations"]
    controllers, simulators = (
        [Scores(g["iteration"], g["best"], g["mean"]) for g in generations if g["side"] == side]
        for side in ("controllers", "simulators")
    )
    return Snapshot(
        text=document["text"],
        planned=document["planned"],
        distance=None if document["distance"] is None else Distance(*document["distance"]),
        iteration=document["iteration"],
        activity=document["activity"],
        stop_reason=document["stop_reason"],
        cause=document["cause"],
        start=document["start"],
        controllers=controllers,
        simulators=simulators,
        iterations=[Iteration(iteration) for iteration in document["iterations"]],
        tests=[TestEntry(test) for test in document["tests"]],
        simulated=document["simulated_evaluations"],
    )


def ending(folder: Path, run: Snapshot) -> Ending:
    """What the run has written at its end; nothing before that. Conclusions of an earlier end are left out once the run
    goes on."""
    try:
        history = json.loads((folder / "history.json").read_bytes())
        revealed = history["revealed"]
        truth = None if revealed is None else Truth(dict(revealed["parameters"]), tuple(revealed["effects"]))
        is_of_now = (history["stop_reason"], history["real_tests"]) == (run.stop_reason, len(run.tests))
        return Ending(truth, list(map(str, history["conclusions"])) if is_of_now else [])
    except (OSError, ValueError, KeyError, TypeError):
        # A damaged document is no reason to show less of the run.
        return NO_ENDING


def test_name(number: int) -> str:
    """What a real test is called: its number, from 0, as its folder has it."""
    return f"test {number:04}"


def fitness_of(test: TestEntry) -> Union[float, None]:
    """The real fitness of a test; None where it has none."""
    return None if test.verdict.done is None else test.verdict.done.fitness


def best_of(tests: list[TestEntry]) -> Union[TestEntry, None]:
    """The test with the best real fitness; None where there is no fitness."""
    known = [(fitness, test) for test in tests if (fitness := fitness_of(test)) is not None]
    return max(known, key=lambda pair: pair[0], default=(None, None))[1]


def log_of(folder: Path, test: int) -> Union[Path, None]:
    """The log of a real test; None where the folder keeps none."""
    place = folder / "transfers" / f"{test:04}"
    return next((path for ending in ("mcap", "csv") if (path := place / f"log.{ending}").is_file()), None)


def stamps(folder: Path) -> tuple[Union[Stamp, None], ...]:
    """What changes when the run writes: the identity, time and size of its two files."""
    return tuple(_stamp(folder / name) for name in ("checkpoint.bin", "history.json"))


def last_step_s(folder: Path) -> Union[float, None]:
    """When the last checkpoint was written, in s since 1970; None where it is gone."""
    stamp = _stamp(folder / "checkpoint.bin")
    return None if stamp is None else stamp[1] / 1e9


def _stamp(path: Path) -> Union[Stamp, None]:
    try:
        known = path.stat()
    except OSError:
        return None
    return known.st_ino, known.st_mtime_ns, known.st_size
