"""Searches from Python: properties for any function, and that they find minima."""

import inspect
import json
import multiprocessing
import pickle
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import btr
from btr import _btr
from btr.search import CMAES, GA, RealGA, minimize

ALGORITHMS = [CMAES, GA, RealGA]
SQUARE = [(-3.0, 5.0), (0.0, 2.0)]

algorithms = st.sampled_from(ALGORITHMS)
seeds = st.integers(0, 2**64 - 1)
lows = st.floats(-1e6, 1e6)
intervals = st.tuples(lows, st.floats(1e-3, 1e6)).map(lambda pair: (pair[0], pair[0] + pair[1]))
log_intervals = st.tuples(st.floats(1e-9, 1e3), st.floats(1.5, 1e9)).map(lambda pair: (pair[0], pair[0] * pair[1]))
dimensions = st.one_of(st.tuples(intervals, st.just("linear")), st.tuples(log_intervals, st.just("log")))


def ellipsoid(x: np.ndarray) -> float:
    """Minimum 0 at (1, 1.5)."""
    return float((x[0] - 1) ** 2 + 100 * (x[1] - 1.5) ** 2)


def rosenbrock(x: np.ndarray) -> float:
    return float(np.sum(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2))


def evaluated(es: btr.search.Search, generations: int, f=ellipsoid) -> list[np.ndarray]:
    """All solutions of some generations."""
    seen = []
    for _ in range(generations):
        solutions = es.ask()
        es.tell(solutions, [f(x) for x in solutions])
        seen += solutions
    return seen


@given(algorithms, st.lists(dimensions, min_size=1, max_size=5), seeds, st.floats(0, 1), st.booleans())
@settings(deadline=None, max_examples=60)
def test_solutions_lie_within_the_bounds_and_belong_to_the_seed(algorithm, dims, seed, share, begun) -> None:
    bounds, scale = [list(column) for column in zip(*dims)]
    x0 = [min(low + share * (high - low), high) for low, high in bounds] if begun else None
    one, other = (algorithm(bounds, x0, scale=scale, seed=seed) for _ in range(2))
    seen = evaluated(one, 6, f=np.sum)
    assert all(low <= value <= high for x in seen for value, (low, high) in zip(x, bounds))
    np.testing.assert_array_equal(seen, evaluated(other, 6, f=np.sum))
    third = evaluated(algorithm(bounds, x0, scale=scale, seed=seed ^ 1), 6, f=np.sum)
    assert not np.array_equal(seen, third)


@given(algorithms, seeds, st.integers(0, 40), st.booleans(), st.floats(0, 1))
@settings(deadline=None, max_examples=40)
def test_a_pickled_search_goes_on_with_the_same_bits(algorithm, seed, saved, between, failing) -> None:
    def f(x: np.ndarray) -> float:
        return np.nan if (x.sum() * 7919) % 1 < failing else ellipsoid(x)

    es = algorithm(SQUARE, seed=seed)
    evaluated(es, saved, f)
    asked = es.ask() if between else None
    back = pickle.loads(pickle.dumps(es))
    if asked is not None:
        np.testing.assert_array_equal(asked, back.ask())
    np.testing.assert_array_equal(evaluated(es, 20, f), evaluated(back, 20, f))
    assert repr(es.result) == repr(back.result) and type(back) is algorithm


@given(algorithms, seeds)
@settings(deadline=None, max_examples=20)
def test_the_best_is_the_best_of_all_solutions(algorithm, seed) -> None:
    es, costs = algorithm(SQUARE, seed=seed), []
    for generation in range(15):
        solutions = es.ask()
        mixed = [[ellipsoid(x), np.nan, np.inf, -np.inf][i % 4] for i, x in enumerate(solutions)]
        es.tell(solutions, mixed)
        costs += mixed
        finite = np.where(np.isfinite(costs), costs, np.inf)
        result = es.result
        assert result.fbest == result.fun == es.best.f == finite.min()
        assert result.evals_best == es.best.evals == 1 + finite.argmin()
        assert ellipsoid(result.x) == result.fbest and es.best.x.tolist() == result.xbest.tolist()
        assert (result.nfev, result.nit) == (result.evaluations, result.iterations) == (len(costs), generation + 1)


def test_asking_again_is_no_step_and_restarts_double_the_population() -> None:
    es, sizes = CMAES(SQUARE, restarts=2), []
    while not es.stop():
        solutions = es.ask()
        np.testing.assert_array_equal(solutions, es.ask())
        es.tell(solutions, np.ones(len(solutions)))
        sizes.append(len(solutions))
    assert sizes == sorted(sizes) and set(sizes) == {6, 12, 24}
    assert list(es.stop()) == ["tolfunhist"]


def test_nothing_is_best_where_everything_fails() -> None:
    es = CMAES(SQUARE).optimize(lambda x: np.nan)
    assert es.best.x is None and es.best.f == np.inf and "failures" in es.stop()


@pytest.mark.parametrize("seed", range(3))
def test_minima_are_found(seed: int) -> None:
    ours = minimize(ellipsoid, SQUARE, seed=seed)
    np.testing.assert_allclose(ours.x, [1, 1.5], atol=1e-5)
    assert ours.stop.keys() & {"tolfunhist", "tolx"} and "maxiter" not in ours.stop
    np.testing.assert_allclose(ours.xfavorite, [1, 1.5], atol=1e-4)
    assert (ours.stds < 1e-3).all()
    valley = minimize(rosenbrock, [(-2, 2)] * 4, x0=np.zeros(4), restarts=2, seed=seed, ftarget=1e-10)
    assert valley.fun <= 1e-10 and valley.stop == {"ftarget": 1e-10}
    np.testing.assert_allclose(valley.x, 1, atol=1e-4)
    for algorithm in ("ga", "real_ga"):
        rough = minimize(ellipsoid, SQUARE, algorithm, popsize=40, seed=seed, maxfevals=8000)
        assert rough.fun < 2e-3 and rough.nfev == 8000 and rough.stds is None, (algorithm, rough)


def test_a_log_scale_finds_what_is_small_by_orders_of_magnitude() -> None:
    def f(x: np.ndarray) -> float:
        return abs(np.log(x[0] / 3e-7))

    assert minimize(f, [(1e-9, 1e3)], scale="log", maxfevals=400).x[0] == pytest.approx(3e-7, rel=1e-3)
    halves = [x[0] > 1e-3 for x in RealGA([(1e-9, 1e3)], scale="log", popsize=2000).ask()]
    assert 0.45 < np.mean(halves) < 0.55
    # Of the mean's own standard deviation: a quarter of the range, of 12 decades at 1e-3.
    result = CMAES([(1e-9, 1e3)], scale="log").result
    np.testing.assert_allclose(result.stds, 0.25 * np.log(1e12) * result.xfavorite)


def test_the_search_begins_at_x0_with_sigma0() -> None:
    for algorithm in (GA, RealGA):
        np.testing.assert_allclose(algorithm(SQUARE, [4.0, 0.5]).ask()[0], [4.0, 0.5], rtol=1e-4)
    es = CMAES(SQUARE, [4.0, 0.5], 0.01)
    np.testing.assert_allclose(es.result.xfavorite, [4.0, 0.5])
    np.testing.assert_allclose(es.result.stds, [0.08, 0.02])
    assert np.std(CMAES(SQUARE, [1.0, 1.0], 0.01, popsize=3000).ask(), axis=0) == pytest.approx([0.08, 0.02], rel=0.1)


def test_limits_end_it_under_the_names_of_pycma() -> None:
    assert minimize(rosenbrock, SQUARE, maxiter=7).stop == {"maxiter": 7}
    assert CMAES(SQUARE).optimize(rosenbrock, 7).result[3:5] == (42, 7)
    es = CMAES(SQUARE, popsize=6, maxfevals=20)
    assert es.stop() == {} and es.optimize(rosenbrock).result.nfev == 24
    assert minimize(ellipsoid, SQUARE, "ga").nit == 100 + 150 * 25 // 20**0.5
    one, other = CMAES(SQUARE).optimize(rosenbrock, 3).optimize(rosenbrock, 4), CMAES(SQUARE).optimize(rosenbrock, 7)
    np.testing.assert_array_equal(one.ask(), other.ask())
    heard: list[int] = []
    other.optimize(rosenbrock, 3, callback=lambda es: heard.append(es.result.nit))
    assert heard == [8, 9, 10]


@pytest.mark.parametrize("algorithm", ["ga", "real_ga", "cma_es"])
def test_any_executor_gives_the_same(algorithm: str) -> None:
    alone = minimize(rosenbrock, SQUARE, algorithm, maxiter=15)
    # Spawned, since forks of a process with threads may deadlock.
    spawned = ProcessPoolExecutor(2, multiprocessing.get_context("spawn"))
    for executor in (ThreadPoolExecutor(3), spawned):
        with executor:
            assert repr(minimize(rosenbrock, SQUARE, algorithm, maxiter=15, executor=executor)) == repr(alone)


@pytest.mark.parametrize("threads", [None, 2])
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_an_exception_leaves_the_search_before_that_generation(algorithm, threads: int | None) -> None:
    es, whole = algorithm(SQUARE).optimize(ellipsoid, 5), algorithm(SQUARE).optimize(ellipsoid, 9)
    before, seen = es.ask(), []

    def breaks(x: np.ndarray) -> float:
        seen.append(x.copy())
        x[:] = 0
        if len(seen) == 3:
            raise KeyboardInterrupt
        return 1.0

    with (
        nullcontext() if threads is None else ThreadPoolExecutor(threads) as executor,
        pytest.raises(KeyboardInterrupt),
    ):
        es.optimize(breaks, executor=executor)
    np.testing.assert_array_equal(before, es.ask())
    assert repr(es.optimize(ellipsoid, 4).result) == repr(whole.result)


def wrong_population(change) -> None:
    es = CMAES(SQUARE)
    solutions = es.ask()
    change(es, solutions, [1.0] * len(solutions))


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (lambda: CMAES([(0, np.nan)]), r"bounds \[0, NaN\] must be finite"),
        (lambda: CMAES([(2, 1)]), "min < max"),
        (lambda: CMAES([(-1e308, 1e308)]), "too far apart"),
        (lambda: CMAES([(0, 1)], scale="log"), "logarithmic scale needs positive bounds"),
        (lambda: CMAES([(1e-300, 1e300)], scale="log"), "too far apart"),
        (lambda: CMAES([0, 1]), r"bounds of shape \(2,\)"),
        (lambda: CMAES(np.empty((0, 2))), "one at least"),
        (lambda: CMAES(SQUARE, scale=["log"]), "1 scales for 2 dimensions"),
        (lambda: CMAES(SQUARE, scale="cubic"), "no scale is called 'cubic'"),
        (lambda: CMAES(SQUARE, [0, 3]), r"`x\[1\]` = 3 lies outside"),
        (lambda: CMAES(SQUARE, [0, np.nan]), "outside its bounds"),
        (lambda: CMAES(SQUARE, [0]), "the point has 1 values"),
        (lambda: CMAES(SQUARE, sigma0=0), "sigma0: expected a positive number, not 0"),
        (lambda: CMAES(SQUARE, sigma0=np.nan), "sigma0: expected a finite number, not NaN"),
        (lambda: CMAES(SQUARE, popsize=1), "popsize: expected a count of 2 or more, not 1"),
        (lambda: CMAES(SQUARE, popsize=10**12), "popsize: expected a count of 1000000 or less"),
        (lambda: GA(SQUARE, bits=40), "bits: .*between 1 and 32"),
        (lambda: GA(SQUARE, mutation=2), "mutation: .*between 0 and 1, not 2"),
        (lambda: RealGA(SQUARE, elite=-1), "elite: "),
        (lambda: RealGA(SQUARE, elite=-1), "elite: .*expected a whole number, 0 or more"),
        (lambda: GA(SQUARE, popsize=2.5), "popsize: .*expected a whole number"),
        (lambda: GA(SQUARE, popsize=10, elite=10), "elite = 10 of popsize = 10\nhelp: keep fewer"),
        (lambda: RealGA(SQUARE, elite=30), "elite = 30 of popsize = 20"),
        (lambda: GA(SQUARE, tournament=0), "tournament = 0: nobody competes"),
        (lambda: CMAES(SQUARE, maxiter=-1), "maxiter = -1"),
        (lambda: GA(SQUARE, maxfevals=-5), "maxfevals = -5"),
        (lambda: GA(SQUARE).optimize(ellipsoid, -1), "iterations = -1"),
        (lambda: CMAES(SQUARE, seed=-1), "seed -1"),
        (lambda: CMAES(SQUARE, ftarget=np.nan), "ftarget is NaN"),
        (lambda: minimize(ellipsoid, SQUARE, "cmaes"), "there are ga, real_ga, cma_es"),
        (lambda: CMAES(SQUARE).tell([], []), "nothing was asked"),
        (lambda: wrong_population(lambda es, x, f: es.tell(x[1:], f[1:])), "5 solutions, but 6"),
        (lambda: wrong_population(lambda es, x, f: es.tell(x, f[1:])), "5 costs, but 6"),
        (lambda: wrong_population(lambda es, x, f: es.tell(x, np.ones((6, 1)))), r"costs of shape \(6, 1\)"),
        (lambda: wrong_population(lambda es, x, f: es.tell(x[::-1], f)), "solution 0 is not the one"),
        (lambda: wrong_population(lambda es, x, f: (es.tell(x, f), es.tell(x, f))), "nothing was asked"),
        (lambda: _btr.Search.restored("{}"), "not a search of this version"),
    ],
)
def test_invalid_values_are_reported(mistake, message: str) -> None:
    with pytest.raises(btr.BtrError, match=message):
        mistake()


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (lambda: CMAES([("a", "b")]), "bounds are pairs"),
        (lambda: CMAES([(0, 1), (2,)]), "bounds are pairs"),
        (lambda: CMAES(SQUARE, seed=1.5), "a seed is a whole number, not float"),
        (lambda: CMAES(SQUARE, maxiter="7"), "maxiter is a number or None, not str"),
        (lambda: CMAES(SQUARE, popsize="7"), "popsize cannot be '7'"),
        (lambda: CMAES(SQUARE).optimize(lambda x: None), "a cost is one number, not NoneType"),
        (lambda: CMAES(SQUARE).optimize(lambda x: x), "a cost is one number, not ndarray"),
        (
            lambda: CMAES(SQUARE).optimize(ellipsoid, executor="ray"),
            "is a number of threads, or has a method `submit`.*'ray'",
        ),
        (lambda: CMAES(SQUARE).optimize(ellipsoid, "two"), "iterations is a whole number, not 'two'"),
        (lambda: CMAES(SQUARE).optimize(3), "what is minimised is a function .*, not 3"),
        (lambda: CMAES(SQUARE, scale=3), 'give "linear" or "log"'),
        (lambda: wrong_population(lambda es, x, f: es.tell(x, "costs")), "costs are one number"),
        (lambda: minimize(ellipsoid, SQUARE, "ga", sigma0=1), "sigma0"),
    ],
)
def test_wrong_types_are_type_errors(mistake, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        mistake()


def test_threads_evaluate_where_a_number_of_them_is_given() -> None:
    seen: set[str] = set()

    def cost(x: np.ndarray) -> float:
        seen.add(threading.current_thread().name)
        return ellipsoid(x)

    alone = minimize(ellipsoid, SQUARE, maxiter=3)
    assert (
        minimize(cost, SQUARE, maxiter=3, executor=2).fbest == alone.fbest
        and threading.current_thread().name not in seen
    )
    assert minimize(cost, SQUARE, maxiter=3, executor="threads").fbest == alone.fbest
    for workers in (0, -1, 2.5, True):
        with pytest.raises(ValueError, match=f"executor={workers}"):
            minimize(ellipsoid, SQUARE, executor=workers)


def test_an_invalid_tell_changes_nothing() -> None:
    es = CMAES(SQUARE)
    solutions = es.ask()
    with pytest.raises(btr.BtrError):
        es.tell(solutions, [1.0])
    np.testing.assert_array_equal(solutions, es.ask())


def test_names_and_defaults_are_those_of_experiments() -> None:
    assert list(btr.search.ALGORITHMS) == [name for name, *_ in _btr.searches()]
    theirs = {"popsize": "population", "sigma0": "sigma"}
    # As pycma's class, CMA-ES ends when it has converged; experiments have a budget to spend instead.
    apart = {("cma_es", "restarts"), ("cma_es", "seeded_sigma")}
    common = {"bounds", "x0", "seed", "scale", "maxiter", "maxfevals", "ftarget"}
    for name, _, text in _btr.searches():
        parameters = inspect.signature(btr.search.ALGORITHMS[name]).parameters
        ours = {theirs.get(key, key): p.default for key, p in parameters.items() if key not in common}
        defaults = json.loads(text)
        assert defaults.pop("algorithm") == name
        for key in set(ours) | set(defaults):
            assert (name, key) in apart or ours[key] == defaults[key], (name, key)
