"""Objects of the document of `check`."""

from __future__ import annotations

from typing import Literal

from btr.documents._common import Finding, Severity, Topic
from btr.documents._compare import Regime
from btr.documents._record import Record

GlitchKind = Literal["wrap_around", "zero", "stuck", "spike"]
"""What a glitch looks like: off by full turns, exactly zero, the reading before repeated, or any other value."""


class ClockReport(Record):
    """The clock of a log."""

    samples: int
    """Number of samples."""
    duration_s: float
    """Time from the first sample to the last, in s."""
    rate_hz: float
    """Usual sample rate, in 1/s; 0 with fewer than two samples."""
    jitter_s: float
    """Standard deviation of the usual sample steps, in s."""
    gaps: list[tuple[float, float]]
    """Steps longer than three usual ones: start and length, in s."""
    duplicates: int
    """Number of steps shorter than a tenth of the usual one, most likely repeated samples."""


class SensorReport(Record):
    """Statistics of a channel of a log."""

    name: str
    """Name of the channel."""
    unit: str
    """SI unit."""
    missing: float
    """Share of the samples that are missing."""
    min: float | None
    """Smallest value, in `unit`; None without any value."""
    max: float | None
    """Largest value, in `unit`; None without any value."""
    noise: float | None
    """Standard deviation of the readings' errors including quantisation, in `unit`; None for commands and for too few
    readings."""
    quantum: float | None
    """Quantisation step, in `unit`; None if there is none."""
    at_ends: float
    """Share of the samples at the smallest or the largest value."""


class CommandLag(Record):
    """The lag of a joint behind its command."""

    lag_s: float
    """Lag, in s; positive if the joint is later than its command."""
    sd_s: float
    """Standard deviation of the lag, in s, if the part that does not correlate is noise."""
    likeness: float
    """Correlation of position and shifted command, 0 to 1. Below one half the lag means little."""


class CommandResponse(Record):
    """How a joint follows its command."""

    joint: str
    """Name of the joint."""
    command_lag: CommandLag | None
    """The lag; None if the joint does not follow its command."""
    dead_time_s: float | None
    """The part of the lag in which the joint does not move at all after a step of its command, in s: communication and
    buffers. Slightly negative ones are noise. None without three steps from rest, if these disagree, or if the joint is
    not commanded in positions."""
    dead_time_ci95_s: tuple[float, float] | None
    """Its 95 % interval, in s, with half a sample to both sides."""
    dead_time_onsets: int
    """Number of steps from rest whose onset was measured."""


class Glitch(Record):
    """Readings of a joint's position that no motion explains."""

    channel: str
    """Name of the channel."""
    kind: GlitchKind
    """What it looks like."""
    sample: int
    """Its first sample, counted from 0."""
    samples: int
    """Number of samples."""
    time_s: float
    """Time of its first sample, in s after the first sample of the log."""
    value: float
    """The reading that departs most, in the channel's unit."""
    expected: float
    """What the readings around it predict there, in the channel's unit."""
    lost_message: bool
    """Whether all positions repeat their samples before: a message was lost."""
    left_out: bool
    """Whether its samples were left out."""


class FittedGlitch(Glitch):
    """Readings of a log that no motion explains, as a fitted model shows."""

    log: str
    """Path of the log."""


class CheckedLog(Record):
    """Quality of a log."""

    log: str
    """Path of the log."""
    verdict: Severity
    """Severity of the worst finding."""
    clock: ClockReport
    """The clock."""
    channels: list[SensorReport]
    """The channels: commands and sensors."""
    glitches: list[Glitch]
    """Readings of joint positions and torques that no motion explains."""
    joints: list[CommandResponse]
    """The response of each joint to its command."""
    findings: list[Finding]
    """All findings."""


class RepeatedRegime(Record):
    """The repeatability of a joint in a regime."""

    regime: Regime
    """What the joint does."""
    repeatability: float
    """Standard deviation of a run from what the robot does on average, in the channel's unit."""


class RepeatedChannel(Record):
    """The repeatability of a channel."""

    channel: str
    """Name of the channel."""
    unit: str
    """SI unit of the channel."""
    repeatability: float
    """Standard deviation of a run from what the robot does on average, in `unit`, the sensor's noise included."""
    offset: float
    """The part of it that is an offset of the whole run: its standard deviation, in `unit`."""
    noise_floor: float
    """The noise floor of its sensor, in `unit`."""
    independent: float
    """Number of independent differences between runs that it rests on."""
    half_below_hz: float | None
    """The frequency below which half of its variance lies, in Hz; None for logs too short to tell."""
    regimes: list[RepeatedRegime]
    """The same by regime, largest first."""


class RunOutlier(Record):
    """A run that differs far more than the others of its command."""

    log: str
    """Name of the log."""
    channel: str
    """The channel in which it does."""


class RunDrift(Record):
    """A command whose runs change in one direction, as while a robot warms up."""

    logs: list[str]
    """Names of the logs, in their order."""
    share: float
    """Share of what differs that follows the order of the runs."""


class Repeatability(Record):
    """How far runs of the same command differ."""

    runs: list[list[str]]
    """For each command that was given more than once, the names of the logs of its runs."""
    channels: list[RepeatedChannel]
    """The repeatability of each compared channel."""
    outliers: list[RunOutlier]
    """Runs that differ far more than the others."""
    drifts: list[RunDrift]
    """Commands whose runs change in one direction."""
    advice: str | None
    """What to record, if the repeatability is not known well."""


class Sensitivity(Record):
    """What the logs determine of a free parameter."""

    name: str
    """Name of the parameter."""
    unit: str
    """SI unit."""
    value: float
    """Its current value in the model, in `unit`."""
    sensitivity: float
    """Root mean square change of the measured channels for one standard deviation of the prior, in noise floors."""
    uncertainty_left: float
    """Share of the prior's standard deviation that the logs leave, with all other parameters free: 1 is nothing learnt.
    Holds for white noise and a model without missing effects."""
    dead: bool
    """Whether the parameter has no effect that exceeds the noise."""


class CommonFinding(Record):
    """A finding that several joints have in common, for one cause."""

    topic: Topic
    """What it is about."""
    severity: Severity
    """How bad it is."""
    joints: list[str]
    """The joints."""
    sentence: str
    """All of this in one sentence."""
    fix: str
    """What to add to the model file."""


class DeadTimes(Record):
    """What all logs together say of the dead times between commands and motion."""

    not_known: list[str]
    """Joints whose dead time no log tells."""
    not_in_model: dict[str, float]
    """Joints with a dead time that the model lacks, and its median over the logs, in s."""
    sentences: list[str]
    """What people are told of that."""
