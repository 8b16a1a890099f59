"""Glitches in recorded logs: what a failing encoder or a full bus does to readings."""

import csv
import math
from pathlib import Path

import numpy as np

KINDS = ("spike", "wrap-around", "zero", "stuck", "lost")
"""Any value for one sample; for one to three: off by a turn, zero, one joint's or all joints' readings repeated."""


def damage(path: Path, seed: int, share: float) -> dict[tuple[str, int], float]:
    """Replaces this share of each joint's readings in a log; the channel, sample and size of every change."""
    rng = np.random.default_rng([seed, 7])
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    true = [row[:] for row in rows]
    positions = [column for column, name in enumerate(header) if name.startswith("q_")]
    changed: dict[tuple[str, int], float] = {}
    taken: set[tuple[int, int]] = set()
    for column in positions:
        left = round(share * len(rows))
        while left > 0:
            kind = KINDS[rng.integers(len(KINDS))]
            length = 1 if kind == "spike" else min(int(rng.integers(1, 4)), left)
            start = int(rng.integers(5, len(rows) - 8))
            columns = positions if kind == "lost" else [column]
            near = {(c, k) for c in columns for k in range(start - 1, start + length + 1)}
            if near & taken:
                continue
            left -= length
            taken |= near
            for c in columns:
                for k in range(start, start + length):
                    reading = float(true[k][c])
                    wrong = {
                        "spike": reading + rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 3.5),
                        "wrap-around": reading - math.tau,
                        "zero": 0.0,
                    }.get(kind, float(true[start - 1][c]))
                    rows[k][c] = repr(float(wrong))
                    changed[header[c], k] = float(abs(wrong - reading))
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])
    return changed
