#!/usr/bin/env python3
"""The paper's experiments literally, compared with btr's own settings for the same questions, seed by seed.

    cargo build --release && python3 studies/paper_side_by_side.py [--seeds 10] [--nao-seeds 10] [--out runs/by-side]

For each seed it runs `robots/ant-paper.toml` and `robots/ant.toml` and prints the largest error of any length at the
end, in percent of the truth; then `robots/nao-paper.toml` and the largest and the median error of its eight masses,
and those of the nominal masses at which its search starts. Median and range over the seeds are below each table. Runs
already in the output folder are read, not repeated. Needs only the standard library.
"""

import argparse
import pathlib
import statistics

from asking import BTR, ROOT, coevolved


def errors(out: pathlib.Path, experiment: str, seed: int, btr: str, when: str = "") -> list[float]:
    """A run's errors without sign in percent, at its end or (`when` is `_before`) its beginning.

    Starts the run if it does not exist yet."""
    run = coevolved(btr, out / f"{experiment}-{seed}", ROOT / "robots" / f"{experiment}.toml", seed)
    return [abs(error) for error in run["revealed"]["error_percent" + when].values()]


def table(title: str, columns: dict[str, list[float]]) -> None:
    """Columns of numbers over the seeds, with their medians and ranges below."""
    print(f"{title}\nseed | " + " | ".join(columns))
    for seed, row in enumerate(zip(*columns.values()), start=1):
        print(f"{seed:4} | " + " | ".join(f"{value:{len(name)}.2f}" for name, value in zip(columns, row)))
    for name, values in columns.items():
        print(f"{name}: median {statistics.median(values):.2f}, range {min(values):.2f} to {max(values):.2f}")
    print(flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--nao-seeds", type=int, default=10)
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "by-side")
    parser.add_argument("--btr", default=BTR)
    args = parser.parse_args()
    out = args.out.resolve()

    ants, naos = range(1, args.seeds + 1), range(1, args.nao_seeds + 1)
    if ants:
        worst = {name: [max(errors(out, name, seed, args.btr)) for seed in ants] for name in ("ant-paper", "ant")}
        table("worst error of the four lengths, %", worst)
    if naos:
        masses = {
            "nominal": [errors(out, "nao-paper", seed, args.btr, "_before") for seed in naos],
            "nao-paper": [errors(out, "nao-paper", seed, args.btr) for seed in naos],
        }
        for what, of in (("worst", max), ("median", statistics.median)):
            columns = {name: [of(each) for each in runs] for name, runs in masses.items()}
            table(f"{what} error of the eight masses, %", columns)


if __name__ == "__main__":
    main()
