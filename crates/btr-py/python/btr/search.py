"""Searches for the minimum of any Python function between bounds: CMA-ES and two genetic algorithms, the ones that
experiments use.

    es = btr.search.CMAES([(-5, 5), (1e-3, 1e3)], scale=["linear", "log"], seed=1)
    while not es.stop():
        solutions = es.ask()
        es.tell(solutions, [cost(x) for x in solutions])
    es.result.xbest

Names are those of pycma (`cma.CMAEvolutionStrategy`), with these differences: bounds come first and are pairs, as in SciPy;
`sigma0` is a share of every dimension's range; `ask` gives the same solutions until they are told; nothing is printed. A cost
that is NaN or infinite is a failure: it is never the best, and nothing moves towards it.

The same seed gives the same solutions on every machine. A search can be pickled at any time, also between `ask` and `tell`,
and goes on with the same bits. What makes no sense ends in `BtrError`, what is no number in TypeError.
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
    """CMA-ES: a normal distribution that learns the shape of the landscape. The most exact where dimensions act jointly and
    the landscape is smooth."""

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
        """`bounds`: pairs (low, high), one per dimension. `x0`: where it begins, in the middle unless given. `sigma0`:
        standard deviation at the start, as a share of every dimension's range. `popsize`: solutions per generation, 4 + 3
        ln(dimensions) unless given. `restarts`: how often it restarts from another point after convergence, each time with
        twice the solutions. `maxiter`: generations at most, pycma's number unless given. `maxfevals`: no new generation after
        so many evaluations. `ftarget`: a cost that is good enough."""
        settings = {"population": popsize, "sigma": sigma0, "restarts": restarts}
        super().__init__("cma_es", settings, bounds, x0, seed, scale, (maxiter, maxfevals, ftarget))


class GA(Search):
    """The paper's genetic algorithm on Gray-coded bits: its solutions lie on a grid of 2**bits points along each dimension."""

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
        """`x0`: the first generation is it and mutants of it; random unless given. `mutation`: the probability that a bit
        flips. `crossover`: the probability that a child has two parents. `elite`: how many of the best are asked again,
        fewer than `popsize`. `tournament`: how many compete to become a parent. All else as for `CMAES`. Ends only at `maxiter`, `maxfevals` or
        `ftarget`."""
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
        """`mutation`: the probability that a number is mutated. `sigma`: standard deviation of a mutation, as a share of the
        range. `eta`: distribution index of the crossover; large ones keep children close to their parents. All else as for
        `GA`."""
        breeding = {"mutation": mutation, "crossover": crossover, "elite": elite, "tournament": tournament}
        settings = {"population": popsize, **breeding, "sigma": sigma, "eta": eta}
        super().__init__("real_ga", settings, bounds, x0, seed, scale, (maxiter, maxfevals, ftarget))


ALGORITHMS: dict[str, Callable[..., Search]] = {"ga": GA, "real_ga": RealGA, "cma_es": CMAES}
"""By their names in experiment files."""


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
    """The minimum of `f` (array of shape (dimensions,) -> number) between bounds, in SciPy's manner. `settings` are those of
    the algorithm (`cma_es`: `CMAES`, `ga`: `GA`, `real_ga`: `RealGA`), `maxiter`, `maxfevals` and `ftarget` among them;
    `executor` and `callback` are as in `Search.optimize`."""
    if algorithm not in ALGORITHMS:
        raise wrong(f"no search is called {algorithm!r}", f"there are {', '.join(ALGORITHMS)}")
    search = ALGORITHMS[algorithm](bounds, x0, seed=seed, scale=scale, **settings)
    return search.optimize(f, executor=executor, callback=callback).result
