"""Glitches in recorded logs: what a failing encoder or a full bus does to readings."""

import csv
import math
from pathlib import Path

import numpy as np

KINDS = ("spike", "wrap-around", "zero", "stuck", "lost")
"""Any value for one sample; for one to three: off by a turn, zero, one joint's or all joints' readings repeated."""
RAILS = 3.0
"""A torque has no turns: it reads full scale instead, which is this many times the largest one in the log."""


def damage(path: Path, seed: int, share: float) -> dict[tuple[str, int], float]:
    """Replaces this share of each joint's readings, and of its torques', in a log; the channel, sample and size of
    every change."""
    rng = np.random.default_rng([seed, 7])
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    true = [row[:] for row in rows]
    positions = [column for column, name in enumerate(header) if name.startswith("q_")]
    torques = [column for column, name in enumerate(header) if name.startswith("tau_")]
    largest = {column: max(abs(float(row[column])) for row in rows) for column in torques}
    changed: dict[tuple[str, int], float] = {}
    taken: set[tuple[int, int]] = set()
    for column in positions + torques:
        left = round(share * len(rows))
        while left > 0:
            kind = KINDS[rng.integers(len(KINDS))]
            length = 1 if kind == "spike" else min(int(rng.integers(1, 4)), left)
            start = int(rng.integers(5, len(rows) - 8))
            columns = positions + torques if kind == "lost" else [column]
            near = {(c, k) for c in columns for k in range(start - 1, start + length + 1)}
            if near & taken:
                continue
            left -= length
            taken |= near
            for c in columns:
                for k in range(start, start + length):
                    reading = float(true[k][c])
                    sign, unit = rng.choice([-1.0, 1.0]), largest.get(c, 1.0)
                    wrong = {
                        "spike": reading + sign * unit * rng.uniform(0.3, 3.5),
                        "wrap-around": RAILS * sign * unit if c in largest else reading - math.tau,
                        "zero": 0.0,
                    }.get(kind, float(true[start - 1][c]))
                    rows[k][c] = repr(float(wrong))
                    changed[header[c], k] = float(abs(wrong - reading))
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])
    return changed
