"""Objects of the document of `compare`."""

from __future__ import annotations

from typing import Literal

from btr.documents._record import Record

Regime = Literal[
    "throughout",
    "forward",
    "backward",
    "after_reversal",
    "hold",
    "slow",
    "fast",
    "high_load",
    "saturated",
    "after_step",
    "start_up",
    "early",
    "late",
    "low",
    "middle",
    "high",
    "torque_off",
]
"""What a joint is doing."""
Clue = Literal[
    "constant",
    "sign_of_velocity",
    "velocity",
    "acceleration",
    "sine_of_position",
    "cosine_of_position",
    "load_against_motion",
    "load",
    "rate_of_command",
    "time",
]
"""The quantity that a residual correlates with."""


class ChannelError(Record):
    """The error of a simulated channel over all logs."""

    name: str
    """Name of the channel."""
    unit: str
    """SI unit."""
    samples: int
    """Number of samples present in both the log and the simulation."""
    rmse: float
    """Root mean square error, in `unit`."""
    error_percent: float | None
    """Root mean square error in percent of that of the readings; None for a channel of zeros."""
    fit_percent: float | None
    """100·(1 - |e|/|y - mean|), with each log's own mean, in percent; None for a channel that does not change."""
    bias: float
    """Mean error, in `unit`."""
    lag_s: float | None
    """Lag of the measured channel behind the simulated one, in s; None if no shift makes them correlate."""
    noise_floor: float
    """Standard deviation of the sensor's errors, in `unit`."""
    chi: float
    """Error in multiples of the noise floor."""
    repeatability: float | None
    """Standard deviation of a run from what the robot does on average, in `unit`, where runs of the same command show
    that it is more than the noise floor; None otherwise."""
    x_repeatability: float | None
    """Error in multiples of it."""
    white: bool
    """Whether the error looks like white noise."""
    independent: bool
    """Whether the error is independent of the commands."""
    integrator_error: float | None
    """Error of the time integration, in multiples of the noise floor."""


class RegimeFailure(Record):
    """A joint and a regime of motion in which the model fails."""

    joint: str
    """Name of the joint."""
    regime: Regime
    """What the joint is doing."""
    log: str
    """The log with most of the squared error, by name."""
    t0: float
    """Start of the part of that log with most of the error, in s."""
    t1: float
    """End of that part, in s."""
    rmse: float
    """Root mean square error, in rad (m)."""
    chi: float
    """The same in multiples of the noise floor."""
    share: float
    """Share of the squared error of all joints."""
    follows: Clue | None
    """The quantity that the error correlates with best; None if there is none."""
    hint: str
    """All of this in one sentence."""


class ErrorCause(Record):
    """What the error of a joint looks like."""

    kind: Literal["late", "offset", "follows"]
    """Shifting the measured motion in time removes most of it; it is about the same everywhere; or it correlates with a
    quantity."""
    share: float
    """Share of the joint's squared error that this accounts for."""
    lag_s: float | None
    """How late the measured motion is, in s, if it is late."""
    follows: Clue | None
    """The quantity that the error follows, if it follows one."""


class JointVerdict(Record):
    """How far a joint is off."""

    joint: str
    """Name of the joint."""
    channel: str
    """The channel by which it is judged."""
    unit: str
    """SI unit."""
    rmse: float
    """Root mean square error, in `unit`."""
    x_noise_floor: float
    """The same in multiples of the noise floor."""
    cause: ErrorCause | None
    """What the error looks like; None within two noise floors, or if it looks like nothing known."""
    sentence: str | None
    """All of this in one sentence; None within two noise floors."""


class CompareVerdict(Record):
    """What a comparison says first."""

    sentences: list[str]
    """What people are told, the worst first: never empty. Joints that are late alike share a sentence."""
    joints: list[JointVerdict]
    """Every compared joint, the worst first."""
