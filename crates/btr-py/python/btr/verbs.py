"""The verbs: check, compare, diagnose, add, fit."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from typing import Any, Union

from btr import _btr, _warnings
from btr._inputs import count, must_be_called, positive
from btr._sources import LogLike, Logs
from btr.executors import ExecutorLike, executor_of
from btr.model import Model, loaded
from btr.results import CheckResult, CompareResult, DiagnoseResult, EffectsResult, FitResult

Tell = Callable[[str, float, Union[float, None]], None]
"""Called with every step of the error ladder: its name, the error on the training logs, and the error on the held-out
logs (None without any), in multiples of the noise floor. Called on another thread."""


def _warned(document: dict[str, Any]) -> dict[str, Any]:
    """Warns about logs that were left out, and about bad logs: results from them cannot be trusted."""
    for log in document.get("left_out", []):
        _warnings.warn(f"left out: {log['reason']}")
    for doubt in document.get("doubts", []):
        if doubt["severity"] == "bad":
            _warnings.warn(f"{doubt['log']}: {doubt['sentence']}")
    return document


def _silent(step: str, train: float, held_out: float | None) -> None:
    """Ignores the step."""


def _heard(tell: Tell | None) -> Tell:
    listener = _silent if tell is None else tell
    must_be_called(listener, "tell is a function that is called with every step")
    return listener


def _texts(given: str | Iterable[str] | None) -> list[str]:
    return [given] if isinstance(given, str) else list(given or ())


def effects(name: str | None = None) -> EffectsResult:
    """The library of physical effects, or the one of this name: law, parameters, symptoms, source, and similar effects.
    Raises `BtrError` for an unknown name."""
    return EffectsResult(json.loads(_btr.effects(name)))


def check(
    model: Model | str | os.PathLike[str], logs: LogLike | Iterable[LogLike], *, strict: bool = False
) -> CheckResult:
    """Quality of logs before any fit, and which free parameters they determine. Readings that no motion explains are
    listed and, as in the other verbs, left out, unless the model has `channels.keep_glitches`. So are logs whose
    content cannot be used (`left_out`), with a warning, if another one remains. Raises `BtrError` if none does, for
    any such log if `strict`, and for paths that do not exist."""
    model = loaded(model)
    return CheckResult(_warned(json.loads(_btr.check(model._model, Logs(model._model).all(logs), strict))))


def compare(
    model: Model | str | os.PathLike[str], logs: LogLike | Iterable[LogLike], *, strict: bool = False
) -> CompareResult:
    """The model's error on every channel, in multiples of the noise floor, and where it fails. Raises `BtrError` for
    logs that cannot be read or have no channel in common with the model; among others they are left out, unless
    `strict` (see `check`)."""
    model = loaded(model)
    document, page, overlay = _btr.compare(model._model, Logs(model._model).all(logs), strict)
    return CompareResult(_warned(json.loads(document)), page, overlay)


def diagnose(
    model: Model | str | os.PathLike[str],
    logs: LogLike | Iterable[LogLike],
    *,
    held_out: LogLike | Iterable[LogLike] | None = None,
    max_effects: int | None = None,
    max_rollouts: int | None = None,
    max_time_s: float | None = None,
    freeze: str | Iterable[str] | None = None,
    strict: bool = False,
    tell: Tell | None = None,
    executor: ExecutorLike = None,
) -> DiagnoseResult:
    """Which physical effect the model lacks, on which joint and with what probability; or that nothing is missing, or
    that no known effect explains the error. The held-out logs decide; without any, the last part of each log is held
    out. Errors are in multiples of the noise floor. `max_effects` limits the number of effects (usually 3, or 3 per
    joint where the motion of all joints is prescribed). After about `max_rollouts` simulated logs (usually 850 per
    joint, of at least four, and effect; without limit for floating robots) or `max_time_s`, in s, the search stops with
    the best so far; `executor` selects where simulations run (see `btr.executors`). `freeze` keeps free parameters at
    the model's values, as in `fit`. The result's `model` has the effects that were found, at their fitted values.
    Raises `BtrError` for logs without information, or on which the model diverges. Logs that cannot be used are left
    out among others, unless `strict` (see `check`). An exception of `tell` ends the diagnosis."""
    model, workers, tell = loaded(model), executor_of(executor), _heard(tell)
    most = None if max_effects is None else count(max_effects, "max_effects")
    given = Logs(model._model)
    time_s = None if max_time_s is None else positive(max_time_s, "max_time_s")
    rollouts = None if max_rollouts is None else count(max_rollouts, "max_rollouts")
    learn, held = given.all(logs), given.all(held_out)
    frozen = _texts(freeze)
    document, page, commands, text = _btr.diagnose(
        model._model, learn, held, most, rollouts, time_s, frozen, strict, tell, workers
    )
    return DiagnoseResult(_warned(json.loads(document)), page, commands, model._with_text(text))


def add(model: Model, *effects: str) -> Model:
    """The model with added effects, their parameters free, as `Model.add` gives it. Raises `BtrError` for an unknown
    effect or site."""
    return model.add(*effects)


def fit(
    model: Model | str | os.PathLike[str],
    logs: LogLike | Iterable[LogLike],
    *,
    held_out: LogLike | Iterable[LogLike] | None = None,
    add: str | Iterable[str] | None = None,
    start: Model | str | os.PathLike[str] | None = None,
    freeze: str | Iterable[str] | None = None,
    base_parameters: bool = False,
    strict: bool = False,
    tell: Tell | None = None,
    executor: ExecutorLike = None,
) -> FitResult:
    """Fits the free parameters: values with 95 % intervals, in their units, and the fitted model. `add` adds effects
    first. `start` is a model of the same robot, such as the `model` of a diagnosis or of a fit: the fit begins at the
    values that it states, and effects that only it has are added; bounds and priors stay those of `model`. `freeze`
    keeps the free parameters of these names at the model's values; `*` in a name matches any characters (`"mass@*"`).
    `base_parameters` also estimates, for an arm whose motion is prescribed, the combinations of masses, moments,
    inertias, friction and rotors that the logs tell; the fitted model then has possible values of all of them.
    `executor` selects where simulations run (see `btr.executors`). Raises `BtrError` for a model without free
    parameters (unless `base_parameters`), for a `start` of another robot, or with an effect under `[[effects]]` that
    the model lacks, for logs without information, or on which the model diverges. Logs that cannot be used are left
    out among others, unless `strict` (see `check`). An exception of `tell` ends the fit."""
    model, workers, tell = loaded(model), executor_of(executor), _heard(tell)
    added, frozen = _texts(add), _texts(freeze)
    begun = None if start is None else loaded(start)._model
    given = Logs(model._model)
    learn, held = given.all(logs), given.all(held_out)
    document, page, space, fitted = _btr.fit(
        model._model, learn, held, added, begun, frozen, base_parameters, strict, tell, workers
    )
    return FitResult(_warned(json.loads(document)), page, json.loads(space), model._with_text(fitted))
