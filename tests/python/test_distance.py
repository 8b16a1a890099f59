"""Distances from Python: their properties, and a few lines of NumPy with the same results."""

import inspect
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import btr
from btr import _btr, distance

ON_SERIES = [distance.information, distance.rmse, distance.normalised_rmse, distance.spectrum, distance.dtw]
numbers = st.floats(-1e3, 1e3).filter(lambda x: x == 0 or abs(x) > 1e-3)


@st.composite
def pairs(draw, least: int = 4):
    """Two arrays of one shape, the real one with some motion in each channel."""
    shape = (draw(st.integers(least, 40)), draw(st.integers(1, 4)))
    real, simulated = (draw(arrays(float, shape, elements=numbers)) for _ in range(2))
    real[:2] = [[0.0] * shape[1], [1.0] * shape[1]]
    return real, simulated


def scales(real: np.ndarray) -> np.ndarray:
    """The divisor of each channel's error: see `Channels` in the core."""
    spread = real.std(axis=0)
    return np.maximum(spread, 0.1 * spread.max())


def numpy_rmse(real: np.ndarray, simulated: np.ndarray) -> float:
    errors = np.sqrt(((real - simulated) ** 2).mean(axis=0)) / scales(real)
    return float(np.sqrt((errors**2).mean()))


def numpy_dtw(real: np.ndarray, simulated: np.ndarray, band: float) -> float:
    n = len(real)
    reach = int(np.ceil(band * n))
    errors = []
    for x, y in zip(real.T, simulated.T):
        dear = np.full((n + 1, n + 1), np.inf)
        dear[0, 0] = 0
        for i in range(n):
            for j in range(max(0, i - reach), min(n, i + reach + 1)):
                dear[i + 1, j + 1] = (x[i] - y[j]) ** 2 + min(dear[i, j], dear[i, j + 1], dear[i + 1, j])
        errors.append(dear[n, n] / n)
    return float(np.sqrt((errors / scales(real) ** 2).mean()))


def entropy(*symbols: np.ndarray) -> float:
    counts = np.unique(np.stack(symbols), axis=1, return_counts=True)[1]
    return float(-(counts / counts.sum() * np.log2(counts / counts.sum())).sum())


def numpy_information(real: np.ndarray, simulated: np.ndarray, bins: int) -> float:
    bits = 0.0
    for pair in zip(real.T, simulated.T):
        low, high = np.min(pair), np.max(pair)
        x, y = (np.minimum(((side - low) * (bins / (high - low))).astype(int), bins - 1) for side in pair)
        bits += 2 * entropy(x, y) - entropy(x) - entropy(y)
    return bits


@given(pairs(), st.floats(0.05, 1), st.integers(2, 40))
@settings(deadline=None)
def test_distances_equal_a_few_lines_of_numpy(pair, band: float, bins: int) -> None:
    real, simulated = pair
    assert distance.rmse(real, simulated) == pytest.approx(numpy_rmse(real, simulated), rel=1e-9)
    assert distance.dtw(real, simulated, band=band) == pytest.approx(numpy_dtw(real, simulated, band), rel=1e-9)
    bits = distance.information(real, simulated, bins=bins)
    assert bits == pytest.approx(numpy_information(real, simulated, bins), abs=1e-9)
    errors = np.sqrt(((real - simulated) ** 2).mean(axis=0)) / scales(real)
    assert distance.normalised_rmse(real, simulated, most=3.0) == pytest.approx(np.minimum(errors, 3).mean(), rel=1e-9)


@given(st.sampled_from(ON_SERIES), pairs())
@settings(deadline=None)
def test_zero_for_itself_and_nothing_below(measure, pair) -> None:
    real, simulated = pair
    assert measure(real, real) <= 1e-9
    assert measure(real, simulated) >= 0
    if measure in (distance.rmse, distance.normalised_rmse) and not np.array_equal(real, simulated):
        assert measure(real, simulated) > 0


@given(st.sampled_from(ON_SERIES), pairs(), st.randoms())
@settings(deadline=None)
def test_the_order_and_the_names_of_channels_do_not_matter(measure, pair, random) -> None:
    real, simulated = pair
    order = list(range(real.shape[1]))
    random.shuffle(order)
    value = measure(real, simulated)
    assert measure(real[:, order], simulated[:, order]) == pytest.approx(value, rel=1e-9, abs=1e-9)
    named = [{f"part_{i}": side[:, i] for i in order} for side in pair]
    assert measure(*named) == pytest.approx(value, rel=1e-9, abs=1e-9)


@given(st.sampled_from(ON_SERIES), pairs(), st.sampled_from([2.0**-20, 0.5, 4.0, 2.0**20]), numbers)
@settings(deadline=None)
def test_units_and_clocks_do_not_matter(measure, pair, unit: float, dt_s: float) -> None:
    real, simulated = pair
    value = measure(real, simulated)
    assert measure(unit * real, unit * simulated) == pytest.approx(value, rel=1e-9, abs=1e-9)
    assert measure(real, simulated, dt_s=abs(dt_s) + 0.01) == pytest.approx(value, rel=1e-6, abs=1e-6)


@given(pairs())
@settings(deadline=None)
def test_distances_are_symmetric_without_weights(pair) -> None:
    real, simulated = pair
    assert distance.information(real, simulated) == pytest.approx(distance.information(simulated, real), abs=1e-9)
    # Channels with the same samples in another order have the same weights.
    shuffled = real[::-1]
    for measure in (distance.rmse, distance.dtw, distance.normalised_rmse):
        assert measure(real, shuffled) == pytest.approx(measure(shuffled, real), rel=1e-9)


@given(pairs(), st.floats(0.05, 0.5), st.floats(0, 0.5))
@settings(deadline=None)
def test_dtw_decreases_with_the_band(pair, narrow: float, more: float) -> None:
    wide, tight = (distance.dtw(*pair, band=band) for band in (narrow + more, narrow))
    assert wide <= tight * (1 + 1e-12) and tight <= distance.rmse(*pair) * (1 + 1e-12)


@given(st.floats(allow_nan=True), st.floats(allow_nan=True))
def test_fitness_is_a_difference_of_two_numbers(real: float, simulated: float) -> None:
    wanted = abs(real - simulated)
    assert distance.fitness(real, simulated) == (np.inf if np.isnan(wanted) else wanted)


def waves() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t = np.arange(1000) * 0.01
    return t, np.sin(4 * np.pi * t), np.sin(4 * np.pi * t + 1.0)


def test_each_distance_responds_to_its_kind_of_error() -> None:
    t, x, late = waves()
    assert distance.spectrum(x, late) < 0.02 < 0.9 < distance.rmse(x, late) < 1.1
    # A phase of 1 rad is 8 samples, which a band of 0.01 moves by up to 10: by 2 with 0.002.
    assert distance.dtw(x, late) < 0.2 < 0.4 < distance.dtw(x, late, band=0.002)
    assert distance.rmse(x, np.full(1000, x.mean())) == pytest.approx(1)
    assert distance.normalised_rmse(x, 100 * x) == 10 and distance.normalised_rmse(x, 100 * x, most=2) == 2
    # Twice as fast from the middle: the same samples on another clock have another spectrum.
    hurried = np.concatenate([t[:500], t[500] + 0.5 * (t[500:] - t[500])])
    swing = np.sin(4 * np.pi * t * (1 + t / 20))
    even, uneven = distance.spectrum(x, swing, clock_s=t), distance.spectrum(x, swing, clock_s=hurried)
    assert even == pytest.approx(distance.spectrum(x, swing)) and abs(even - uneven) > 0.05


def test_arrays_dicts_frames_and_logs_are_the_same() -> None:
    t, x, late = waves()
    one, other = btr.Log(t, {"q_a": x, "cmd_a": x}), btr.Log(t, {"q_a": late, "cmd_a": x, "q_b": x})
    value = distance.rmse(x, late)
    same = {name: other[name] for name in one.keys()}
    assert distance.rmse(one, other) == distance.rmse(one.to_dict(), same) == value
    with pytest.raises(btr.BtrError, match="only one side has q_b"):
        distance.rmse(one.to_dict(), other.to_dict())
    assert distance.rmse(list(x), late[:, None]) == value
    assert distance.rmse(np.c_[x, x], np.c_[late, x], channels="0") == value
    assert distance.rmse({"q_a": x, "b": x}, {"q_a": late, "b": x}, channels=["q_*"]) == value
    # Commands count only for phi_2, in dicts as in logs.
    measured = distance.information({"cmd_a": x}, {"cmd_a": late})
    assert measured > 1 and np.isinf(distance.rmse({"cmd_a": x}, {"cmd_a": late}))
    frame = pytest.importorskip("pandas").DataFrame
    assert distance.rmse(frame({"t": t, "q_a": x}), frame({"t": t, "q_a": late})) == value


def test_what_is_missing_is_left_out() -> None:
    _, x, late = waves()
    holes = late.copy()
    holes[100:200] = np.nan
    kept = ~np.isnan(holes)
    error = np.sqrt(((x - late)[kept] ** 2).mean()) / x.std()
    assert distance.rmse(x, holes) == pytest.approx(error)
    for measure in ON_SERIES:
        assert measure(x, np.full(1000, np.nan)) == np.inf and np.isfinite(measure(x, holes))


T, X, _ = waves()


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (
            lambda: distance.rmse(X, X[1:]),
            "^1000 real samples, but 999 simulated ones\nhelp: give both sides as many",
        ),
        (
            lambda: distance.rmse(np.c_[X, X], np.c_[X, X][1:]),
            "1000 real samples, but 999 simulated ones of channel 0",
        ),
        (lambda: distance.dtw({"a": X[1:]}, {"a": X}), "999 real samples, but 1000 simulated ones of channel a"),
        (lambda: distance.rmse({"a": X, "b": X[1:]}, {"a": X, "b": X[1:]}), "^a has 1000 samples, b has 999"),
        (lambda: distance.rmse(np.c_[X, X], X), "2 real channels, but 1"),
        (lambda: distance.rmse(np.ones((2, 2, 2)), X), r"series of shape \(2, 2, 2\)"),
        (lambda: distance.rmse(3.0, 4.0), r"series of shape \(\)"),
        (lambda: distance.rmse({"a": X[:, None]}, {"a": X}), r"channel a has shape \(1000, 1\)"),
        (lambda: distance.rmse({"a": X}, {"b": X}), "only one side has a, b"),
        (lambda: distance.rmse({}, {}), "no channel to compare"),
        (lambda: distance.rmse(btr.Log(T, {"a": X}), btr.Log(T, {"a": X})), "of logs commands and sensors"),
        (lambda: distance.rmse({"a": X}, {"a": X}, channels="b*"), "no channel is called `b\\*`"),
        (lambda: distance.rmse(X, X, dt_s=0), "dt_s = 0"),
        (lambda: distance.rmse(X, X, dt_s=np.nan), "dt_s = nan"),
        (lambda: distance.rmse(X, X, dt_s=0.1, clock_s=T), "both dt_s and clock_s"),
        (lambda: distance.rmse(X, X, clock_s=T[::-1]), "the clock does not increase"),
        (lambda: distance.rmse(X, X, clock_s=T[1:]), "clock_s has 999 times for 1000 samples"),
        (lambda: distance.rmse(btr.Log(T, {"q_a": X}), btr.Log(T, {"q_a": X}), dt_s=0.1), "clocks of their own"),
        (lambda: distance.dtw(X, X, band=2.0), "band: .*up to 1, not 2.0"),
        (lambda: distance.dtw(X, X, band=np.nan), "band: "),
        (lambda: distance.information(X, X, bins=1), "bins: .*not 1"),
        (lambda: distance.rmse("nowhere.csv", X), "nowhere.csv"),
    ],
)
def test_invalid_values_are_reported(mistake, message: str) -> None:
    with pytest.raises(btr.BtrError, match=message):
        mistake()


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (lambda: distance.rmse(X, btr.Log(T, {"q_a": X})), "both sides are logs"),
        (lambda: distance.rmse(object(), X), "series are arrays of numbers"),
        (lambda: distance.rmse({"a": "text"}, {"a": X}), "channel a is an array of numbers"),
        (lambda: distance.rmse(X, X, bandwidth=3), "bandwidth"),
        (lambda: distance.rmse(X, X, dt_s="a"), "dt_s is a number, the time between samples in s, not 'a'"),
        (lambda: distance.rmse(X, X, channels=3), "channels are names, not 3"),
        (lambda: distance.fitness("good", 1.0), "real"),
    ],
)
def test_wrong_types_are_type_errors(mistake, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        mistake()


def test_the_module_has_the_distances_of_experiments() -> None:
    registry = {name: (sentence, json.loads(text)) for name, sentence, text in _btr.distances()}
    assert sorted(registry) == sorted(distance.__all__)
    for name, (sentence, defaults) in registry.items():
        function = getattr(distance, name)
        assert function.__doc__.lower().startswith(sentence.lower())
        assert defaults.pop("name") == name
        keywords = {
            key: p.default for key, p in inspect.signature(function).parameters.items() if p.kind == p.KEYWORD_ONLY
        }
        clocks = [keywords.pop(key, None) for key in ("dt_s", "clock_s")]
        assert {**keywords, "channels": []} == {**defaults, "channels": []} and clocks == [None, None]
