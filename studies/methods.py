#!/usr/bin/env python3
"""Compares methods at equal numbers of real tests: fitness of the best controller and accuracy of the model.

    cargo build --release && python3 studies/methods.py [--seeds 10] [--tests 12] [--figure docs/methods.svg]

Each method runs the experiment of `robots/ant-series.toml`, once per seed: a straight and fast gait for an ant of which
four lengths are unknown within ±50 %, with noisy sensors. All have the same number of real tests. It prints medians and
quartiles over the seeds and draws the best real fitness over the number of real tests. Runs already in the output
folder are read, not repeated. Needs only the standard library. """

from __future__ import annotations

import argparse
import itertools
import math
import pathlib

from asking import BTR, ROOT, coevolved, quartiles, worst_error

EXPERIMENT = ROOT / "robots" / "ant-series.toml"
NOISE = (
    "{ position_rad = 0.0005, velocity_rad_s = 0.02, torque_n_m = 0.05, "
    "gyro_rad_s = 0.01, acceleration_m_s2 = 0.1, force_n = 0.5 }"
)
SWINGS = ", ".join(f'"amplitude@{side}{row}_*" = [0.0, 0.4]' for side in "LR" for row in "123")

# Settings of each method, by dotted keys of the experiment; {tests} is the number of real tests.
METHODS: dict[str, dict[str, str]] = {
    "Back-to-Reality": {"iterations": "{tests}", "transfer.count": "1"},
    "Back-to-Reality with a posterior": {
        "iterations": "{tests}",
        "transfer": '{ rule = "informative", count = 1 }',
        "distance": '"whitened"',
        "posterior": "{ samples = 3 }",
    },
    "estimation-exploration": {"iterations": "{tests}", "transfer.count": "1", "method": '"estimation_exploration"'},
    "linear correction": {"iterations": "{tests}", "transfer.count": "1", "method": '"linear_correction"'},
    "quality diversity": {
        "iterations": "{tests}",
        "method": '"quality_diversity"',
        "map": f"{{ enough = 1.0, cells = 2, generations = 100, population = 100, descriptors = {{ {SWINGS} }} }}",
    },
    "reality alone": {
        "iterations": "{tests}",
        "method": '"reality_only"',
        "controllers.search": '{ algorithm = "cma_es", population = 4, restarts = 0 }',
    },
}


def best_after_each_test(run: dict, tests: int) -> list[float]:
    """The best real fitness after the first, second, ... real test; failed tests and tests that a method did not
    request do not change it."""
    done = [entry["verdict"].get("done", {}).get("fitness") for entry in run["tests"]][:tests]
    best = list(itertools.accumulate((float("-inf") if f is None else f for f in done), max))
    return best + best[-1:] * (tests - len(best))


def row(name: str, runs: list[dict], tests: int) -> str:
    """Medians with their quartiles, for a table."""
    fitness = quartiles([best_after_each_test(run, tests)[-1] for run in runs])
    done = quartiles([run["real_tests"] for run in runs])[1]
    cells = [f"{done:.0f}", f"{fitness[1]:.3f} ({fitness[0]:.3f} to {fitness[2]:.3f})"]
    # The other methods do not change the model.
    if name.startswith(("Back", "estimation")):
        error = quartiles([worst_error(run) for run in runs])
        cells.append(f"{error[1]:.1f} ({error[0]:.1f} to {error[2]:.1f})")
    else:
        cells.append("-")
    return f"| {name} | {' | '.join(cells)} |"


COLOURS = ("#1f5fa8", "#c0392b", "#7d8a1e", "#8e5aa8", "#c98b1b", "#555555")
LEFT, TOP, WIDTH, HEIGHT = 62.0, 30.0, 520.0, 330.0


def draw(curves: dict[str, list[tuple[float, float, float]]], file: pathlib.Path) -> None:
    """The best real fitness over the number of real tests: a line for the median, a band between the quartiles."""
    tests = max(map(len, curves.values()))
    numbers = [value for curve in curves.values() for quartile in curve for value in quartile]
    least, most = min(numbers), max(numbers) + 0.02
    x = lambda test: LEFT + WIDTH * (test - 1) / max(tests - 1, 1)
    y = lambda value: TOP + HEIGHT * (most - value) / (most - least or 1.0)
    path = lambda points: " ".join(f"{a:.1f},{b:.1f}" for a, b in points)
    parts = [f'<text x="{LEFT}" y="18">best fitness in reality: median and quartiles</text>']
    for value in (k / 10 for k in range(math.ceil(10 * least), math.floor(10 * most) + 1)):
        parts.append(
            f'<line x1="{LEFT}" x2="{LEFT + WIDTH}" y1="{y(value):.1f}" y2="{y(value):.1f}" stroke="#e4e4e4"/>'
        )
        parts.append(f'<text x="{LEFT - 8}" y="{y(value) + 4:.1f}" text-anchor="end">{value:.1f}</text>')
    for test in range(1, tests + 1):
        parts.append(f'<text x="{x(test):.1f}" y="{TOP + HEIGHT + 20}" text-anchor="middle">{test}</text>')
    parts.append(f'<text x="{LEFT + WIDTH / 2}" y="{TOP + HEIGHT + 40}" text-anchor="middle">real tests</text>')
    for (name, curve), colour in zip(curves.items(), COLOURS):
        band = [(x(k), y(q[0])) for k, q in enumerate(curve, 1)] + [
            (x(k), y(q[2])) for k, q in reversed(list(enumerate(curve, 1)))
        ]
        parts.append(f'<polygon points="{path(band)}" fill="{colour}" opacity="0.12"/>')
    for number, ((name, curve), colour) in enumerate(zip(curves.items(), COLOURS)):
        middle = [(x(k), y(q[1])) for k, q in enumerate(curve, 1)]
        parts.append(f'<polyline points="{path(middle)}" fill="none" stroke="{colour}" stroke-width="2"/>')
        at = TOP + 12 + 20 * number
        parts.append(
            f'<line x1="{LEFT + WIDTH + 16}" x2="{LEFT + WIDTH + 40}" y1="{at}" y2="{at}" '
            f'stroke="{colour}" stroke-width="3"/>'
        )
        parts.append(f'<text x="{LEFT + WIDTH + 46}" y="{at + 4}">{name}</text>')
    frame = 'width="870" height="420" viewBox="0 0 870 420" font-family="sans-serif" font-size="13" fill="#333"'
    body = '<rect width="870" height="420" fill="white"/>' + "".join(parts)
    file.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {frame}>{body}</svg>\n')
    print(f"figure: {file}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--tests", type=int, default=12)
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "methods")
    parser.add_argument("--figure", type=pathlib.Path)
    parser.add_argument("--btr", default=BTR)
    args = parser.parse_args()
    print("| method | real tests | best fitness in reality | worst length, % |\n|---|---|---|---|")
    curves = {}
    for name, changes in METHODS.items():
        settings = {f"coevolve.{key}": value.replace("{tests}", str(args.tests)) for key, value in changes.items()}
        settings |= {"coevolve.real_tests": str(args.tests), "noise": NOISE, "reality.noise": NOISE}
        # No method stops as disengaged: all use the same number of tests.
        settings["coevolve.disengagement"] = "{ stop = false }"
        folder = lambda seed: args.out.resolve() / f"{name.replace(' ', '-').lower()}-{seed}"
        seeds = range(args.first, args.first + args.seeds)
        runs = [coevolved(args.btr, folder(seed), EXPERIMENT, seed, settings) for seed in seeds]
        print(row(name, runs, args.tests), flush=True)
        curves[name] = [quartiles(list(at)) for at in zip(*(best_after_each_test(run, args.tests) for run in runs))]
    if args.figure:
        draw(curves, args.figure)


if __name__ == "__main__":
    main()
