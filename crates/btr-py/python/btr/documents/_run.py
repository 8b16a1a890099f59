"""Objects of the document of `coevolve`: iterations, the posterior, and what the run found."""

from __future__ import annotations

from typing import Any, Literal

from btr._tables import cell
from btr.documents._common import Estimate, LadderStep, Verdict
from btr.documents._record import Record

StopReason = Literal[
    "goal_reached", "nothing_better", "iterations_done", "real_tests_spent", "disengaged", "no_real_data"
]
"""Why a run ended: a real test reached the requested fitness, no controller of the map promises much more than the best
one tested, all iterations were done, the budget of real tests is spent, the populations disengaged, or no real test
gave data."""


class Belief(Record):
    """The posterior of one parameter of S."""

    value: float
    """Most probable value, in the parameter's unit."""
    ci95: tuple[float, float] | None
    """95 % credible interval (low, high) within the bounds; None while simulations do not explain the tests to the
    noise."""
    told: bool
    """Whether half of the interval is at most the plan's `resolution` of the bounds' width."""


class OpenDirection(Record):
    """A combination of parameters that the real tests do not determine."""

    parameters: dict[str, float]
    """The combination, in shares of each parameter's bounds and of unit length; small parts are left out."""
    left: float
    """Its standard deviation as a share of what the bounds alone leave: 1 is nothing learnt."""


class EstimateRecord(Record):
    """The posterior of S after an iteration."""

    explained: bool
    """Whether simulations explain the tests to the noise."""
    unpredictable: float
    """What no simulation of the posterior predicts of the readings, in multiples of the noise: mostly chaos."""
    parameters: dict[str, Belief]
    """Each parameter by name."""
    not_told: list[str]
    """Parameters that the tests do not determine to the plan's resolution."""
    open_directions: list[OpenDirection]
    """Combinations of parameters that the tests hardly determine."""


class Evidence(Record):
    """Evidence of an iteration for or against disengagement."""

    phi_share: float | None
    """phi of s_i as a share of the first simulation's phi on the first transfers: 1 is no better, 0 is agreement."""
    predicted_share: float | None
    """The same for s_(i-1) on this iteration's fresh transfers."""
    rank_agreement: float | None
    """Kendall's tau-b between promised and real fitness of this iteration's transfers."""
    pressure_on_simulations: float | None
    """Spread of phi, (mean - best)/mean, over the first generation of step 3. Near 0 no simulation is better than
    another."""
    pressure_on_controllers: float | None
    """1 - Kendall's tau-b between the transfers' fitness in s_(i-1) and in s_i, halved. At 0 both rank controllers
    alike."""
    at_bound: list[str]
    """Parameters of s_i at a bound of S."""


class Iteration(Record):
    """A closed iteration. `str` gives one line, so that `tell=print` shows the progress of a run."""

    i: int
    """Number, from 1."""
    fitness_sim: float | None
    """Fitness that the simulation of that time promised for the controller c_i."""
    fitness_ci95: tuple[float, float] | None
    """95 % prediction interval of that fitness; None without a posterior or a map."""
    fitness_real: float | None
    """Fitness of c_i in reality."""
    best_real: float | None
    """Best real fitness so far, of any controller."""
    phi_predicted: float | None
    """phi of the previous simulation on this iteration's new transfers."""
    phi: float | None
    """phi of s_i on the transfers that count."""
    parameters: dict[str, float]
    """s_i by name, in the units of S."""
    posterior: EstimateRecord | None
    """Posterior of S; None if the plan asks for none."""
    controller: list[float]
    """c_i in the units of C."""
    real_tests: int
    """Real tests so far."""
    simulated_evaluations: int
    """Simulated behaviours so far."""
    evidence: Evidence
    """Evidence for or against disengagement."""

    def __str__(self) -> str:
        phi, predicted = cell(self["phi"]), self["phi_predicted"]
        before = "" if predicted is None else f", {cell(predicted)} for the one before on fresh tests"
        promised, real = self["fitness_sim"], self["fitness_real"]
        fitness = "" if promised is None and real is None else f"; fitness {cell(promised)} promised, {cell(real)} real"
        return f"iteration {self['i']}: {self['real_tests']} real tests; phi {phi}{before}{fitness}"


class MissingEffect(Record):
    """An effect that the simulations of a run lack."""

    effect: str
    """Name of the effect."""
    site: str
    """The joint, link, `base` or `*` where it sits."""
    alike: list[str]
    """`effect@site` of the effects that the tests cannot tell from it."""
    probability: float
    """Its posterior probability among all candidates of its round, the model without it included."""
    delta_bic: float
    """How much it lowers the information criterion."""
    parameters: list[Estimate]
    """Its parameters."""


class Cause(Record):
    """Why the populations disengaged, by the real tests."""

    after_iteration: int
    """The iteration after which this was asked."""
    verdict: Verdict | None
    """The verdict; None if no diagnosis was possible."""
    effects: list[MissingEffect]
    """What is missing; with the verdict `unexplained`, what helps without explaining the error."""
    error_ladder: list[LadderStep]
    """The error ladder, in multiples of the noise floor."""
    learnt: list[int]
    """Numbers of the real tests used for training."""
    held_out: list[int]
    """Numbers of the held-out real tests."""
    rollouts: int
    """Number of simulated logs."""
    not_diagnosed: str | None
    """Why there is no diagnosis; None if there is one."""
    added: list[str]
    """What the run added to S."""


class Augmentation(Record):
    """An enlargement of S: the paper's re-parametrisation."""

    after_iteration: int
    """The last iteration closed before."""
    real_tests: int
    """Real tests so far."""
    parameters: list[str]
    """Parameters that S gained."""


class Change(Record):
    """A parameter of S that has changed."""

    parameter: str
    """Name of the parameter."""
    before: float
    """Estimate before, in the units of S."""
    after: float
    """Estimate now, in the units of S."""
    deviations: float
    """The difference in multiples of its standard deviation."""


class Drift(Record):
    """A change of the robot during the run."""

    before_test: int
    """Number of the first real test that shows it."""
    iteration: int
    """The iteration in which it was noticed."""
    changed: list[Change]
    """Parameters of S that differ significantly, the most certain first; empty if S does not hold what has changed."""
    explained: bool
    """Whether a simulation of S explains the tests since then."""
    former: dict[str, Any]
    """Posterior before the change: `mean` and `covariance` on the unit cube of S, as serialised."""


class RealityGap(Record):
    """The reality gap: real fitness less promised fitness, over the real tests of a run."""

    mean: float
    """Mean over the tests, in the unit of fitness; negative if reality falls short."""
    ci95: tuple[float, float] | None
    """95 % interval of the mean (Student's t); None for fewer than three tests."""
    tests: int
    """Number of completed tests with a promise."""
    within: tuple[int, int]
    """Number of tests within their prediction interval, and number of tests with an interval."""


class Recommended(Record):
    """The tested controller with the best real fitness."""

    test: int
    """Number of the real test."""
    fitness_real: float
    """Its real fitness."""
    controller: dict[str, float]
    """Its parameters by name, in the units of C."""


class TwinComparison(Record):
    """The hidden twin and the estimate of it."""

    parameters: dict[str, float]
    """True parameters by name, in the units of S."""
    effects: list[str]
    """Effects of the twin that the model did not have."""
    error_percent: dict[str, float]
    """Error of the estimate in percent of the truth, by parameter."""
    error_percent_before: dict[str, float]
    """The same for the first simulation of the run."""
    state_match: dict[str, float]
    """Root mean square of X_s - X_r over the states of the twin (eqs 1 and 2), by unit, for the recommended
    controller."""


class ChannelScore(Record):
    """Errors of a simulated channel."""

    mean_abs: float
    """Mean absolute error, in the channel's unit."""
    rmse: float
    """Root mean square error, in the channel's unit."""
    fit_percent: float | None
    """100·(1 - |error|/|measured - its mean|), in percent; None for a channel that does not change."""


class LogScore(Record):
    """How well the simulation reproduces a joint channel of a recorded log."""

    log: str
    """Name of the log."""
    held_out: bool
    """Whether it was held out from the search."""
    channel: str
    """Name of the channel."""
    unit: str
    """SI unit."""
    before: ChannelScore
    """Errors of the first simulation."""
    after: ChannelScore
    """Errors of the simulation found."""


class ByDistance(Record):
    """The result of another distance on the same real tests."""

    distance: str
    """Name of the distance."""
    phi: tuple[float, float]
    """phi at the start and at the end, in the distance's own unit."""
    parameters: dict[str, float]
    """The estimate by name, in the units of S."""
    error_percent: dict[str, float]
    """Error in percent of the truth, where the truth is known."""
    resolution_percent: dict[str, float | None]
    """How far a parameter has to move before phi shows it, in percent of its value; None if a quarter does not show."""
    telling: float
    """phi above which a simulation is distinguishable from this one."""
    phi_of_truth: float | None
    """phi of the true parameters; None if they are not known. Above `telling`, the distance prefers a wrong
    simulation."""
