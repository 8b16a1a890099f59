"""Result of `fit`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from btr import _tables, plots
from btr import documents as doc
from btr._btr import BtrError, Page
from btr._inputs import count
from btr._tables import Rows, cell
from btr.documents._common import interval
from btr.results._base import Reported
from btr.results._effects import removable

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from btr.model import Model


class FitResult(Reported):
    """The fitted parameters (`parameters`) and the fitted `model`. `space` has the free parameters before the fit."""

    cost: float
    """Sum of squares in multiples of the noise, with the priors' share."""
    parameters: list[doc.Estimate]
    """Every free parameter."""
    in_model: dict[str, float]
    """Values of the free parameters in the model before the fit, by name; not of effects that were added."""
    train: float
    """Error on the training logs, in multiples of the noise floor."""
    held_out: float | None
    """Error on the held-out logs, in multiples of the noise floor; None without any."""
    degree: doc.Degree
    """How far the error is explained."""
    remaining: list[doc.RemainingError]
    """What is left in each channel, on held-out logs if there are any."""
    without_effect: list[str]
    """Effects of the model, as `effect@site`, whose fitted values are those at which they do nothing."""
    null_directions: list[doc.NullDirection]
    """Combinations of parameters that the logs do not determine."""
    posterior: doc.Posterior | None
    """What logs and priors leave of all parameters together; None if nothing is free. `draws` draws from it."""
    error_ladder: list[doc.LadderStep]
    """The error after each step, in multiples of the noise floor."""
    stop_reason: doc.FitStop
    """Why the fit ended."""
    withheld: str | None
    """Why there are no intervals; None if there are."""
    base_parameters: doc.BaseParameters | None
    """What the logs tell about all dynamic parameters of an arm; None unless asked for."""
    noise_floor: list[doc.NoiseFloor]
    """The noise floor of each channel."""
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
    integrator_error: float
    """Error of the time integration, in multiples of the noise floor."""
    time_step_s: float
    """Time step of the fit, in s; finer than the model's own if that is too coarse."""
    rollouts: int
    """Number of simulated logs."""
    seconds: float
    """Wall time, in s."""

    def __init__(self, document: dict[str, Any], page: Page, space: list[dict[str, Any]], model: Model) -> None:
        super().__init__(document, page)
        self.space = [doc.Dimension(dimension) for dimension in space]
        """The free parameters before the fit, with their bounds."""
        self.model = model
        """The fitted model."""

    @property
    def values(self) -> dict[str, float]:
        """The fitted values by name."""
        return {parameter.name: parameter.value for parameter in self.parameters}

    @property
    def x(self) -> NDArray[np.float64]:
        """The fitted values in order, of shape (len(parameters),), in their units. SciPy's name."""
        return np.array([parameter.value for parameter in self.parameters])

    @property
    def nfev(self) -> int:
        """Number of simulated logs. SciPy's name."""
        return self.rollouts

    @property
    def success(self) -> bool:
        """Whether the search converged; `stop_reason` says why it ended. SciPy's name."""
        return self.stop_reason == "converged"

    def draws(self, many: int, *, seed: int = 0) -> dict[str, NDArray[np.float64]]:
        """Values of the fitted parameters for domain randomisation, drawn from the posterior: by name, of shape
        (many,), in their units. Correlations are kept, and combinations that the logs do not determine vary as widely
        as before the fit. For `model.simulate_all(draws)`, or one by one:

            drawn = fitted.draws(50)
            models = [fitted.model.at({name: values[k] for name, values in drawn.items()}) for k in range(50)]

        Where the fit left an error that is not noise (`posterior.has_structure`), the draws are widened by it but may
        not contain the robot. Raises `BtrError` if nothing was free, and for a negative number."""
        if self.posterior is None:
            raise BtrError("this fit has no posterior: it had no free parameters")
        rows = self.model._model.draws(json.dumps(self.posterior), count(many, "many"), count(seed, "seed"))
        names = [parameter.name for parameter in self.parameters]
        table = np.array(rows, dtype=np.float64).reshape(len(rows), len(names))
        return {name: table[:, k] for k, name in enumerate(names)}

    def _headline(self) -> str:
        ladder = "; ".join(f"{s.step}: {cell(s.train)}, {cell(s.held_out)} held out" for s in self.error_ladder)
        why = f"\nno intervals: {self.withheld}" if self.withheld else ""
        bounded = any(p.by_bounds and not p.at_bound for p in self.parameters)
        by = "\nby its bounds: that is what the bounds leave; the logs tell less" if bounded else ""
        undetermined = "".join(f"\n{direction.sentence}" for direction in self.null_directions)
        return f"error in noise floors: {ladder}{why}{by}{removable(self.without_effect)}{undetermined}"

    def _table(self) -> Rows:
        return [
            {"parameter": p.name, "value": p.value, "unit": p.unit, "95 % interval": interval(p)}
            for p in self.parameters
        ]

    def to_dataframe(self) -> pandas.DataFrame:
        """The parameters as a pandas frame: `parameter`, `value`, `unit`, the ends of the 95 % interval (`low`, `high`:
        NaN without an interval), and whether the value is `at_bound` and the interval `by_bounds`. Raises `ImportError`
        without pandas."""

        def row(p: doc.Estimate) -> dict[str, Any]:
            low, high = p.ci95 or (np.nan, np.nan)
            known = {"parameter": p.name, "value": p.value, "unit": p.unit, "low": low, "high": high}
            return {**known, "at_bound": p.at_bound, "by_bounds": p.by_bounds}

        return _tables.frame([row(p) for p in self.parameters])

    def plot(self, ax: Sequence[Axes] | None = None) -> Figure:
        """Draws each value with its 95 % interval between its bounds, and the error ladder, on a pair of Matplotlib's
        axes or a new figure, and returns the figure. Raises `ImportError` without Matplotlib."""
        return plots.fit(self, ax)
