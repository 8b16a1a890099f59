"""Commands of logs: multisine, steps, slow ramps with reversals, and smooth random motion as of a teleoperator."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from .robots import Random, Vector, between

# Everything begins at rest and grows from zero within this time.
EASE_S = 0.5


def multisine(rng: Random, t: Vector, fastest_hz: float) -> Vector:
    """Five sines between 0.1 Hz and the fastest frequency."""
    wave = np.zeros_like(t)
    for frequency in np.geomspace(0.15, fastest_hz, 5) * rng.uniform(0.8, 1.2, 5):
        amplitude = min(between(rng, 0.06, 0.25), 1.5 / (math.tau * frequency))
        phase = between(rng, 0.0, math.tau)
        wave += amplitude * (np.sin(math.tau * frequency * t + phase) - math.sin(phase))
    return np.minimum(t / EASE_S, 1.0) * wave


def steps(rng: Random, t: Vector, fastest_hz: float) -> Vector:
    """A new level every 0.6 to 1.5 s."""
    hold, offset = between(rng, 0.6, 1.5), between(rng, 0.0, 0.5)
    levels = rng.uniform(-0.4, 0.4, int(t[-1] / hold) + 3)
    levels[0] = 0.0
    return np.asarray(levels[((t + offset) / hold).astype(int)])


def ramps(rng: Random, t: Vector, fastest_hz: float) -> Vector:
    """A slow triangle with some rest at its turning points."""
    amplitude, period = between(rng, 0.2, 0.6), between(rng, 2.5, 7.0)
    rest = between(rng, 1.0, 1.4)
    triangle = 4.0 * np.abs((t / period + 0.25) % 1.0 - 0.5) - 1.0
    return -amplitude * np.clip(rest * triangle, -1.0, 1.0)


def teleoperation(rng: Random, t: Vector, fastest_hz: float) -> Vector:
    """Random targets seen through three lags, with pauses."""
    dt = float(t[1] - t[0])
    wait, lag = between(rng, 0.5, 1.5), between(rng, 0.08, 0.25)
    targets = rng.uniform(-0.5, 0.5, int(t[-1] / wait) + 3)
    paused = rng.random(len(targets)) < 0.25
    targets[0] = 0.0
    for k in range(1, len(targets)):
        targets[k] = targets[k - 1] if paused[k] else targets[k]
    value = targets[(t / wait).astype(int)]
    share = 1.0 - math.exp(-dt / lag)
    for _ in range(3):
        value = lagged(value, share)
    return np.asarray(value)


def lagged(values: Vector, share: float) -> Vector:
    """Values through a first-order lag that covers this share of the error in a sample."""
    seen, last = np.empty_like(values), float(values[0])
    for k, value in enumerate(values):
        last += share * (value - last)
        seen[k] = last
    return seen


KINDS: dict[str, Callable[[Random, Vector, float], Vector]] = {
    "multisine": multisine,
    "steps": steps,
    "ramps": ramps,
    "teleoperation": teleoperation,
}


def episode(kind: str, rng: Random, t: Vector, middle: Vector, fastest_hz: Vector) -> Vector:
    """Commands of all joints at the times `t`, each around a pose of its own."""
    columns = []
    for centre, fastest in zip(middle, fastest_hz):
        pose = centre + between(rng, -0.3, 0.3)
        columns.append(pose + KINDS[kind](rng, t, float(fastest)))
    return np.stack(columns, axis=1)
