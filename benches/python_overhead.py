#!/usr/bin/env python3
"""Overhead of Python on a population of rollouts: the same rollouts from Rust and from Python, in alternation.

    cargo build --release -p btr-lab --example rollouts && pip install .
    python benches/python_overhead.py [--candidates 64] [--rounds 12]

Prints medians of rounds of ten, and the median of the ratios of neighbouring rounds.
"""

import argparse
import statistics
import subprocess
import time
from pathlib import Path

import btr

ROOT = Path(__file__).parents[1]
RUST = ROOT / "target" / "release" / "examples" / "rollouts"
OF_A_ROUND = 10


def from_rust(path: Path, candidates: int) -> float:
    run = subprocess.run([RUST, path, str(candidates), str(OF_A_ROUND)], capture_output=True, text=True, check=True)
    return statistics.median(map(float, run.stdout.split()))


def from_python(model: btr.Model, candidates: int) -> float:
    nominal = [[p["nominal"] for p in model.parameters]] * candidates
    seconds = []
    for _ in range(OF_A_ROUND):
        began = time.perf_counter()
        logs = model.simulate_all(nominal)
        seconds.append(time.perf_counter() - began)
        assert None not in logs
        # As in Rust, the time to free the logs is not counted.
        del logs
    return statistics.median(seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--candidates", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=12)
    args = parser.parse_args()
    for name in ("nao", "pendulum"):
        path = ROOT / "robots" / f"{name}.toml"
        model, rust, python = btr.load_model(path), [], []
        for _ in range(args.rounds):
            rust.append(from_rust(path, args.candidates))
            python.append(from_python(model, args.candidates))
        ratio = statistics.median(p / r for p, r in zip(python, rust))
        medians = f"Rust {1e3 * statistics.median(rust):.2f} ms, Python {1e3 * statistics.median(python):.2f} ms"
        best = f"{min(rust) * 1e3:.2f} and {min(python) * 1e3:.2f} at best"
        print(f"{name}: {args.candidates} rollouts: {medians}; ratio {ratio:.3f} ({best})")


if __name__ == "__main__":
    main()
