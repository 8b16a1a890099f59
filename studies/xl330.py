#!/usr/bin/env python3
"""A real servo: which effects does a model of a Dynamixel XL330 lack, and how far does the error fall with them?

    cargo build --release && BTR_DATA=FOLDER python3 studies/xl330.py [--keep runs/xl330]

The logs are `bam_xl330_pendulum` in the folder BTR_DATA, or `../shared/data` next to this project. The model is
`robots/xl330_model.toml`, a rigid pendulum and a DC motor. `diagnose` uses eight public logs at the position gains 100
and 800 for training and the four at gain 200 as held-out logs; `fit` learns from all twelve, and the four logs at gain
400 are the test logs. No command was recorded twice at the same gain, so nothing tells how well the servo repeats
itself. The table is that of `servo_bench.py`. Takes about two minutes on two cores. """

import csv
from pathlib import Path

from asking import ROOT, run
from servo_bench import DATA, Servo, follow

ASKED, CONFIRMING, UNSEEN = (100, 800), (200,), (400,)
MOST_EFFECTS = 6


def logs(gains: tuple[int, ...]) -> list[str]:
    """The logs at these position gains."""
    with open(DATA / "index.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["motor"] == "xl330" and int(row["kp"]) in gains]
    return [str(DATA / row["file"]) for row in rows]


def study(btr: str, folder: Path) -> None:
    parts = (logs(gains) for gains in (ASKED, CONFIRMING, UNSEEN))
    # An absolute path, so that models written to other folders find the index.
    index = ["--set", f'logs.index="{DATA / "index.csv"}"']
    follow(btr, Servo(str(ROOT / "robots" / "xl330_model.toml"), *parts, MOST_EFFECTS, index), folder)


if __name__ == "__main__":
    run(study, DATA, __doc__)
