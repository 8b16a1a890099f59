#!/usr/bin/env python3
"""Damaged ants: the gait that a map of diverse gaits finds in at most 10 tests, compared with the best simulated gait
and with reality alone.

    cargo build --release && python3 studies/damaged.py [--seeds 10] [--first 1] [--out runs/damaged]

For each seed one or two legs of the hidden twin are limp (their motors have hardly any torque) or stuck (too much joint
friction to move). With the same damage it runs `robots/ant-damaged.toml`, CMA-ES in the undamaged simulation with as
many evaluations, whose best gait is tested once, and CMA-ES in reality alone with 10 tests. Runs already in the output
folder are read, not repeated. Needs only the standard library. """

from __future__ import annotations

import argparse
import pathlib
import random
import re
import statistics

from asking import BTR, ROOT, coevolved_text, seconds

LEGS = ("L1", "L2", "L3", "R1", "R2", "R3")
DAMAGES = {"limp": ("torque_limit", 0.05), "stuck": ("coulomb_friction", 3.0)}
"""Effect and torque in N·m; the ant's motors give 3."""
SEARCH = 'search = { algorithm = "cma_es", population = %d, restarts = 0 }'


def damaged(text: str, seed: int) -> tuple[str, str]:
    """An experiment with the damage of a seed, and the damage's name."""
    draw = random.Random(seed)
    kind, legs = draw.choice(sorted(DAMAGES)), sorted(draw.sample(LEGS, draw.choice((1, 2))))
    effect, torque = DAMAGES[kind]
    parts = ", ".join(f'{{ effect = "{effect}", site = "{leg}_*", torque = {torque} }}' for leg in legs)
    text, found = re.subn(r"(?m)^effects = .*$", f"effects = [{parts}]", text)
    if found != 1:
        raise SystemExit("the experiment's twin has no line `effects = [...]`")
    return text, f"{kind} {' '.join(legs)}"


def without_map(text: str, method: str, iterations: int, population: int, generations: int) -> str:
    """The same experiment as a search by CMA-ES, in simulation or in reality."""
    text = re.sub(r"(?s)\[coevolve\].*", "", text)
    tests = iterations * population if method == "reality_only" else 1
    return text + (
        f'[coevolve]\nmethod = "{method}"\niterations = {iterations}\nreal_tests = {min(tests, 10)}\n'
        'distance = "fitness"\n'
        f"transfer = {{ count = 1 }}\n[coevolve.controllers]\ngenerations = {generations}\n{SEARCH % population}\n"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--experiment", type=pathlib.Path, default=ROOT / "robots" / "ant-damaged.toml")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "damaged")
    parser.add_argument("--btr", default=BTR)
    args = parser.parse_args()
    out, text = args.out.resolve(), args.experiment.read_text()
    print(
        "seed | damage | best simulated: promised, real | map: promised, first test, best, tests | "
        "reality alone | within | s"
    )
    rows = []
    for seed in range(args.first, args.first + args.seeds):
        asked, damage = damaged(text, seed)
        history = coevolved_text(args.btr, out / f"map-{seed}", asked, seed)
        took_s = seconds(out / f"map-{seed}")
        evaluations = len(history["generations"]) * len(history["generations"][0]["scores"])
        simulated = without_map(asked, "back_to_reality", 1, 50, evaluations // 50)
        best = coevolved_text(args.btr, out / f"simulated-{seed}", simulated, seed)
        alone = coevolved_text(args.btr, out / f"alone-{seed}", without_map(asked, "reality_only", 1, 10, 1), seed)
        test, tests = best["tests"][0], history["tests"]
        real = [one["recommended"]["fitness_real"] for one in (history, alone)]
        within = history["reality_gap"]["within"]
        rows.append((test["promised"], best["recommended"]["fitness_real"], tests[0]["verdict"]["done"]["fitness"],
                     real[0], len(tests), real[1], *within, took_s))
        print(
            f"{seed:4} | {damage:14} | {rows[-1][0]:.3f} {rows[-1][1]:+.3f} | "
            f"{tests[0]['promised']:.3f} {rows[-1][2]:+.3f} "
            f"{real[0]:+.3f} {len(tests):2} | {real[1]:+.3f} | {within[0]}/{within[1]} | {took_s:.0f}",
            flush=True,
        )
    columns = list(zip(*rows))
    median = [statistics.median(column) for column in columns]
    print(f"median: best simulated {median[0]:.3f} promised, {median[1]:+.3f} real; first of the map {median[2]:+.3f}; "
          f"found {median[3]:+.3f} in {median[4]:.0f} tests; reality alone {median[5]:+.3f}")
    print(f"better than the best simulated gait: {sum(row[3] > row[1] for row in rows)} of {len(rows)}, "
          f"than reality alone: {sum(row[3] > row[5] for row in rows)}")
    print(
        f"promises within their interval: {sum(columns[6])} of {sum(columns[7])}; most seconds: {max(columns[8]):.0f}"
    )


if __name__ == "__main__":
    main()
