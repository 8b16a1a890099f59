"""The Back-to-Reality loop: searches controllers in simulation, tests a few in reality, and improves the simulation
with the measured behaviour."""

from __future__ import annotations

import json
from collections.abc import Callable
from os import PathLike
from pathlib import Path

from btr import _btr, _warnings
from btr._btr import BtrError, Log
from btr._inputs import count, must_be_called
from btr._sources import LogLike, is_columns
from btr.controller import Controller
from btr.documents import Iteration
from btr.executors import ExecutorLike, executor_of
from btr.logs import load_log
from btr.model import Model, loaded
from btr.results import CoevolveResult

Reality = Callable[[Controller], LogLike]
"""Executes a controller's references on a robot, or on a substitute, and returns the sensor readings: a `Log`, a frame,
a mapping of arrays, or a path, with btr's channel names or those of the experiment's `[channels]`.

Raises `btr.TestFailed` if the robot could not execute the test. Any other exception ends the run, which can be resumed.
The function is called on another thread; Ctrl-C waits for it, so that no real test is lost. Problems of a log are
reported as a `UserWarning`, and under `doubts` in the result.

Times of a log that are possible times of the test are used as they are (a log that begins at 0.02 s lacks the samples
before). For any other clock, the first row is the start of the test. Rows after the end of the test are dropped (the
last reference may be later). Commands in the log (`cmd_<joint>`) are compared with the references.

A simulator in place of the robot must use smaller time steps than the model; otherwise its own error is identified. To
use another btr model as the robot, pass the controller itself to `model.simulate`: the `references` alone do not
contain the initial pose of a floating robot."""


def coevolve(
    experiment: Model | str | PathLike[str],
    reality: Reality | None = None,
    *,
    out: str | PathLike[str] | None = None,
    seed: int | None = None,
    resume: bool = False,
    tell: Callable[[Iteration], object] | None = None,
    executor: ExecutorLike = None,
) -> CoevolveResult:
    """Co-evolves controllers and simulations of an experiment (Zagal, Delpiano and Ruiz-del-Solar 2009), like `btr
    coevolve`.

    `reality` replaces the experiment's `[reality]`. The folder `out` (default: `runs/<name>`) receives all files and a
    checkpoint after every step. `resume` continues a run that was interrupted by Ctrl-C, an exception, or a lost
    machine. The same experiment and seed give the same results for every `executor`. `tell` is called with every
    completed iteration (`tell=print` shows them).

    Raises `BtrError` if the experiment is invalid or the folder contains another run, and exceptions of `reality` or
    `tell`.
    """
    model = loaded(experiment)
    execute = _no_reality if reality is None else reality
    must_be_called(execute, "reality is a function of a Controller that gives back a log")
    must_be_called(_no_reality if tell is None else tell, "tell is a function that is called with every iteration")
    folder = Path("runs") / model.name if out is None else Path(out)

    def robot(
        number: int,
        iteration: int,
        scenario: int,
        names: list[str],
        values: list[float],
        references: Log,
        start: list[tuple[str, float]],
        base: list[float] | None,
        duration_s: float,
    ) -> Log:
        parameters = dict(zip(names, values))
        controller = Controller(number, iteration, scenario, parameters, references, dict(start), base, duration_s)
        log = execute(controller)
        return load_log(log, f"the log of real test {number}" if is_columns(log) else None, model=model)

    def report(iteration: str) -> None:
        if tell is not None:
            tell(Iteration(json.loads(iteration)))

    caller = _warnings.place()

    def warned(sentence: str) -> None:
        _warnings.warn(sentence, caller)

    seed = None if seed is None else count(seed, "seed")
    function, workers = None if reality is None else robot, executor_of(executor)
    try:
        document = _btr.coevolve(model._model, folder, seed, resume, function, report, warned, workers)
    except KeyboardInterrupt as interrupt:
        raise KeyboardInterrupt(f"go on with btr.coevolve(..., out={str(folder)!r}, resume=True)") from interrupt
    if document is None:
        raise BtrError(f"the run was stopped\nhelp: go on with btr.coevolve(..., out={str(folder)!r}, resume=True)")
    return CoevolveResult(json.loads(document), folder)


def _no_reality(controller: Controller) -> LogLike:
    """Placeholder for the experiment's own `[reality]`; never called."""
    raise BtrError(f"real test {controller.number} was requested, but no function executes it")
