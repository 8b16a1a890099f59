"""Objects of the document of `coevolve`: real tests, the map of controllers, and generations."""

from __future__ import annotations

from typing import Literal

from btr.documents._common import Finding
from btr.documents._record import Record


class Trial(Record):
    """A requested real test."""

    number: int
    """Number of the test in its run, from 0."""
    iteration: int
    """The iteration that requested it, from 1."""
    controller: list[float]
    """The controller, in the units of C."""
    scenario: int
    """Number of the scenario, from 0."""


class Done(Record):
    """A completed real test."""

    fitness: float | None
    """Real fitness; None if it is not a number."""


class Failed(Record):
    """A failed real test."""

    why: str
    """Why it failed."""


class TestVerdict(Record):
    """The outcome of a real test: one of `done` and `failed`; the other is None."""

    done: Done | None
    """The outcome of a completed test."""
    failed: Failed | None
    """The reason of a failure."""


class TestEntry(Record):
    """An entry of the ledger of real tests."""

    trial: Trial
    """The requested test."""
    promised: float | None
    """Fitness that the simulation of that time promised; None without one."""
    promised_ci95: tuple[float, float] | None
    """95 % prediction interval (low, high) of that fitness; None without a posterior or a map."""
    verdict: TestVerdict
    """The outcome."""


class TestDoubt(Finding):
    """A finding about the log of a real test."""

    test: int
    """Number of the test."""


class Promise(Record):
    """A controller of the map with its promised fitness."""

    controller: list[float]
    """The controller, in the units of C."""
    descriptor: list[float]
    """Its place on the map, in the units of the map's axes."""
    simulated: float
    """Fitness in the simulation that the map was made in."""
    promised: float
    """Fitness promised in reality by all real tests so far."""
    promised_ci95: tuple[float, float] | None
    """95 % prediction interval (low, high) of a real test's fitness."""
    real: float | None
    """Real fitness, the mean over its scenarios; None if it was not tested or a test of it failed."""


class MapReport(Record):
    """The map of controllers of `quality_diversity`."""

    descriptors: dict[str, tuple[float, float]]
    """Bounds of each axis by name."""
    filled: int
    """Number of cells with a controller."""
    cells: int
    """Number of cells."""
    elites: list[Promise]
    """The controllers, in the order of their cells."""


class Generation(Record):
    """A generation of one of the two populations."""

    iteration: int
    """Iteration, from 1."""
    generation: int
    """Generation within the iteration's search, from 1."""
    side: Literal["controllers", "simulators"]
    """The population: scores of `controllers` are fitness (larger is better), those of `simulators` are phi (smaller is
    better)."""
    best: float | None
    """Best score; None if all individuals failed."""
    mean: float | None
    """Mean score of the individuals that did not fail; None if all failed."""
    failed: int
    """Number of failed individuals."""
    scores: list[float | None]
    """Score of each individual; None for failed ones."""
    points: list[list[float]]
    """Simulators: each individual in the units of S. Controllers: the best one in the units of C."""
