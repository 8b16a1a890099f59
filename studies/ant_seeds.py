#!/usr/bin/env python3
"""Ten seeds of the ant: does it identify all four leg lengths, and does it beat evolution in reality alone?

    cargo build --release && python3 studies/ant_seeds.py [--seeds 10] [--out runs/ant-seeds]

For each seed it runs `robots/ant.toml` (phi_1, at most 180 real tests), the same genetic algorithm with 180 tests in
reality alone, and `robots/ant-series.toml` (time series and the disagreement rule, 12 real tests). Runs already in the
output folder are read, not repeated. Needs only the standard library.
"""

import argparse
import pathlib

from asking import BTR, ROOT, coevolved, heading_deg, simulated, worst_error

REALITY_ONLY = {"coevolve.method": "reality_only", "coevolve.iterations": "9"}
STRIDES_S = 1.98
"""Duration of a test of the ant: three strides."""


def tests_to(run: dict, percent: float) -> str:
    """Number of real tests after which all lengths stay within so many percent."""
    truth = run["revealed"]["parameters"]
    good = None
    for iteration in run["iterations"]:
        errors = [abs(100 * (value / truth[name] - 1)) for name, value in iteration["parameters"].items()]
        good = (good or iteration["real_tests"]) if max(errors) <= percent else None
    return str(good) if good else "-"


def course(folder: pathlib.Path, btr: str) -> tuple[float, float, float]:
    """A run's last gait in its final simulation, whose lengths are correct to a fraction of a percent: metres ahead and
    sideways, and heading in degrees."""
    last = simulated(btr, folder / "adapted.toml", folder / "gait.csv", STRIDES_S)[-1]
    return last["base_x"], last["base_y"], heading_deg(last)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "ant-seeds")
    parser.add_argument("--btr", default=BTR)
    args = parser.parse_args()
    out = args.out.resolve()
    print(
        "seed | phi_1: worst length %, real tests, to 2 % | fitness found, reality alone | "
        "ahead m, aside m, turned deg | series: worst %, tests, to 2 % | ahead m, aside m, turned deg"
    )
    within, fitter, series_within = 0, 0, 0
    for seed in range(1, args.seeds + 1):
        folders = [out / f"{name}-{seed}" for name in ("ant", "alone", "series")]
        files = [ROOT / "robots" / f"{name}.toml" for name in ("ant", "ant", "ant-series")]
        extras = [None, REALITY_ONLY, None]
        ant, alone, series = (coevolved(args.btr, *which, seed, extra) for *which, extra in zip(folders, files, extras))
        fitness, fitness_alone = (run["recommended"]["fitness_real"] for run in (ant, alone))
        within += worst_error(ant) <= 2.0
        fitter += fitness > fitness_alone
        series_within += worst_error(series) <= 2.0
        paths = ["{:.2f} {:+.2f} {:+5.1f}".format(*course(folder, args.btr)) for folder in (folders[0], folders[2])]
        print(
            f"{seed:4} | {worst_error(ant):8.2f} {ant['real_tests']:5} {tests_to(ant, 2.0):>5} | "
            f"{fitness:.3f} {fitness_alone:.3f} | {paths[0]} | "
            f"{worst_error(series):6.2f} {series['real_tests']:3} {tests_to(series, 2.0):>3} | {paths[1]}",
            flush=True,
        )
    print(f"all lengths within 2 %: {within}/{args.seeds} with phi_1, {series_within}/{args.seeds} with time series")
    print(f"fitter than reality alone with at least as many real tests: {fitter}/{args.seeds}")


if __name__ == "__main__":
    main()
