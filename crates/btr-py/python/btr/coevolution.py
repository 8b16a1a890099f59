"""The loop: it searches controllers in simulation, tests a few in reality, and improves the simulation with the
measured behaviour."""

from __future__ import annotations

import json
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any, Union

from btr import _btr, _warnings
from btr._btr import BtrError, Log
from btr._inputs import count, must_be_called
from btr.controller import Controller
from btr.documents import Iteration
from btr.executors import ExecutorLike, executor_of
from btr.logs import LogLike, is_columns, load_log
from btr.model import Model, loaded
from btr.results import CoevolveResult


Reality = Callable[[Controller], LogLike]
"""Executes a controller's references on a robot, or on a substitute, and returns the sensor readings: a `Log`, a
frame, a mapping of arrays, or a path, under btr's names or those of the experiment's `[channels]`; what is bad about it is a
`UserWarning`, and under `doubts` in the result. Raises `btr.TestFailed` where the robot could not do it; whatever else it raises
ends the run, which can be resumed. Called on another thread; Ctrl-C waits for it, so that no real test is lost. A log whose times
can be the test's is taken at its word (one that begins at 0.02 s lost what came before); any other clock has its first row at the
test's beginning, and what comes after the test (the last of the references may) is left out. Where it brings commands
(`cmd_<joint>`), they are compared with what was asked for. A simulator that stands for the robot must take finer steps than the
model, or its own error is what is found. Where another model is to stand for the robot, `model.simulate` takes the controller
itself: its `references` alone do not say where a floating robot begins."""


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

    `reality` replaces the experiment's `[reality]`. The folder `out` (`runs/<name>`) holds all files and a checkpoint after
    every step: `resume` continues a run that was interrupted by Ctrl-C, an exception, or a lost machine. The same
    experiment and seed give the same results for every `executor`. `tell` is called with every closed iteration
    (`tell=print` shows them).

    Raises `BtrError` if the experiment is invalid or the folder holds another run, and exceptions of `reality` or `tell`.
    """
    model = loaded(experiment)
    must_be_called(_nobody if reality is None else reality, "reality is a function of a Controller that gives back a log")
    must_be_called(_nobody if tell is None else tell, "tell is a function that hears every iteration")
    folder = Path("runs") / model.name if out is None else Path(out)
    asked = _nobody if reality is None else reality

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
        log = asked(controller)
        return load_log(log, f"the log of real test {number}" if is_columns(log) else None, model=model)

    def heard(iteration: str) -> None:
        if tell is not None:
            tell(Iteration(json.loads(iteration)))

    caller = _warnings.place()

    def warned(sentence: str) -> None:
        _warnings.warn(sentence, caller)

    seed = None if seed is None else count(seed, "seed")
    function, workers = None if reality is None else robot, executor_of(executor)
    try:
        document = _btr.coevolve(model._model, folder, seed, resume, function, heard, warned, workers)
    except KeyboardInterrupt as interrupt:
        raise KeyboardInterrupt(f"go on with btr.coevolve(..., out={str(folder)!r}, resume=True)") from interrupt
    if document is None:
        raise BtrError(f"the run was stopped\nhelp: go on with btr.coevolve(..., out={str(folder)!r}, resume=True)")
    return CoevolveResult(json.loads(document), folder)


def _nobody(controller: Controller) -> LogLike:
    """Placeholder for the experiment's own reality."""
    raise BtrError(f"nobody was to be asked for real test {controller.number}")
