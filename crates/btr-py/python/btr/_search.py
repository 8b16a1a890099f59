"""What all searches have in common: asking, telling, stopping."""

from __future__ import annotations

import math
import operator
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from numbers import Real
from typing import Any, Literal, NamedTuple, Protocol, TypeVar, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btr import _btr
from btr._inputs import count, floats, must_be_called, wrong
from btr.executors import must_be_some as some_threads

Scale = Literal["linear", "log"]
"""Equal steps are equal differences, or equal ratios: for what may be small or large by orders of magnitude."""
Cost = Callable[[NDArray[np.float64]], Any]
"""What is minimised: takes an array of shape (dimensions,), gives one number."""
S = TypeVar("S", bound="Search")


class Executor(Protocol):
    """An executor like `concurrent.futures.ProcessPoolExecutor`: `submit` returns a future."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Any:
        """Has `fn(*args)` called, and gives back its future."""


ExecutorLike = Union[Executor, int, Literal["threads"], None]
"""Who evaluates: an executor, so many threads of this process (for functions that wait, or that let go of Python's lock), as
many as it has processors (`"threads"`), or the calling thread."""


class Best(NamedTuple):
    """The best solution told, its cost, and which evaluation it was, counted from 1; (None, inf, 0) before any success."""

    x: NDArray[np.float64] | None
    f: float
    evals: int


class SearchResult(NamedTuple):
    """What a search has found so far: the fields of pycma's result, and SciPy's names for the main ones."""

    xbest: NDArray[np.float64] | None
    """The best solution told, of shape (dimensions,); None before any success."""
    fbest: float
    """Its cost; inf before any success."""
    evals_best: int
    """Which evaluation it was, counted from 1; 0 before any success."""
    evaluations: int
    """How many costs were told."""
    iterations: int
    """How many populations were told."""
    xfavorite: NDArray[np.float64] | None
    """Where CMA-ES expects the minimum (its mean); the best solution for the others."""
    stds: NDArray[np.float64] | None
    """Standard deviations of CMA-ES along the dimensions, as they are at `xfavorite` where a scale is logarithmic; else
    None."""
    stop: dict[str, float | str]
    """Why the search is over; empty while it goes on."""

    @property
    def x(self) -> NDArray[np.float64] | None:
        """`xbest`, as SciPy calls it."""
        return self.xbest

    @property
    def fun(self) -> float:
        """`fbest`, as SciPy calls it."""
        return self.fbest

    @property
    def nfev(self) -> int:
        """`evaluations`, as SciPy calls it."""
        return self.evaluations

    @property
    def nit(self) -> int:
        """`iterations`, as SciPy calls it."""
        return self.iterations


class Search:
    """What `CMAES`, `GA` and `RealGA` have in common."""

    def __init__(
        self,
        algorithm: str,
        settings: Mapping[str, Any],
        bounds: ArrayLike,
        x0: ArrayLike | None,
        seed: int,
        scale: Scale | Sequence[Scale],
        limits: tuple[float | None, float | None, float | None],
    ) -> None:
        """Begins a search by its name in experiment files, with their settings; None stands for a default."""
        pairs = _pairs(bounds)
        start = None if x0 is None else floats(x0, "x0 is an array of shape (dimensions,)").ravel().tolist()
        given = [(key, value) for key, value in settings.items() if value is not None]
        _breeding(settings)
        self._search = _btr.Search(algorithm, given, pairs, _log_scales(scale, len(pairs)), start, _seed(seed))
        for name, limit in zip(("maxiter", "maxfevals", "ftarget"), limits):
            _limit(name, limit)
        maxiter, self._maxfevals, self._ftarget = limits
        # As pycma: it grows with the dimensions, and large populations need fewer. Each restart has as many again.
        runs = 1 + (settings.get("restarts") or 0)
        self._maxiter = runs * (100 + 150 * (len(pairs) + 3) ** 2 // self.popsize**0.5) if maxiter is None else maxiter

    @property
    def popsize(self) -> int:
        """How many solutions `ask` gives; more after a restart of CMA-ES."""
        return self._search.popsize

    def ask(self) -> list[NDArray[np.float64]]:
        """The solutions to evaluate, arrays of shape (dimensions,) within the bounds; the same ones until they are told."""
        return self._search.ask()

    def tell(self, solutions: Sequence[ArrayLike], costs: ArrayLike) -> None:
        """Learns the costs of the solutions that were asked, in their order. Raises `BtrError` for any other."""
        asked = self._search.asked
        if asked is None:
            raise wrong("nothing was asked, so nothing can be told", "call ask() before each tell()")
        if len(solutions) != len(asked):
            raise wrong(f"{len(solutions)} solutions where {len(asked)} were asked", "tell all that ask() gave, in its order")
        for i, (told, wanted) in enumerate(zip(solutions, asked)):
            if not np.array_equal(floats(told, "a solution is an array of numbers"), wanted):
                raise wrong(f"solution {i} is not the one that was asked", "tell what ask() gave, unchanged and in its order")
        self._tell(floats(costs, "costs are one number for each solution"))

    def _tell(self, costs: NDArray[np.float64]) -> None:
        if costs.ndim != 1:
            raise wrong(f"costs of shape {costs.shape}", "give one number for each solution: shape (solutions,)")
        self._search.tell(costs.tolist())

    def stop(self) -> dict[str, float | str]:
        """Why the search is over; empty while it goes on. `maxiter`, `maxfevals` and `ftarget` come with their limits, the
        reasons of CMA-ES (`tolx`, `tolfunhist`, `tolstagnation`, `tolconditioncov`, `failures`) with what they mean."""
        search = self._search
        reached: dict[str, float | str] = {}
        if search.iterations >= self._maxiter:
            reached["maxiter"] = self._maxiter
        if self._maxfevals is not None and search.evaluations >= self._maxfevals:
            reached["maxfevals"] = self._maxfevals
        if self._ftarget is not None and self.best.f <= self._ftarget:
            reached["ftarget"] = self._ftarget
        ended = search.ended
        return reached if ended is None else {**reached, ended[0]: ended[1]}

    def optimize(
        self: S,
        f: Cost,
        iterations: int | None = None,
        *,
        executor: ExecutorLike = None,
        callback: Callable[[S], object] | None = None,
    ) -> S:
        """Evaluates populations until `stop`, or for so many more iterations, and gives back itself. The executor, or so many
        threads, evaluates a population at once; the results are the same with any or none. `callback` hears the search after
        each generation.

        Where `f` raises, the search stays where it was before that generation: `ask` gives the same solutions again."""
        must_be_called(f, "what is minimised is a function of an array of shape (dimensions,)")
        last = None if iterations is None else self._search.iterations + count(iterations, "iterations")
        with _evaluator(executor) as evaluates:
            while not self.stop() and (last is None or self._search.iterations < last):
                self._tell(_evaluated(f, self.ask(), evaluates))
                if callback is not None:
                    callback(self)
        return self

    @property
    def best(self) -> Best:
        """The best solution told."""
        best = self._search.best
        return Best(None, float("inf"), 0) if best is None else Best(*best)

    @property
    def result(self) -> SearchResult:
        """What has been found so far."""
        search, best = self._search, self.best
        favorite, stds = search.distribution or (best.x, None)
        return SearchResult(*best, search.evaluations, search.iterations, favorite, stds, self.stop())

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_search": self._search.state()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _search=_btr.Search.restored(state["_search"]))

    def __repr__(self) -> str:
        search, best = self._search, self.best
        return f"<{type(self).__name__}: {search.iterations} iterations, {search.evaluations} evaluations, best {best.f:.6g}>"


def _pairs(bounds: ArrayLike) -> list[tuple[float, float]]:
    expected = "bounds are pairs (low, high), one per dimension"
    array = floats(bounds, expected)
    if array.ndim != 2 or array.shape[1] != 2:
        raise wrong(f"bounds of shape {array.shape}", expected)
    return [(low, high) for low, high in array.tolist()]


def _log_scales(scale: Scale | Sequence[Scale], dims: int) -> list[bool]:
    expected = 'give "linear" or "log", or one of them for each dimension'
    if not isinstance(scale, Iterable):
        raise TypeError(f"{expected}, not {type(scale).__name__}")
    scales = [scale] * dims if isinstance(scale, str) else list(scale)
    if len(scales) != dims:
        raise wrong(f"{len(scales)} scales for {dims} dimensions", expected)
    unknown = [each for each in scales if each not in ("linear", "log")]
    if unknown:
        raise wrong(f"no scale is called {unknown[0]!r}", expected)
    return [each == "log" for each in scales]


def _seed(seed: int) -> int:
    try:
        seed = operator.index(seed)
    except TypeError as error:
        raise TypeError(f"a seed is a whole number, not {type(seed).__name__}") from error
    if not 0 <= seed < 2**64:
        raise wrong(f"seed {seed} is out of range", "give a seed from 0 to 2**64 - 1")
    return seed


def _limit(name: str, limit: float | None) -> None:
    if limit is None:
        return
    if not isinstance(limit, Real):
        raise TypeError(f"{name} is a number or None, not {type(limit).__name__}")
    if math.isnan(limit):
        raise wrong(f"{name} is NaN", "leave it out for no limit")
    if name != "ftarget" and limit < 0:
        raise wrong(f"{name} = {limit}", "give 0 or more, or leave it out for its default")


def _breeding(settings: Mapping[str, Any]) -> None:
    """Raises `BtrError` for inconsistent numbers of parents. Each number alone is checked by the compiled half."""
    elite, popsize, tournament = (settings.get(key) for key in ("elite", "population", "tournament"))
    if isinstance(elite, int) and isinstance(popsize, int) and 2 <= popsize <= elite:
        raise wrong(f"elite = {elite} of popsize = {popsize}", "keep fewer than there are: one at least has to be new")
    if isinstance(tournament, int) and tournament == 0:
        raise wrong("tournament = 0: nobody competes", "give 1 or more; with 1, parents are chosen at random")


def _evaluator(executor: ExecutorLike) -> AbstractContextManager[Executor | None]:
    """Who evaluates, as long as it is needed; raises `TypeError` or `ValueError` for what cannot."""
    if isinstance(executor, str) and executor == "threads":
        return ThreadPoolExecutor(os.cpu_count())
    if isinstance(executor, (int, Real)):
        return ThreadPoolExecutor(some_threads(executor, "executor"))
    if executor is not None and not hasattr(executor, "submit"):
        raise TypeError(
            "an executor of a search is a number of threads, or has a method `submit`, as those of concurrent.futures; "
            f"{executor!r} has none"
        )
    return nullcontext(executor)


def _evaluated(f: Cost, solutions: list[NDArray[np.float64]], executor: Executor | None) -> NDArray[np.float64]:
    """The costs in the order of the solutions, whoever is done first."""
    if executor is None:
        return np.array([_number(f(x)) for x in solutions])
    futures = [executor.submit(f, x) for x in solutions]
    try:
        return np.array([_number(future.result()) for future in futures])
    except BaseException:
        # What has not begun is not worth its time any more.
        for future in futures:
            future.cancel()
        raise


def _number(cost: Any) -> float:
    try:
        return float(cost)
    except (TypeError, ValueError) as error:
        raise TypeError(f"a cost is one number, not {type(cost).__name__}: {error}") from error
