"""Results of `check` and `compare`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from btr import _tables, plots
from btr import documents as doc
from btr._btr import Overlay, Page
from btr._inputs import wrong
from btr._tables import Rows, cell
from btr.results._base import Reported, Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class CheckResult(Result):
    """Quality of logs, and what they determine of the free parameters."""

    logs: list[doc.CheckedLog]
    """One per log."""
    in_common: list[doc.CommonFinding]
    """Findings that several joints have in common, with the lines that mend them."""
    dead_times: doc.DeadTimes
    """What all logs together say of the dead times."""
    warnings: list[str]
    """Oddities of logs that can be used all the same."""
    repeatability: doc.Repeatability
    """How far runs of the same command differ."""
    left_out: list[doc.LeftOutLog]
    """Logs that could not be used."""
    parameters: list[doc.Sensitivity]
    """What all logs together determine of each free parameter."""
    rank: int
    """Number of independent combinations of the parameters that the logs determine."""
    condition_number: float | None
    """Condition number of the Jacobian, in noise floors per standard deviation of the priors; None if a combination is
    not determined at all."""
    null_directions: list[doc.NullDirection]
    """Combinations that the logs do not determine."""
    dead: list[str]
    """Parameters without any effect."""
    not_judged: str | None
    """Why nothing is known of the parameters; None otherwise."""
    rollouts: int
    """Number of simulated logs."""

    def _headline(self) -> str:
        left_out = [f"left out: {log.reason}" for log in self.left_out]
        common = [f"{common.severity}: {common.sentence}\n{common.fix}" for common in self.in_common]
        verdicts = [f"{log.log}: {log.verdict}" for log in self.logs]
        return "\n".join(verdicts + left_out + common + self.dead_times.sentences)

    def _table(self) -> Rows:
        return [
            {"log": log.log, "severity": finding.severity, "finding": finding.sentence}
            for log in self.logs
            for finding in log.findings
        ]

    def _shown(self) -> Rows:
        # What one log after the other says again is in the headline, or in the table of all findings.
        return [row for row in self._table() if len(self.logs) == 1 or row["severity"] != "fine"]

    def __repr__(self) -> str:
        return "\n\n".join([super().__repr__(), *self._determined()])

    def _determined(self) -> list[str]:
        """What the logs determine of the free parameters, as on the command line."""
        if self.not_judged:
            return [f"the free parameters: {self.not_judged}"]
        if not self.parameters:
            return []
        table = [
            {
                "parameter": p.name,
                "value": p.value,
                "unit": p.unit,
                "sensitivity": p.sensitivity,
                "uncertainty left %": 100 * p.uncertainty_left,
            }
            for p in self.parameters
        ]
        condition = "infinite" if self.condition_number is None else cell(self.condition_number)
        rank = f"rank {self.rank} of {len(self.parameters)}, condition number {condition}"
        return [_tables.text(table), "\n".join([rank, *(direction.sentence for direction in self.null_directions)])]


class CompareResult(Reported):
    """What is off (`verdict`), the error of a model in multiples of the noise floor (`chi` of each of the `channels`),
    and where it fails (`failures`)."""

    verdict: doc.CompareVerdict
    """Which joints are off, by how much, and what their errors look like."""
    channels: list[doc.ChannelError]
    """The error of each channel."""
    failures: list[doc.RegimeFailure]
    """Joints and regimes of motion with more error than noise, the worst first."""
    integrator_error: float
    """Largest error of the time integration over all channels, in multiples of the noise floor."""
    time_step_s: float
    """Time step of the simulation, in s; finer than the model's own if that is too coarse."""
    not_judged: list[str]
    """Joints without any measurement: the result does not cover them."""
    warnings: list[str]
    """Oddities of logs that can be used all the same."""
    left_out: list[doc.LeftOutLog]
    """Logs that could not be used."""

    def __init__(self, document: dict[str, Any], page: Page, overlay: Overlay) -> None:
        super().__init__(document, page)
        self._overlay: Overlay | None = overlay

    def overlay(self, path: str | os.PathLike[str]) -> None:
        """Writes the measured robot and the model's into one MCAP file, as `btr compare -o` does, for viewers: Rerun
        opens it as it is, Foxglove with the layout `examples/overlay.foxglove-layout.json`. Raises `BtrError` if the
        name does not end in `.mcap`, if another file would be lost, if the file cannot be written, and for a result
        that comes from a pickle: pickles keep the report, not the logs."""
        if self._overlay is None:
            raise wrong("a result from a pickle has no logs to write", "compare again")
        self._overlay.write(Path(path))

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), "_overlay": None}

    def _headline(self) -> str:
        left_out = [f"left out: {log.reason}" for log in self.left_out]
        joints = [f"nothing of these joints was measured: {', '.join(self.not_judged)}"] if self.not_judged else []
        return "\n".join([*self.verdict.sentences, *joints, *left_out])

    def _table(self) -> Rows:
        keys = ["name", "unit", "rmse", "error_percent", "fit_percent", "bias", "lag_s", "noise_floor", "chi", "white"]
        places = {verdict.joint: place for place, verdict in enumerate(self.verdict.joints)}
        worst_first = sorted(self.channels, key=lambda channel: places.get(channel.name.partition("_")[2], len(places)))
        return [{key: channel[key] for key in keys} for channel in worst_first]

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draws the error of each channel in noise floors, on Matplotlib's `ax` or a new figure, and returns the
        figure. Raises `ImportError` without Matplotlib."""
        return plots.compare(self, ax)
