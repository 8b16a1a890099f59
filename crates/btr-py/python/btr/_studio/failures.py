"""Where a model fails, by the failures of `compare`: the worst cell of the map, and the one that its sentence names."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Union

import numpy as np

from btr._studio.replay import Replay, Run
from btr.documents import RegimeFailure
from btr.results import CompareResult

TOLD = 3
"""Most sentences of a comparison that are told."""
KINDS = ("q", "tau")
"""Kinds of channels that a joint is judged by."""


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


def place(failure: RegimeFailure, replays: Sequence[Replay]) -> tuple[int, float]:
    """Where a cell is worst: the number of the log, and the time in s since its first sample from which on most of the
    cell's error there occurs. `replays` are those of all logs."""
    # A log with gaps is compared in pieces.
    stem, from_, begins = failure.log.rpartition(" from ")
    piece = re.fullmatch(r"(\d+\.\d) s", begins) if from_ else None
    log, begin_s = (stem, float(piece.group(1))) if piece else (failure.log, 0.0)
    time_s = begin_s + failure.t0

    def squares(number: int) -> tuple[bool, float]:
        run = replays[number].run
        is_named = log in (run.name, PurePath(run.name).stem)
        within = (run.clock_s >= time_s) & (run.clock_s <= begin_s + failure.t1)
        lines = [replays[number].residual(f"{kind}_{failure.joint}") for kind in KINDS]
        errors = next((line[within] for line in lines if line is not None), np.zeros(0))
        return is_named, float(np.nansum(errors**2))

    # Logs of different folders may have the same name.
    return max(range(len(replays)), key=squares), time_s
