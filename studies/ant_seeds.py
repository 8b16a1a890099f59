#!/usr/bin/env python3
"""Ten seeds of the ant: does it find all four leg lengths, and does it beat evolution in reality alone?

    cargo build --release && python3 studies/ant_seeds.py [--seeds 10] [--out runs/ant-seeds]

For each seed it runs `robots/ant.toml` (phi_1, at most 180 real tests), the same genetic algorithm spending 180 tests in
reality alone, and `robots/ant-series.toml` (time series and the disagreement rule, 12 real tests). Runs that are in the
output folder already are read, not repeated. Needs nothing but the standard library.
"""

import argparse
import json
import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent
REALITY_ONLY = ["--set", "coevolve.method=reality_only", "--set", "coevolve.iterations=9"]


def history(out: pathlib.Path, name: str, experiment: str, seed: int, btr: str, extra: list[str]) -> dict:
    """The history of a run, which is made first where it is not there yet."""
    folder = out / f"{name}-{seed}"
    if not (folder / "history.json").exists():
        resume = ["--resume"] if (folder / "checkpoint.bin").exists() else []
        command = [btr, "coevolve", f"robots/{experiment}.toml", "--quiet", "--seed", str(seed), "--out", str(folder)]
        subprocess.run(command + extra + resume, cwd=ROOT, stdout=subprocess.DEVNULL, check=True)
    return json.loads((folder / "history.json").read_text())


def worst_error(run: dict) -> float:
    """The largest error of any length, in percent."""
    return max(abs(error) for error in run["revealed"]["error_percent"].values())


def tests_to(run: dict, percent: float) -> str:
    """Real tests after which all lengths are and stay within so many percent."""
    truth = run["revealed"]["parameters"]
    good = None
    for iteration in run["iterations"]:
        errors = [abs(100 * (value / truth[name] - 1)) for name, value in iteration["parameters"].items()]
        good = (good or iteration["real_tests"]) if max(errors) <= percent else None
    return str(good) if good else "-"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "ant-seeds")
    parser.add_argument("--btr", default=str(ROOT / "target" / "release" / "btr"))
    args = parser.parse_args()
    out = args.out.resolve()
    print("seed | phi_1: worst length %, real tests, to 2 % | m/s found, reality alone | series: worst %, tests, to 2 %")
    within, faster, series_within = 0, 0, 0
    for seed in range(1, args.seeds + 1):
        ant = history(out, "ant", "ant", seed, args.btr, [])
        alone = history(out, "alone", "ant", seed, args.btr, REALITY_ONLY)
        series = history(out, "series", "ant-series", seed, args.btr, [])
        speed, speed_alone = (run["recommended"]["fitness_real"] for run in (ant, alone))
        within += worst_error(ant) <= 2.0
        faster += speed > speed_alone
        series_within += worst_error(series) <= 2.0
        print(
            f"{seed:4} | {worst_error(ant):8.2f} {ant['real_tests']:5} {tests_to(ant, 2.0):>5}"
            f" | {speed:.3f} {speed_alone:.3f} | {worst_error(series):6.2f} {series['real_tests']:3} {tests_to(series, 2.0):>3}",
            flush=True,
        )
    print(f"all lengths within 2 %: {within}/{args.seeds} with phi_1, {series_within}/{args.seeds} with time series")
    print(f"faster than reality alone with at least as many real tests: {faster}/{args.seeds}")


if __name__ == "__main__":
    main()
