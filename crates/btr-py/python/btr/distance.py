"""Distances between real and simulated series: those of experiments, for any series.

    btr.distance.rmse(real, simulated)                                  # arrays (samples,) or (samples, channels)
    btr.distance.dtw({"q_knee": real}, {"q_knee": simulated}, band=0.05)
    btr.distance.information(real_log, simulated_log, channels=["q_*"])

Both sides are arrays of one shape, dicts of series by name, or logs (`btr.Log`, or anything that `btr.load_log` reads).
Arrays and dicts are compared as a whole. Of logs, the channels that both have are compared, the simulated ones
resampled on the real clock, except for external measurements (`base_*`, names unknown to btr). A sample that is NaN on
either side is ignored on both. 0 means equality; inf means that no samples were left to compare.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Real
from types import MappingProxyType
from typing import Any, TypeVar, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btr import _btr
from btr._btr import Log
from btr._inputs import floats, wrong
from btr._sources import LogLike
from btr.logs import load_log

__all__ = ["dtw", "fitness", "information", "normalised_rmse", "rmse", "spectrum", "whitened"]

Series = Union[ArrayLike, Mapping[str, ArrayLike], LogLike]
"""An array of shape (samples,) or (samples, channels), series of shape (samples,) by name, or a log."""
F = TypeVar("F", bound=Callable[..., float])

_SENTENCES = {name: sentence for name, sentence, _ in _btr.distances()}
_COMMON = """

    real, simulated: arrays of shape (samples,) or (samples, channels), dicts of arrays by name, or logs.
    channels: names to compare, `*` matches any characters; default: all. Columns of arrays are named 0, 1, ...
    clock_s: times of the samples of arrays and dicts, in s, increasing; or dt_s, the time between them. Default: evenly
    spaced.

    Each channel is divided by the standard deviation of the real one, so that channels of different units can be
    combined. For a channel that hardly moves, the divisor is a tenth of the largest one among channels of its unit.
    Columns of arrays and names in dicts without a unit count as having the same unit. If their units differ, name the
    channels accordingly (`q_` is rad, `q_<joint>_m` m, `dq_` rad/s, `tau_` N·m); otherwise a channel that moves by
    millimetres is weighted as if it were an angle.
    Raises BtrError if the series do not match each other, TypeError for values that are not series."""


def _as_in_experiments(function: F) -> F:
    """Starts the docstring with the description of `btr info` and ends it with the arguments common to all
    distances."""
    common = "" if function.__name__ == "fitness" else _COMMON
    sentence = _SENTENCES[function.__name__]
    function.__doc__ = f"{sentence[0].upper()}{sentence[1:]}.\n\n    {function.__doc__}{common}"
    return function


@_as_in_experiments
def fitness(real: float, simulated: float) -> float:
    """Takes the fitness of the real and of the simulated behaviour, two numbers; inf if one is NaN."""
    return _btr.fitness_distance(real, simulated)


@_as_in_experiments
def information(
    real: Series,
    simulated: Series,
    *,
    bins: int = 16,
    channels: str | Sequence[str] = (),
    dt_s: float | None = None,
    clock_s: ArrayLike | None = None,
) -> float:
    """Summed over the channels, including commands. Independent of units; depends on `bins`, the number of equal
    intervals across the range of both series."""
    return _distance("information", real, simulated, dt_s, clock_s, bins=bins, channels=channels)


@_as_in_experiments
def rmse(
    real: Series,
    simulated: Series,
    *,
    channels: str | Sequence[str] = (),
    dt_s: float | None = None,
    clock_s: ArrayLike | None = None,
) -> float:
    """A constant prediction at the mean scores 1."""
    return _distance("rmse", real, simulated, dt_s, clock_s, channels=channels)


@_as_in_experiments
def normalised_rmse(
    real: Series,
    simulated: Series,
    *,
    most: float = 10.0,
    channels: str | Sequence[str] = (),
    dt_s: float | None = None,
    clock_s: ArrayLike | None = None,
) -> float:
    """Each channel contributes at most `most`, so that a single bad channel does not hide the others."""
    return _distance("normalised_rmse", real, simulated, dt_s, clock_s, most=most, channels=channels)


@_as_in_experiments
def spectrum(
    real: Series,
    simulated: Series,
    *,
    channels: str | Sequence[str] = (),
    dt_s: float | None = None,
    clock_s: ArrayLike | None = None,
) -> float:
    """Needs at least four samples."""
    return _distance("spectrum", real, simulated, dt_s, clock_s, channels=channels)


@_as_in_experiments
def dtw(
    real: Series,
    simulated: Series,
    *,
    band: float = 0.1,
    samples: int = 512,
    channels: str | Sequence[str] = (),
    dt_s: float | None = None,
    clock_s: ArrayLike | None = None,
) -> float:
    """A sample may be shifted by `band`, a fraction of the series' length. Series longer than `samples` are first
    averaged in blocks. Each channel is warped separately."""
    return _distance("dtw", real, simulated, dt_s, clock_s, band=band, samples=samples, channels=channels)


@_as_in_experiments
def whitened(
    real: Series,
    simulated: Series,
    *,
    noise: Mapping[str, float] = MappingProxyType({}),
    channels: str | Sequence[str] = (),
    dt_s: float | None = None,
    clock_s: ArrayLike | None = None,
) -> float:
    """`noise` is the standard deviation of each channel's noise in its unit, by name or pattern (`{"q_*": 0.0005}`);
    for channels without an entry it is estimated from the real readings. There is no other weighting of channels."""
    return _distance("whitened", real, simulated, dt_s, clock_s, noise=dict(noise), channels=channels)


def _distance(
    name: str, real: Series, simulated: Series, dt_s: float | None, clock_s: ArrayLike | None, **settings: Any
) -> float:
    channels = settings["channels"]
    if not isinstance(channels, Iterable):
        raise TypeError(f"channels are names, not {channels!r}")
    settings["channels"] = [channels] if isinstance(channels, str) else list(channels)
    return _btr.distance(name, list(settings.items()), *_logs(real, simulated, dt_s, clock_s))


def _logs(real: Series, simulated: Series, dt_s: float | None, clock_s: ArrayLike | None) -> tuple[Log, Log]:
    one, other = _read(real), _read(simulated)
    if isinstance(one, Log) and isinstance(other, Log):
        if dt_s is not None or clock_s is not None:
            raise wrong("logs have clocks of their own", "leave out dt_s and clock_s")
        return one, other
    if isinstance(one, Log) or isinstance(other, Log):
        raise TypeError("both sides are logs or neither is: a log has a clock of its own")
    if not (isinstance(real, Mapping) or isinstance(simulated, Mapping)) and len(one) != len(other):
        raise wrong(f"{len(one)} real channels, but {len(other)} simulated ones", "compare arrays of the same shape")
    for name in one:
        if name in other and len(one[name]) != len(other[name]):
            what = f"{len(one[name])} real samples, but {len(other[name])} simulated ones"
            how = "give both sides as many samples, or pass logs, which have clocks of their own"
            raise wrong(f"{what}{_of(name, real)}", how)
    unmatched = sorted(one.keys() ^ other.keys())
    if unmatched:
        raise wrong(f"only one side has {', '.join(unmatched)}", "give both sides the same channels")
    lengths = {len(series): name for name, series in one.items()}
    if len(lengths) > 1:
        (a, one_of_a), (b, one_of_b), *_ = lengths.items()
        what = f"{one_of_a} has {a} samples, {one_of_b} has {b}"
        raise wrong(what, "give all channels as many samples, or pass logs, which have clocks of their own")
    samples = max(lengths, default=0)
    clock = _clock(samples, dt_s, clock_s)
    if len(clock) != samples:
        raise wrong(f"clock_s has {len(clock)} times for {samples} samples", "give one time per sample, in s")
    return _btr.measured("real", clock, list(one.items())), _btr.measured("simulated", clock, list(other.items()))


def _of(name: str, series: Any) -> str:
    """The channel's name for a message; empty for a single series without a name."""
    return f" of channel {name}" if isinstance(series, Mapping) or np.ndim(series) == 2 else ""


def _read(series: Any) -> Log | dict[str, NDArray[np.float64]]:
    """A log, or series by name."""
    if isinstance(series, (str, os.PathLike, Log)) or hasattr(series, "columns"):
        return load_log(series)
    if isinstance(series, Mapping):
        return {str(name): _one(values, f"channel {name}") for name, values in series.items()}
    array = floats(series, "series are arrays of numbers, dicts of them, or logs")
    if array.ndim not in (1, 2):
        raise wrong(f"series of shape {array.shape}", "give shape (samples,) or (samples, channels)")
    return {str(i): np.ascontiguousarray(column) for i, column in enumerate(np.atleast_2d(array.T))}


def _one(values: Any, what: str) -> NDArray[np.float64]:
    array = floats(values, f"{what} is an array of numbers")
    if array.ndim != 1:
        raise wrong(f"{what} has shape {array.shape}", "give each name one series: shape (samples,)")
    return array


def _clock(samples: int, dt_s: float | None, clock_s: ArrayLike | None) -> NDArray[np.float64]:
    if clock_s is not None:
        if dt_s is not None:
            raise wrong("both dt_s and clock_s are given", "give one of them")
        return _one(clock_s, "clock_s")
    if dt_s is not None and not isinstance(dt_s, Real):
        raise TypeError(f"dt_s is a number, the time between samples in s, not {dt_s!r}")
    if dt_s is not None and not 0 < dt_s < float("inf"):
        raise wrong(f"dt_s = {dt_s}", "give the time between samples in s, a positive number")
    return np.arange(samples, dtype=np.float64) * (1.0 if dt_s is None else dt_s)
