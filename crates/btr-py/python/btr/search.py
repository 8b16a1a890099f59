"""Minimises any Python function within bounds: CMA-ES and two genetic algorithms, the same ones that experiments use.

    es = btr.search.CMAES([(-5, 5), (1e-3, 1e3)], scale=["linear", "log"], seed=1)
    while not es.stop():
        solutions = es.ask()
        es.tell(solutions, [cost(x) for x in solutions])
    es.result.xbest

Names are those of pycma (`cma.CMAEvolutionStrategy`), with these differences: bounds come first and are pairs, as in
SciPy; `sigma0` is a fraction of each dimension's range; `ask` returns the same solutions until `tell`; nothing is
printed. A cost that is NaN or infinite is a failure: it is never the best, and the search does not move towards it.

The same seed gives the same solutions on every machine. A search can be pickled at any time, also between `ask` and
`tell`, and continues with the same bits. Invalid values raise `BtrError`, values of a wrong type `TypeError`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from numpy.typing import ArrayLike

from btr._inputs import wrong
from btr._search import Best, Cost, Executor, ExecutorLike, Scale, Search, SearchResult

__all__ = [
    "CMAES",
    "GA",
    "Best",
    "Cost",
    "Executor",
    "ExecutorLike",
    "RealGA",
    "Scale",
    "Search",
    "SearchResult",
    "minimize",
]


class CMAES(Search):
    """CMA-ES: a normal distribution that adapts its covariance to the cost. The most accurate choice for smooth costs
    with dependent dimensions."""

    def __init__(
        self,
        bounds: ArrayLike,
        x0: ArrayLike | None = None,
        sigma0: float = 0.25,
        *,
        seed: int = 0,
        popsize: int | None = None,
        restarts: int = 0,
        scale: Scale | Sequence[Scale] = "linear",
        maxiter: float | None = None,
        maxfevals: float | None = None,
        ftarget: float | None = None,
    ) -> None:
        """`bounds`: pairs (low, high), one per dimension. `x0`: initial mean; default: middle of the bounds. `sigma0`:
        initial standard deviation, as a fraction of each dimension's range. `popsize`: solutions per generation;
        default: 4 + 3 ln(dimensions). `restarts`: number of restarts from another point after convergence, each with
        twice the solutions. `maxiter`: maximum number of generations; default: that of pycma. `maxfevals`: number of
        evaluations after which no generation starts. `ftarget`: cost at which the search stops."""
        settings = {"population": popsize, "sigma": sigma0, "restarts": restarts}
        super().__init__("cma_es", settings, bounds, x0, seed, scale, (maxiter, maxfevals, ftarget))


class GA(Search):
    """The paper's genetic algorithm on Gray-coded bits. Solutions lie on a grid of 2**bits points per dimension."""

    def __init__(
        self,
        bounds: ArrayLike,
        x0: ArrayLike | None = None,
        *,
        seed: int = 0,
        popsize: int = 20,
        mutation: float = 0.02,
        crossover: float = 0.7,
        elite: int = 1,
        tournament: int = 2,
        bits: int = 16,
        scale: Scale | Sequence[Scale] = "linear",
        maxiter: float | None = None,
        maxfevals: float | None = None,
        ftarget: float | None = None,
    ) -> None:
        """`x0`: the first generation consists of it and mutants of it; default: random. `mutation`: probability that a
        bit flips. `crossover`: probability that a child has two parents. `elite`: number of best solutions kept in the
        next generation, less than `popsize`. `tournament`: number of candidates that compete to become a parent. The
        others are those of `CMAES`. Stops only at `maxiter`, `maxfevals` or `ftarget`."""
        breeding = {"mutation": mutation, "crossover": crossover, "elite": elite, "tournament": tournament}
        settings = {"population": popsize, **breeding, "bits": bits}
        super().__init__("ga", settings, bounds, x0, seed, scale, (maxiter, maxfevals, ftarget))


class RealGA(Search):
    """A genetic algorithm on real numbers: simulated binary crossover and Gaussian mutation."""

    def __init__(
        self,
        bounds: ArrayLike,
        x0: ArrayLike | None = None,
        *,
        seed: int = 0,
        popsize: int = 20,
        mutation: float = 0.2,
        sigma: float = 0.1,
        crossover: float = 0.9,
        eta: float = 5.0,
        elite: int = 1,
        tournament: int = 2,
        scale: Scale | Sequence[Scale] = "linear",
        maxiter: float | None = None,
        maxfevals: float | None = None,
        ftarget: float | None = None,
    ) -> None:
        """`mutation`: probability that a number is mutated. `sigma`: standard deviation of a mutation, as a fraction of
        the range. `eta`: distribution index of the crossover; large values keep children close to their parents. The
        others are those of `GA`."""
        breeding = {"mutation": mutation, "crossover": crossover, "elite": elite, "tournament": tournament}
        settings = {"population": popsize, **breeding, "sigma": sigma, "eta": eta}
        super().__init__("real_ga", settings, bounds, x0, seed, scale, (maxiter, maxfevals, ftarget))


ALGORITHMS: dict[str, Callable[..., Search]] = {"ga": GA, "real_ga": RealGA, "cma_es": CMAES}
"""The algorithms by their names in experiment files."""


def minimize(
    f: Cost,
    bounds: ArrayLike,
    algorithm: str = "cma_es",
    *,
    x0: ArrayLike | None = None,
    seed: int = 0,
    scale: Scale | Sequence[Scale] = "linear",
    executor: ExecutorLike = None,
    callback: Callable[[Any], object] | None = None,
    **settings: Any,
) -> SearchResult:
    """Minimises `f` (array of shape (dimensions,) -> number) within bounds, as SciPy's `minimize` does. `settings` are
    those of the algorithm (`cma_es`: `CMAES`, `ga`: `GA`, `real_ga`: `RealGA`), including `maxiter`, `maxfevals` and
    `ftarget`; `executor` and `callback` are as in `Search.optimize`."""
    if algorithm not in ALGORITHMS:
        raise wrong(f"no search is called {algorithm!r}", f"there are {', '.join(ALGORITHMS)}")
    search = ALGORITHMS[algorithm](bounds, x0, seed=seed, scale=scale, **settings)
    return search.optimize(f, executor=executor, callback=callback).result
