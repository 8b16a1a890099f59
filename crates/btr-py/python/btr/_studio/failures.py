"""Where a model fails, by the failures of `compare`: the worst cell of the map, and the one that its sentence names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Union

from btr._studio.replay import Run
from btr.documents import RegimeFailure
from btr.results import CompareResult

TOLD = 3
"""Most sentences of a comparison that are told."""


@dataclass(frozen=True)
class Named:
    """A cell of the map that a sentence names."""

    failure: RegimeFailure
    """The cell."""
    why: str
    """What the sentence has chosen it for."""


def covered(runs: Sequence[Run]) -> str:
    """Which logs a comparison is of."""
    held_out = sum(run.held_out for run in runs)
    learn = len(runs) - held_out
    if not held_out:
        return "the log as a whole" if learn == 1 else f"all {learn} logs as a whole"
    return f"all {len(runs)} logs as a whole: {learn} training, {held_out} held out"


def chi(failure: RegimeFailure) -> float:
    """The error in noise floors."""
    # JSON has no infinite number.
    return math.inf if failure.chi is None else failure.chi


def words(failure: RegimeFailure) -> str:
    """The regime as the sentences say it: `after reversals`."""
    return failure.hint.removeprefix(f"{failure.joint}, ").partition(":")[0]


def worst(comparison: CompareResult) -> Union[RegimeFailure, None]:
    """The cell with the largest error; None without failures."""
    return max(comparison.failures, key=chi, default=None)


def named(comparison: CompareResult) -> Union[Named, None]:
    """The cell that the first sentence names; None if it names no regime."""
    sentence = comparison.verdict.sentences[0]
    for failure in comparison.failures:
        if sentence.startswith(f"{failure.joint}: ") and f", largest {words(failure)}" in sentence:
            return Named(failure, "its share of the joint's error exceeds its share of the time most")
        if sentence.endswith(f"most of it in {failure.joint} {words(failure)}"):
            return Named(failure, "it has most of the error of all joints")
    return None
