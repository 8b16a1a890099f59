"""Objects that several documents share."""

from __future__ import annotations

from typing import Literal

from btr._tables import cell
from btr.documents._record import Record

Severity = Literal["fine", "doubtful", "bad"]
"""How bad a finding is: `fine` is as expected, with `doubtful` results may suffer, with `bad` they cannot be
trusted."""
Topic = Literal[
    "clock",
    "gaps",
    "missing",
    "glitches",
    "dead",
    "saturation",
    "noise",
    "unit",
    "limits",
    "actuator",
    "sign",
    "command_lag",
    "dead_time",
    "excitation",
    "start",
]
"""What a finding is about."""
Verdict = Literal["effect_missing", "value_wrong", "partly_explained", "nothing_missing", "unexplained"]
"""The verdict of a diagnosis: the named effects explain the error, corrected values of the model do, what is named
explains most of it, the residual is noise, or nothing known explains the error."""
Degree = Literal["explained", "explained_to_repeatability", "partly_explained", "unexplained"]
"""How far the error is explained: to the sensors' noise, to what runs of the same command differ by, mostly, or not."""
FitStop = Literal["converged", "effort", "stuck"]
"""Why a fit ended: no further improvement, its effort is spent, or no direction of improvement was found."""


class Finding(Record):
    """One finding about a log."""

    topic: Topic
    """What it is about."""
    severity: Severity
    """How bad it is."""
    channel: str
    """The channel or joint; empty for the clock."""
    sentence: str
    """The finding in one sentence."""


class Doubt(Finding):
    """A finding about a log that makes results doubtful."""

    log: str
    """Path of the log."""


class LeftOutLog(Record):
    """A log that was left out because its content cannot be used."""

    log: str
    """Path of the log."""
    reason: str
    """Why, with the place in the file."""


class LadderStep(Record):
    """A step of the error ladder. Errors are root mean squares in multiples of the noise floor, or of what runs of the
    same command differ by where that is known and more."""

    step: str
    """What was done."""
    train: float
    """Error on the training logs."""
    held_out: float | None
    """Error on the held-out logs; None without any."""


class NoiseFloor(Record):
    """The noise floor of a measured channel."""

    channel: str
    """Name of the channel."""
    unit: str
    """SI unit of the channel."""
    sigma: float
    """Standard deviation of the sensor's errors, in `unit`."""
    repeatability: float | None
    """Standard deviation of a run from what the robot does on average, in `unit`, where runs of the same command show
    that it is more than `sigma`; errors of the channel are in multiples of it then. None otherwise."""
    run_offset: float | None
    """Standard deviation of the offset of a whole run, in `unit`, where it is a good part of what differs: offsets are
    then left open in every log, and `repeatability` is the rest. None otherwise."""
    assumed: bool
    """Whether `sigma` is an assumption, for readings without any noise."""


class RemainingError(Record):
    """What is left in a channel, on held-out logs if there are any."""

    channel: str
    """Name of the channel."""
    unit: str
    """SI unit of the channel."""
    rmse: float
    """Root mean square error, in `unit`."""
    x_noise_floor: float
    """The same in multiples of the sensor's noise floor."""
    x_repeatability: float | None
    """The same in multiples of what runs of the same command differ by; None where that is not known, or no more than
    the sensor's noise."""


class Estimate(Record):
    """A fitted parameter."""

    name: str
    """Name of the parameter."""
    unit: str
    """SI unit."""
    value: float
    """Estimated value, in `unit`."""
    ci95: tuple[float, float] | None
    """95 % interval (low, high), in `unit`; None while the residual has structure, and for a value at a bound."""
    at_bound: bool
    """Whether the value is at a bound."""
    by_bounds: bool
    """Whether the interval follows from bounds (its own or those of others) rather than from the logs."""


def interval(parameter: Estimate) -> str:
    """The 95 % interval of a fitted number, or why there is none."""
    if parameter.at_bound:
        return "at its bound"
    ci95 = parameter.ci95
    by = " (by its bounds)" if parameter.by_bounds else ""
    return "withheld" if ci95 is None else f"{cell(ci95[0])} .. {cell(ci95[1])}{by}"


class NullDirection(Record):
    """A combination of parameters that the logs do not determine."""

    parts: list[tuple[str, float]]
    """Names and shares, the largest share being 1. A change along these shares, in typical deviations, has no effect
    that exceeds the noise."""
    sentence: str
    """The combination in one sentence."""


class Marginal(Record):
    """What logs and priors leave of a parameter: a normal distribution in its coordinate, cut off at its bounds."""

    name: str
    """Name of the parameter."""
    coordinate: Literal["linear", "log", "inverse"]
    """What the other numbers are of: the value itself, its natural logarithm, or its inverse, where 0 is off."""
    mean: float
    """Mean: the fitted value."""
    sd: float
    """Standard deviation."""
    min: float | None
    """Lower bound; None where it is infinite: the logarithm of a bound at 0."""
    max: float | None
    """Upper bound; None where it is infinite: the inverse of a bound at 0."""


class Posterior(Record):
    """What logs and priors leave of all free parameters together. Combinations that the logs do not determine are as
    wide as their priors."""

    parameters: list[Marginal]
    """Each parameter by itself."""
    correlation: list[list[float]]
    """Correlations of the parameters' coordinates, of shape (n, n)."""
    has_structure: bool
    """Whether the fit left an error that is not noise: values may stand in for what the model lacks."""


class Dimension(Record):
    """A free parameter with its bounds."""

    name: str
    """Name of the parameter, for instance `mass@upper`."""
    unit: str
    """SI unit; `1` for plain numbers."""
    min: float
    """Lower bound, in `unit`."""
    max: float
    """Upper bound, in `unit`."""
    scale: Literal["linear", "log"]
    """Scale between the bounds."""
    nominal: float | None
    """Value before any fit, in `unit`; None if there is none."""
