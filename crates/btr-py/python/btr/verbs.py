"""The verbs: what one asks of a model and its logs."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from typing import Any, Union

from btr import _btr, _warnings
from btr._inputs import count, must_be_called
from btr.executors import ExecutorLike, executor_of
from btr.logs import LogLike, Logs
from btr.model import Model, loaded
from btr.results import CheckResult, CompareResult, DiagnoseResult, EffectsResult, FitResult

Tell = Callable[[str, float, Union[float, None]], None]
"""Hears every step of the error's fall: what was done, the error on the logs to learn from, on held-out ones (None without
any), both in multiples of the noise floor. Called on another thread."""


def _warned(document: dict[str, Any]) -> dict[str, Any]:
    """Says what is bad about the logs: nothing that was found can be trusted then."""
    for doubt in document["doubts"]:
        if doubt["severity"] == "bad":
            _warnings.warn(f"{doubt['log']}: {doubt['sentence']}")
    return document


def _silent(step: str, train: float, held_out: float | None) -> None:
    """Nobody listens."""


def _heard(tell: Tell | None) -> Tell:
    listener = _silent if tell is None else tell
    must_be_called(listener, "tell is a function that hears every step")
    return listener


def effects(name: str | None = None) -> EffectsResult:
    """The physical effects that btr knows, or the one of this name: law, parameters, how it shows, where it is from, and
    which others are hard to tell from it. Raises `BtrError` for one that is not there."""
    return EffectsResult(json.loads(_btr.effects(name)))


def check(model: Model | str | os.PathLike[str], logs: LogLike | Iterable[LogLike]) -> CheckResult:
    """What logs are worth before anything is fitted to them, and what they tell about the numbers in doubt. Raises `BtrError`
    for logs that cannot be read or do not fit the model."""
    model = loaded(model)
    return CheckResult(json.loads(_btr.check(model._model, Logs(model).all(logs))))


def compare(model: Model | str | os.PathLike[str], logs: LogLike | Iterable[LogLike]) -> CompareResult:
    """How far the model is off on every channel, in multiples of the noise floor, and where. Raises `BtrError` for logs that
    cannot be read or have no channel in common with the model."""
    model = loaded(model)
    document, page = _btr.compare(model._model, Logs(model).all(logs))
    return CompareResult(json.loads(document), page)


def diagnose(
    model: Model | str | os.PathLike[str],
    logs: LogLike | Iterable[LogLike],
    *,
    held_out: LogLike | Iterable[LogLike] | None = None,
    max_effects: int = 3,
    tell: Tell | None = None,
    executor: ExecutorLike = None,
) -> DiagnoseResult:
    """Which physical effect the model lacks, on which joint, with what confidence; or that nothing is missing, or that
    nothing known explains the error. Judged on the held-out logs; without any, on the last part of each log. Errors are in
    multiples of the noise floor; `max_effects` is the most that are named, and `executor` is who does the work (see
    `btr.executors`). Raises `BtrError` for logs that tell nothing, or on which the model blows up; what `tell` raises ends
    the work."""
    model, most, workers, tell = loaded(model), count(max_effects, "max_effects"), executor_of(executor), _heard(tell)
    given = Logs(model)
    document, page, commands = _btr.diagnose(model._model, given.all(logs), given.all(held_out), most, tell, workers)
    return DiagnoseResult(_warned(json.loads(document)), page, commands)


def add(model: Model, *effects: str) -> Model:
    """The model with effects in it, free to fit, as `Model.add` makes it. Raises `BtrError` for an effect or a site that is
    not there."""
    return model.add(*effects)


def fit(
    model: Model | str | os.PathLike[str],
    logs: LogLike | Iterable[LogLike],
    *,
    held_out: LogLike | Iterable[LogLike] | None = None,
    add: str | Iterable[str] | None = None,
    tell: Tell | None = None,
    executor: ExecutorLike = None,
) -> FitResult:
    """The numbers in doubt at their best, with 95 % intervals and in their units, and the fitted model; `add` adds effects
    first, and `executor` is who does the work (see `btr.executors`). Raises `BtrError` where no number is in doubt, for logs
    that tell nothing, or on which the model blows up; what `tell` raises ends the work."""
    model, workers, tell = loaded(model), executor_of(executor), _heard(tell)
    added = [add] if isinstance(add, str) else list(add or ())
    given = Logs(model)
    document, page, space, fitted = _btr.fit(model._model, given.all(logs), given.all(held_out), added, tell, workers)
    return FitResult(_warned(json.loads(document)), page, json.loads(space), model._with_text(fitted))
