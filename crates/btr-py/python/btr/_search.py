"""The common interface of all searches: ask, tell, stop."""

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
"""Equal steps are equal differences (`linear`) or equal ratios (`log`, for values that span orders of magnitude)."""
Cost = Callable[[NDArray[np.float64]], Any]
"""The function to minimise: takes an array of shape (dimensions,), returns one number."""
S = TypeVar("S", bound="Search")


class Executor(Protocol):
    """An executor like `concurrent.futures.ProcessPoolExecutor`: `submit` returns a future."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Any:
        """Schedules `fn(*args)` and returns its future."""


ExecutorLike = Union[Executor, int, Literal["threads"], None]
"""Where costs are evaluated: an executor, a number of threads of this process (for functions that wait or release
the GIL), one thread per processor (`"threads"`), or the calling thread (None)."""


class Best(NamedTuple):
    """The best solution so far, its cost, and the number of its evaluation from 1; (None, inf, 0) before any
    success."""

    x: NDArray[np.float64] | None
    f: float
    evals: int


class SearchResult(NamedTuple):
    """State of a search: the fields of pycma's result, and SciPy's names for the main ones."""

    xbest: NDArray[np.float64] | None
    """The best solution so far, of shape (dimensions,); None before any success."""
    fbest: float
    """Its cost; inf before any success."""
    evals_best: int
    """Number of its evaluation, from 1; 0 before any success."""
    evaluations: int
    """Number of evaluated costs."""
    iterations: int
    """Number of evaluated populations."""
    xfavorite: NDArray[np.float64] | None
    """The mean of CMA-ES, where it expects the minimum; the best solution for the other algorithms."""
    stds: NDArray[np.float64] | None
    """Standard deviations of CMA-ES along the dimensions (at `xfavorite` for logarithmic scales); None for the other
    algorithms."""
    stop: dict[str, float | str]
    """Stop reasons; empty while the search is running."""

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
    """Base class of `CMAES`, `GA` and `RealGA`."""

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
        """Creates a search by its name and settings in experiment files; None selects a default."""
        pairs = _pairs(bounds)
        start = None if x0 is None else floats(x0, "x0 is an array of shape (dimensions,)").ravel().tolist()
        given = [(key, value) for key, value in settings.items() if value is not None]
        _breeding(settings)
        self._search = _btr.Search(algorithm, given, pairs, _log_scales(scale, len(pairs)), start, _seed(seed))
        for name, limit in zip(("maxiter", "maxfevals", "ftarget"), limits):
            _limit(name, limit)
        maxiter, self._maxfevals, self._ftarget = limits
        # pycma's default: more for more dimensions, fewer for larger populations; the same again for each restart.
        runs = 1 + (settings.get("restarts") or 0)
        self._maxiter = runs * (100 + 150 * (len(pairs) + 3) ** 2 // self.popsize**0.5) if maxiter is None else maxiter

    @property
    def popsize(self) -> int:
        """Number of solutions that `ask` returns; larger after a restart of CMA-ES."""
        return self._search.popsize

    def ask(self) -> list[NDArray[np.float64]]:
        """The solutions to evaluate, arrays of shape (dimensions,) within the bounds; the same ones until `tell`."""
        return self._search.ask()

    def tell(self, solutions: Sequence[ArrayLike], costs: ArrayLike) -> None:
        """Updates the search with the costs of the solutions from `ask`, in their order. Raises `BtrError` for other
        solutions."""
        pending = self._search.asked
        if pending is None:
            raise wrong("nothing was asked: no solutions are pending", "call ask() before each tell()")
        if len(solutions) != len(pending):
            what = f"{len(solutions)} solutions, but {len(pending)} are pending"
            raise wrong(what, "pass all solutions of ask(), in its order")
        for i, (solution, expected) in enumerate(zip(solutions, pending)):
            if not np.array_equal(floats(solution, "a solution is an array of numbers"), expected):
                what = f"solution {i} is not the one that ask() returned"
                raise wrong(what, "pass the solutions of ask(), unchanged and in its order")
        self._tell(floats(costs, "costs are one number for each solution"))

    def _tell(self, costs: NDArray[np.float64]) -> None:
        if costs.ndim != 1:
            raise wrong(f"costs of shape {costs.shape}", "give one number for each solution: shape (solutions,)")
        self._search.tell(costs.tolist())

    def stop(self) -> dict[str, float | str]:
        """Stop reasons; empty while the search is running. `maxiter`, `maxfevals` and `ftarget` map to their limits,
        the reasons of CMA-ES (`tolx`, `tolfunhist`, `tolstagnation`, `tolconditioncov`, `failures`) to a
        description."""
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
        """Evaluates populations until `stop`, or for `iterations` more generations, and returns the search. The
        executor (or that number of threads) evaluates a population in parallel; the results do not depend on it.
        `callback` is called with the search after each generation.

        If `f` raises, the search keeps its state from before that generation: `ask` returns the same solutions
        again."""
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
        """The best solution so far."""
        best = self._search.best
        return Best(None, float("inf"), 0) if best is None else Best(*best)

    @property
    def result(self) -> SearchResult:
        """The current state of the search."""
        search, best = self._search, self.best
        favorite, stds = search.distribution or (best.x, None)
        return SearchResult(*best, search.evaluations, search.iterations, favorite, stds, self.stop())

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_search": self._search.state()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _search=_btr.Search.restored(state["_search"]))

    def __repr__(self) -> str:
        search, best = self._search, self.best
        counts = f"{search.iterations} iterations, {search.evaluations} evaluations"
        return f"<{type(self).__name__}: {counts}, best {best.f:.6g}>"


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
    """Raises `BtrError` for inconsistent numbers of parents. The compiled module checks each number by itself."""
    elite, popsize, tournament = (settings.get(key) for key in ("elite", "population", "tournament"))
    if isinstance(elite, int) and isinstance(popsize, int) and 2 <= popsize <= elite:
        raise wrong(f"elite = {elite} of popsize = {popsize}", "keep fewer than popsize: at least one must be new")
    if isinstance(tournament, int) and tournament == 0:
        raise wrong("tournament = 0: nobody competes", "give 1 or more; with 1, parents are chosen at random")


def _evaluator(executor: ExecutorLike) -> AbstractContextManager[Executor | None]:
    """Context of an executor; None evaluates in this thread. Raises `TypeError` or `ValueError` for invalid
    arguments."""
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
    """The costs in the order of the solutions, not of completion."""
    if executor is None:
        return np.array([_number(f(x)) for x in solutions])
    futures = [executor.submit(f, x) for x in solutions]
    try:
        return np.array([_number(future.result()) for future in futures])
    except BaseException:
        # Cancel evaluations that have not started.
        for future in futures:
            future.cancel()
        raise


def _number(cost: Any) -> float:
    try:
        return float(cost)
    except (TypeError, ValueError) as error:
        raise TypeError(f"a cost is one number, not {type(cost).__name__}: {error}") from error
