#!/usr/bin/env python3
"""Measures again the numbers that the book (docs/) claims.

    cargo build --release && python3 studies/claims.py [--all] [--out runs/claims]

Each claim consists of a text in a file, a command, the claimed number and the measured number. A claim is off if its
text is no longer in the file, or if the measured number differs from the claimed one by more than its tolerance.
Without --all only claims that take seconds are measured. Claims that need other programs, data that is not part of this
project, or a quiet machine are listed with their command. Exits with code 1 if a claim is off. Needs NumPy. """

from __future__ import annotations

import argparse
import functools
import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import phi_2_traps
from ant_seeds import tests_to
from asking import BTR, ROOT, ask, coevolved, quartiles, seconds, worst_error

LEARN = [str(log) for log in sorted((ROOT / "robots" / "arm").glob("learn_*.csv"))]
HELD_OUT = [str(log) for log in sorted((ROOT / "robots" / "arm").glob("held_out_*.csv"))]
TEN = range(1, 11)


class Measurements:
    """Measurements of claims; results that several claims need are computed once."""

    def __init__(self, btr: str, out: Path) -> None:
        self.btr, self.out = btr, out

    @functools.cached_property
    def arm(self) -> dict:
        """The desk arm's diagnosis."""
        return ask(self.btr, "diagnose", str(ROOT / "robots" / "arm.toml"), *LEARN, "--held-out", *HELD_OUT)

    def run(self, experiment: str, seed: int = 1) -> dict:
        """The history of an experiment's run."""
        return coevolved(self.btr, self.out / f"{experiment}-{seed}", ROOT / "robots" / f"{experiment}.toml", seed)

    def took_s(self, experiment: str) -> float:
        """Duration of the first seed's run."""
        self.run(experiment)
        return seconds(self.out / f"{experiment}-1")

    def worst(self, experiment: str) -> list[float]:
        """The worst parameter's error over ten seeds, in percent."""
        return [worst_error(self.run(experiment, seed)) for seed in TEN]

    def tests_to_two_percent(self, experiment: str) -> list[float]:
        """Numbers of real tests after which all lengths stay within 2 %, over ten seeds."""
        return [float(tests_to(self.run(experiment, seed), 2.0).replace("-", "inf")) for seed in TEN]

    @functools.cached_property
    def walk(self) -> Path:
        """The recorded walk of the Nao as a file, and its number of samples."""
        self.out.mkdir(parents=True, exist_ok=True)
        log = self.out / "walk.csv"
        model = str(ROOT / "robots" / "nao-paper.toml")
        self.samples = ask(self.btr, "simulate", model, "-o", str(log), "--overwrite")["samples"]
        return log

    @functools.cached_property
    def traps(self) -> dict[str, tuple[list[float], list[float]]]:
        """The table of phi_2's traps, row by row."""
        return phi_2_traps.table(self.walk)


@dataclass
class Claim:
    """A number in a file. `text` occurs there literally; `tolerance` is in the unit of the number."""

    file: str
    text: str
    command: str
    claimed: float
    measure: Callable[[Measurements], float]
    tolerance: float
    slow: bool = False


@dataclass
class ByHand:
    """A number that this script does not measure, and the reason."""

    file: str
    text: str
    command: str
    why: str


def ladder(step: int, key: str) -> Callable[[Measurements], float]:
    """An error of the ladder of the desk arm's diagnosis, in noise floors."""
    return lambda study: study.arm["error_ladder"][step][key]


def trap(row: str, column: int) -> Callable[[Measurements], float]:
    """A number of the table of phi_2's traps, in bits."""
    return lambda study: study.traps[row][0][column]


DIAGNOSE = "btr diagnose robots/arm.toml robots/arm/learn_*.csv --held-out robots/arm/held_out_*.csv"
LADDER = (
    ("model as it stands                      20.44     21.31", 20.44, 21.31, 0.005, 0.005),
    ("its parameters fitted                   7.187     8.376", 7.187, 8.376, 0.0005, 0.0005),
    ("+ coulomb_friction@yaw                  1.021    0.9951", 1.021, 0.9951, 0.0005, 0.00005),
)
TRAPS = "python3 studies/phi_2_traps.py WALK.csv"
ANTS = "btr coevolve robots/ant.toml, seeds 1 to 10"
SIDE = "python3 studies/paper_side_by_side.py"

CLAIMS = [
    claim
    for step, (text, train, held_out, near, nearer) in enumerate(LADDER)
    for claim in (
        Claim("docs/tutorial.md", text, DIAGNOSE, train, ladder(step, "train"), near),
        Claim("docs/tutorial.md", text, DIAGNOSE, held_out, ladder(step, "held_out"), nearer),
    )
] + [
    Claim("docs/reference/experiments.md", "12 real tests instead of 156", "btr coevolve robots/ant-series.toml",
          12, lambda study: study.run("ant-series")["real_tests"], 0),
    Claim("docs/reference/experiments.md", "12 real tests instead of 156", "btr coevolve robots/ant.toml",
          156, lambda study: study.run("ant")["real_tests"], 0),
    Claim("docs/howto/coevolve.md", "real tests determine eight masses to 1 or 2 %", "btr coevolve robots/nao.toml",
          1.0, lambda study: worst_error(study.run("nao")), 1.0),
    Claim("docs/paper.md", "N = 4024", "btr simulate robots/nao-paper.toml -o WALK.csv", 4024,
          lambda study: (study.walk, study.samples)[1], 0),
    Claim("docs/paper.md", "| uniform white noise | 7.9 |", TRAPS, 7.9, trap("uniform white noise", 0), 0.05),
    Claim("docs/paper.md", "| uniform white noise | 7.9 | 7.9 | 0.46 |", TRAPS, 0.46,
          trap("uniform white noise", 2), 0.005),
    Claim("docs/paper.md", "| sine, 1 Hz | 7.5 | 1.8 |", TRAPS, 1.8, trap("sine, 1 Hz", 1), 0.05),
    Claim("docs/paper.md", "| left knee of the walk | 6.2 | 1.6 |", TRAPS, 1.6, trap("walk, q_LKneePitch", 1), 0.05),
    Claim("robots/nao.toml", "less than half a minute on two cores", "btr coevolve robots/nao.toml", 15,
          lambda study: study.took_s("nao"), 15),
    Claim("docs/howto/index.md", "lengths within 2 % after 24 to 60 real tests", ANTS,
          24, lambda study: min(study.tests_to_two_percent("ant")), 0, slow=True),
    Claim("docs/howto/index.md", "lengths within 2 % after 24 to 60 real tests", ANTS,
          60, lambda study: max(study.tests_to_two_percent("ant")), 0, slow=True),
    Claim("docs/paper.md", "| | `ant.toml` | 0.10 % |", SIDE, 0.10,
          lambda study: quartiles(study.worst("ant"))[1], 0.005, slow=True),
    Claim("docs/paper.md", "`ant-paper.toml` | 2.12 % |", SIDE, 2.12,
          lambda study: statistics.median(study.worst("ant-paper")), 0.005, slow=True),
]  # fmt: skip

BY_HAND = [
    ByHand("docs/howto/walking.md", "15 of 16", "hidden_effects --robot nao", "half an hour"),
    ByHand(
        "docs/reference/studies.md",
        "| the Nao's walk | 3.1 µs |",
        "python3 benches/beside_mujoco.py",
        "MuJoCo and a quiet machine",
    ),
    ByHand("docs/reference/studies.md", "7 ms from CSV", "python3 benches/python_load.py", "a quiet machine"),
    ByHand("docs/reference/studies.md", "0.18 rad, then 0.04", "python3 studies/xl330.py", "public logs"),
    ByHand("docs/posterior.md", "386 of 400", "python3 studies/nao_seeds.py --seeds 50 --first 701", "half an hour"),
    ByHand(
        "docs/posterior.md",
        "within 20° for 41 of 48",
        "python3 studies/walks.py --seeds 50 --first 701",
        "after those runs",
    ),
    ByHand(
        "docs/posterior.md",
        "| 7 of 7 |",
        "python3 studies/nao_seeds.py --outside --seeds 20 --first 1101",
        "half an hour",
    ),
    ByHand(
        "docs/posterior.md",
        "After two to five tests",
        "python3 studies/nao_seeds.py --drift --seeds 10 --first 921",
        "ten minutes",
    ),
    ByHand(
        "docs/paper.md",
        "0.360 (0.310 to 0.376)",
        "python3 studies/methods.py --figure docs/methods.svg",
        "a quarter of an hour",
    ),
    ByHand("docs/scaling.md", "153 batches", "python3 benches/scaling.py", "Ray and a quiet machine"),
]


def judge(claim: Claim, study: Measurements) -> tuple[str, bool]:
    """The measured value, and whether the claim holds."""
    if claim.text not in (ROOT / claim.file).read_text():
        return "not in the file", False
    measured = claim.measure(study)
    return f"{measured:.6g}", abs(measured - claim.claimed) <= claim.tolerance * (1 + 1e-9)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true", help="also measure claims that take minutes")
    parser.add_argument("--out", type=Path, default=ROOT / "runs" / "claims")
    parser.add_argument("--btr", default=BTR)
    args = parser.parse_args()
    study = Measurements(args.btr, args.out.resolve())
    print("| claim | file | command | claimed | measured | |\n|---|---|---|---|---|---|")
    off = 0
    for claim in (claim for claim in CLAIMS if args.all or not claim.slow):
        measured, holds = judge(claim, study)
        off += not holds
        text = " ".join(claim.text.replace("|", " ").split())
        verdict = "ok" if holds else "off"
        print(f"| {text} | {claim.file} | `{claim.command}` | {claim.claimed:g} | {measured} | {verdict} |", flush=True)
    for claim in BY_HAND:
        there = claim.text in (ROOT / claim.file).read_text()
        off += not there
        verdict = f"by hand: {claim.why}" if there else "off: not in the file"
        print(f"| {claim.text} | {claim.file} | `{claim.command}` | | | {verdict} |")
    print(f"\n{off} off")
    sys.exit(1 if off else 0)


if __name__ == "__main__":
    main()
