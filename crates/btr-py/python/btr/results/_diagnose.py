"""Result of `diagnose`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from btr import documents as doc
from btr import plots
from btr._btr import Log, Page
from btr._tables import Rows, cell, probability
from btr.documents._common import interval
from btr.results._base import Reported
from btr.results._effects import names_of, removable
from btr.results._ladder import fell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from btr.model import Model

_LITTLE = 0.01
"""Share of the squared error below which it is told by how much the error fell."""


class DiagnoseResult(Reported):
    """Which effect is missing: `verdict`, `effects`, `error_ladder` and the other keys of `btr diagnose --json`."""

    verdict: doc.Verdict
    """The verdict."""
    degree: doc.Degree
    """How far the error is explained."""
    remaining: list[doc.RemainingError]
    """What is left in each channel, on held-out logs if there are any."""
    effects: list[doc.EffectReport]
    """The missing effects; with the verdict `unexplained`, effects that help without explaining the error."""
    wrong_values: list[doc.ValueReport]
    """The values that the model states wrongly, in the same sense."""
    error_ladder: list[doc.LadderStep]
    """The error after each step, in multiples of the noise floor."""
    ranking: list[list[doc.RankedCandidate]]
    """All fitted candidates, round by round, the best first."""
    noise_floor: list[doc.NoiseFloor]
    """The noise floor of each channel."""
    unexplained_share: float
    """Share of the remaining squared error that is not noise."""
    left_over: doc.RankedCandidate | None
    """If the verdict explains the error: a candidate that would still explain more for certain, but too little to be
    named; what is named may then stand in for something else. None if there is none."""
    stand_ins: list[doc.StandIn]
    """If the verdict explains the error: free parameters that ended far from the model's values, while an effect would
    explain the logs as well with these values."""
    noise_stated_low: list[doc.StatedLow]
    """If nothing explains the error, no law is found and it is white: channels whose readings show more noise than the
    model states."""
    residual_law: doc.LawReport | None
    """A formula for an error that no effect explains: `law`, `site` and `on` are arguments of `Model.add_law`, for a
    model that has the effects in `beside`. None if there is none."""
    next_experiment: doc.NextExperiment | None
    """The experiment that separates the effects found from their `rivals`, and by how many noise floors. None if there
    are no rivals or no motion that separates them."""
    integrator_error: float
    """Error of the time integration, in multiples of the noise floor."""
    time_step_s: float
    """Time step of the diagnosis, in s; finer than the model's own if that is too coarse."""
    doubts: list[doc.Doubt]
    """Findings about the logs that make the result doubtful, as `check` reports them, and about `glitches`."""
    glitches: list[doc.FittedGlitch]
    """Readings that only a fitted model shows to be no motion; they were left out."""
    not_judged: list[str]
    """Joints without any measurement: the result does not cover them."""
    left_out: list[doc.LeftOutLog]
    """Logs that could not be used."""
    frozen: list[str]
    """Parameters that kept the model's values (`freeze`), by name."""
    with_prior: list[str]
    """Free parameters whose prior is what earlier logs left (`sd` in the model), by name."""
    at_bound: list[str]
    """Free parameters that ended at a bound; the bounds may cause the remaining error."""
    at_limit: list[str]
    """Those of them whose bound is one of physics, such as a friction of 0: it cannot be wider."""
    adds_to: list[doc.AddsTo]
    """Findings that add to a free parameter: the size of either depends on that parameter's bounds."""
    without_effect: list[str]
    """Effects of the model, as `effect@site`, whose fitted values are those at which they do nothing."""
    cut_short: bool
    """Whether the search was stopped before it had finished: the result is the best so far."""
    rollouts: int
    """Number of simulated logs."""
    seconds: float
    """Wall time, in s."""

    def __init__(self, document: dict[str, Any], page: Page, next_commands: Log | None, model: Model) -> None:
        super().__init__(document, page)
        self.model = model
        """The model as the diagnosis leaves it, whatever the verdict: with the effects that were found as free
        parameters, and all free parameters at their fitted values."""
        self.next_commands = next_commands
        """Commands of `next_experiment` for the robot: `cmd_<joint>`, each held until the next, NaN while the joint's
        motor is off; None without such an experiment."""

    @property
    def names(self) -> list[str]:
        """What is established, or whatever helps if nothing is: effects as `effect@site` and parameters of the model,
        arguments of `add` and `fit`."""
        values = [(value.established, p.name) for value in self.wrong_values for p in value.parameters]
        found = [(effect.established, name) for effect in self.effects for name in names_of([effect])] + values
        any_established = any(established for established, _ in found)
        return [name for established, name in found if established or not any_established]

    def _headline(self) -> str:
        on = f"\nnext: fitted = btr.fit(model, learn, add={self.names!r})" if self.names else ""
        return self._finding() + on

    def _finding(self) -> str:
        """The headline without the call that comes next."""
        return f"cut short; so far: {self._verdict()}" if self.cut_short else self._verdict()

    def _verdict(self) -> str:
        found = ", ".join(self.names)
        to_runs = "what remains is no more than runs of the same command differ by"
        remains = f"; {to_runs}" if self.degree == "explained_to_repeatability" else ""
        if self.verdict == "effect_missing":
            return f"missing: {found}{remains}{self._further()}"
        if self.verdict == "value_wrong":
            return f"wrong in the model: {found}{remains}{self._further()}"
        if self.verdict == "nothing_missing":
            return f"nothing is missing: {to_runs if remains else 'what remains is noise'}"
        share = f"{100 * self.unexplained_share:.0f} % of the squared error is not noise"
        if self.verdict == "partly_explained":
            return f"partly explained by {found}; something else is missing: {share}{self._further()}"
        nothing = "nothing that was tried helps" if self.cut_short else "no effect of the library helps"
        verb = "helps but does not" if len(self.names) == 1 else "help but do not"
        helps = f"{found} {verb} explain the error" if found else nothing
        return f"unexplained: {helps}; {share}{self._further()}"

    def _further(self) -> str:
        """What is known beyond the verdict, one line each."""
        found = [(", ".join(names_of([effect])), effect.alike) for effect in self.effects]
        found += [(f"{value.value}@{value.site}", value.alike) for value in self.wrong_values]
        alike = [f"\nthese logs cannot tell {name} from {', '.join(others)}" for name, others in found if others]
        corrected = [p for value in self.wrong_values for p in value.parameters]
        estimates = [line for effect in self.effects for line in _estimates(effect, self.error_ladder)]
        lines = [
            f"\n{p.name}: {p.value:.4g} {p.unit} in the logs (95 %: {interval(p)}), {p.in_model:.4g} in the model"
            for p in corrected
        ]
        law, experiment = self.residual_law, self.next_experiment
        like = f"\nthe error looks like {law.law} on the {law.on} of {law.site}" if law else ""
        beside = f", beside {', '.join(law.beside)}" if law and law.beside else ""
        low = ", ".join(f"{n.channel} shows {n.shown:.2g} {n.unit} of {n.stated:.2g}" for n in self.noise_stated_low)
        noise = f"\nwhat is left is white: is [noise] stated too low? {low}" if low else ""
        left = self.left_over
        taken = [
            f"\n{s.parameter} ended at {s.value:.4g} {s.unit}, and the model states {s.in_model:.4g}: with that, "
            f"{' or '.join(s.effects)} would explain these logs as well; freeze it if you know it"
            for s in self.stand_ins
        ]
        last = self.error_ladder[-1]
        held_out = "" if last.held_out is None else f" and {last.held_out:.2f} on held-out logs"
        rest = (
            f"\nwhat is left counts as noise ({last.train:.2f}{held_out}), so the verdict holds; but {left.name} "
            f"would lower it to {left.train:.2f} for certain (delta BIC {left.delta_bic:.0f}), by less than the 5 % "
            "that a name needs"
            if left
            else ""
        )
        proposal = f"\nnext experiment: {experiment.sentence}" if experiment else ""
        idle = removable(self.without_effect)
        stopped = (
            f"\nthe search was stopped after {self.rollouts} rollouts: what it had not tried yet may explain the logs "
            "as well, or better"
            if self.cut_short
            else ""
        )
        told = [stopped, *estimates, *lines, noise, rest, *taken, *alike, like, beside, proposal, idle]
        return "".join(told)

    def _table(self) -> Rows:
        return [{"step": s.step, "error (x noise floor)": s.train, "held out": s.held_out} for s in self.error_ladder]

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draws the error ladder on training and held-out logs, in noise floors, on Matplotlib's `ax` or a new figure,
        and returns the figure. Raises `ImportError` without Matplotlib."""
        return plots.diagnose(self, ax)


def _estimates(effect: doc.EffectReport, ladder: list[doc.LadderStep]) -> list[str]:
    """What speaks for an effect, and its estimates, one line each."""
    name, error = ", ".join(names_of([effect])), "of the squared error above the noise"
    shares = f"{_percent(effect.share)} {error}"
    if effect.learnt_share is not None:
        learnt = f"{_percent(effect.learnt_share)} {error} on the training logs"
        shares = f"{learnt}, {_percent(effect.share)} on held-out logs"
    of = f"probability {_probability(effect)}, explains {shares}{_fall(effect, ladder)}"
    rest = [f"{rival.name or 'the model without it'} {probability(rival.probability)}" for rival in effect.rivals]
    return (
        [f"\n{name}: {of}"]
        + ([f"\n  the rest of the probability: {', '.join(rest)}"] if rest else [])
        + [f"\n  {p.name} = {cell(p.value)} {p.unit} (95 %: {interval(p)})" for p in effect.parameters]
    )


def _percent(share: float) -> str:
    return "less than 1 %" if 0 < share < 0.005 else f"{100 * share:.0f} %"


def _fall(effect: doc.EffectReport, ladder: list[doc.LadderStep]) -> str:
    """By how much the error fell with an effect whose share is small: that is one of the error at first, which may have
    been large."""
    steps = fell(ladder, names_of([effect]))
    if steps is None or max(effect.share, effect.learnt_share or 0.0) >= _LITTLE:
        return ""
    before, after = steps
    known = before.held_out is not None and after.held_out is not None
    held_out = f" (held out: from {before.held_out:.2f} to {after.held_out:.2f})" if known else ""
    learnt = f"from {before.train:.2f} to {after.train:.2f} noise floors"
    return f"; with it, the error fell {learnt}{held_out}"


def _probability(support: doc.Support) -> str:
    """The probability of a finding, as a bound where it is one."""
    cap = support.probability_cap
    if cap is not None and support.probability >= 0.99 * cap.at_most:
        return f"at most {cap.at_most:.2f}"
    return probability(support.probability)
