#!/usr/bin/env python3
"""phi_2 of series that are shuffled, late, noisy, scaled or negated: the traps that docs/paper.md names.

    python3 studies/phi_2_traps.py [WALK.csv]

d(X, Y) = H(X|Y) + H(Y|X) in bits (equation 5 of the paper), at N = 4024 samples, with 16 equal bins across the range of
both series, as in btr's distance `information`. Each row is a signal X; Y is X shuffled (as good as
independent), X one sample late, X with Gaussian noise of 1 % of X's standard deviation or of its range, 1.5 X, X with
an offset of a tenth of its range, and -X. The last block has separate bins for each series. `btr simulate
robots/nao-paper.toml -o WALK.csv` writes the walk; without it only made-up signals are shown. Needs NumPy.
"""

import csv
import pathlib
import sys

import numpy as np

SAMPLES = 4024
BINS = 16
# The paper's physics step, in s.
STEP_S = 0.055 / 7
JOINTS = ("q_LHipPitch", "q_LKneePitch", "q_LAnkleRoll", "q_LShoulderPitch")


def symbols(series: np.ndarray, low: float, high: float) -> np.ndarray:
    """The bin of each sample, of `BINS` equal ones between `low` and `high`, the last one closed."""
    return np.minimum(((series - low) * BINS / (high - low)).astype(int), BINS - 1)


def entropy(shares: np.ndarray) -> float:
    """Entropy in bits of probabilities that sum to one."""
    shares = shares[shares > 0]
    return float(-(shares * np.log2(shares)).sum())


def distance(x: np.ndarray, y: np.ndarray, shared: bool = True) -> float:
    """d(X, Y) in bits, with common or separate bins."""
    spans = [(series.min(), series.max()) for series in (x, y)]
    if shared:
        spans = [(min(low for low, _ in spans), max(high for _, high in spans))] * 2
    joint = np.zeros((BINS, BINS))
    np.add.at(joint, (symbols(x, *spans[0]), symbols(y, *spans[1])), 1 / len(x))
    return 2 * entropy(joint) - entropy(joint.sum(axis=0)) - entropy(joint.sum(axis=1))


def made_up(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Signals of `SAMPLES` samples and one more for the delay."""
    time_s = np.arange(SAMPLES + 1) * STEP_S
    hertz, phases = (0.3, 0.7, 1.1, 1.9, 3.1), rng.uniform(0, 2 * np.pi, 5)
    return {
        "uniform white noise": rng.uniform(-1, 1, SAMPLES + 1),
        "Gaussian white noise": rng.normal(size=SAMPLES + 1),
        "sine, 1 Hz": np.sin(2 * np.pi * time_s),
        "five sines, 0.3 to 3.1 Hz": sum(np.sin(2 * np.pi * f * time_s + phase) for f, phase in zip(hertz, phases)),
        "random walk": np.cumsum(rng.normal(size=SAMPLES + 1)),
    }


def recorded(path: pathlib.Path) -> dict[str, np.ndarray]:
    """Some joints of a recorded walk; its last sample is used for the delay."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {f"walk, {joint}": np.array([float(row[joint]) for row in rows]) for joint in JOINTS}


def table(walk: pathlib.Path | None) -> dict[str, tuple[list[float], list[float]]]:
    """Row by row: bits for shuffled, late, 1 % std, 1 % range, x 1.5, offset, -x; and the last three with bins of their
    own."""
    rng = np.random.default_rng(1)
    signals = made_up(rng) | (recorded(walk) if walk else {})
    rows = {}
    for name, series in signals.items():
        x, late, span = series[1:], series[:-1], np.ptp(series)
        noise = rng.normal(size=len(x))
        noisy = [x + 0.01 * size * noise for size in (x.std(), span)]
        moved = [1.5 * x, x + 0.1 * span, -x]
        told = [distance(x, y) for y in (rng.permutation(x), late, *noisy, *moved)]
        rows[name] = told, [distance(x, y, shared=False) for y in moved]
    return rows


def main() -> None:
    heads = "shuffled |  late | 1 % std | 1 % range | x 1.5 | offset |   -x | own: x 1.5, offset, -x"
    print(f"{'signal':25} | {heads}")
    for name, (told, own) in table(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else None).items():
        row = " | ".join(f"{bits:{width}.2f}" for bits, width in zip(told, (8, 5, 7, 9, 5, 6, 4)))
        print(f"{name:25} | {row} | {own[0]:.2f}, {own[1]:.2f}, {own[2]:.2f}")


if __name__ == "__main__":
    main()
