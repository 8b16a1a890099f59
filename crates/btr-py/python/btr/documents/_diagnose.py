"""Objects of the document of `diagnose`."""

from __future__ import annotations

from typing import Literal

from btr.documents._common import Estimate
from btr.documents._record import Record


class ProbabilityCap(Record):
    """The largest probability that a finding can have, whatever its rivals."""

    at_most: float
    """That probability."""
    reasons: list[
        Literal[
            "unstable_size",
            "uncertain_size",
            "series",
            "same_place",
            "little_explained",
            "parameter_at_bound",
            "error_left",
            "left_over",
        ]
    ]
    """Why it is not 1: the size changes by more than half without `leave_one_out_log`, or may be none; with
    several instances of a similar effect beside it, it can follow nearly any law (`series`); another effect is found at
    the same place, and one that is not in the library may be behind both (`same_place`); it explains less than a
    hundredth of the error and less than the noise; a free parameter ended at its bound; the findings leave an error;
    or a further candidate would still explain something for certain (`left_over`)."""


class RivalProbability(Record):
    """What else may be behind what a finding explains."""

    name: str | None
    """`effect@site`; None for the model without the finding."""
    probability: float
    """Its posterior probability."""


class Support(Record):
    """What speaks for a finding, an effect or a value."""

    alike: list[str]
    """Names of effects and values, as `name@site`, that these logs cannot tell from it."""
    probability: float
    """Its posterior probability among all candidates of its round, the model without it included."""
    probability_cap: ProbabilityCap | None
    """Why it is not larger, where that is not for its rivals."""
    rivals: list[RivalProbability]
    """Who has the rest of it, from 0.01, the likeliest first; before it was capped. Empty where that is not known."""
    delta_bic: float
    """How much it lowers the information criterion."""
    share: float
    """The share of the squared error above the noise that it explains, on held-out logs if there are any; where the
    motion is prescribed, of the error of its joint's torque."""
    learnt_share: float | None
    """The same share on the training logs; None without held-out logs. Where it is large and `share` is not, the
    held-out logs hardly show the finding."""
    logs_better: list[int]
    """In how many logs the error is smaller with it, held-out ones included, and of how many."""
    leave_one_out_change: float | None
    """By what share of it its size changes at most if one of the training logs is left out; none with one log alone."""
    leave_one_out_log: str | None
    """That log."""
    established: bool
    """Whether it is established; otherwise it also helps a little, and may stand in for something else."""


class EffectReport(Support):
    """An effect that the model lacks."""

    effect: str
    """Name of the effect."""
    site: str | list[str]
    """The joint, link, `base` or `*` where the effect sits; a list of several."""
    parameters: list[Estimate]
    """Its parameters."""


class CorrectedValue(Estimate):
    """A value in the logs and in the model."""

    in_model: float
    """The model's value, in `unit`."""


class ValueReport(Support):
    """A value that the model states wrongly."""

    value: str
    """The quantity, or the effect of the model whose parameters these are."""
    site: str
    """The joint or link, or the sites of the effect."""
    parameters: list[CorrectedValue]
    """The values; their names are arguments of `add` and `fit`."""


class AddsTo(Record):
    """A finding that adds to a free parameter: the size of either depends on that parameter's bounds."""

    found: str
    """The parameter of the finding."""
    free: str
    """The free parameter."""


class StandIn(Record):
    """A free parameter that may stand in for an effect."""

    parameter: str
    """The parameter."""
    unit: str
    """Its unit."""
    in_model: float
    """Its value in the model."""
    value: float
    """Its value in the logs, without the effect."""
    effects: list[str]
    """`effect@site` of each effect that explains the logs as well while the parameter keeps the model's value."""


class RankedCandidate(Record):
    """A candidate that was fitted in a round."""

    name: str
    """`effect@site`."""
    train: float
    """Error on the training logs, in multiples of the noise floor."""
    held_out: float | None
    """Error on the held-out logs; None without any, or if the simulation diverges there."""
    delta_bic: float
    """How much it lowers the information criterion; negative if it is not worth its parameters."""


class StatedLow(Record):
    """A channel with more noise than the model states."""

    channel: str
    """Name of the channel."""
    unit: str
    """SI unit."""
    stated: float
    """Standard deviation of the sensor's errors in the model, in `unit`."""
    shown: float
    """Standard deviation that the readings show, in `unit`."""


class LawReport(Record):
    """A formula for an error that no known effect explains. `law`, `site` and `on` are arguments of `Model.add_law`."""

    law: str
    """The law as a formula."""
    site: str
    """The joint."""
    on: Literal["torque", "command", "reading"]
    """What the law acts on."""
    explains: float
    """Share of the squared error above the noise that it explains on held-out logs."""
    beside: list[str]
    """`effect@site` of the effects that it was fitted together with; empty if it replaces them all."""
    toml: str
    """The text to paste into the model file."""


class RivalExplanation(Record):
    """An explanation that the logs cannot tell from the favourite."""

    effect: str
    """`effect@site`."""
    separation: float
    """Difference from the favourite in the next experiment, in multiples of the noise floor."""


class NextExperiment(Record):
    """The experiment that separates the rival explanations."""

    kind: str
    """Kind of motion."""
    joints: list[str]
    """The joints that move; the others hold the middle of their ranges."""
    separation: float
    """Difference between the favourite and the nearest rival that this experiment separates, in multiples of the noise
    floor."""
    separation_so_far: float
    """The same difference in the present logs."""
    sentence: str
    """What to do and why."""
    rivals: list[RivalExplanation]
    """All rivals, separated by it or not."""
