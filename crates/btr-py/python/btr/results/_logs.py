"""Results of `check` and `compare`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from btr import documents as doc
from btr import plots
from btr._tables import Rows
from btr.results._base import Reported, Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class CheckResult(Result):
    """Quality of logs, and what they determine of the free parameters."""

    logs: list[doc.CheckedLog]
    """One per log."""
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
        return "\n".join([f"{log.log}: {log.verdict}" for log in self.logs] + left_out)

    def _table(self) -> Rows:
        return [
            {"log": log.log, "severity": finding.severity, "finding": finding.sentence}
            for log in self.logs
            for finding in log.findings
        ]


class CompareResult(Reported):
    """The error of a model in multiples of the noise floor (`chi` of each of the `channels`), and where it fails
    (`failures`)."""

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

    def _headline(self) -> str:
        if not self.failures:
            return "no joint fails in any regime: what is left is noise"
        return "where it fails: " + "; ".join(failure.hint for failure in self.failures[:3])

    def _table(self) -> Rows:
        keys = ["name", "unit", "rmse", "fit_percent", "bias", "lag_s", "noise_floor", "chi", "white"]
        return [{key: channel[key] for key in keys} for channel in self.channels]

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draws the error of each channel in noise floors, on Matplotlib's `ax` or a new figure, and returns the axes.
        Raises `ImportError` without Matplotlib."""
        return plots.compare(self, ax)
