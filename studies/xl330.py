#!/usr/bin/env python3
"""A real servo: which effects does a model of a Dynamixel XL330 lack, and how far does the error fall with them?

    cargo build --release && python3 studies/xl330.py [--keep runs/xl330]

The model is `robots/xl330_model.toml`, a rigid pendulum and a DC motor. `diagnose` uses eight public logs at the
position gains 100 and 800 for training and the four at gain 200 as held-out logs; it names effects one after the other,
and drops those that later ones make superfluous. Each of its steps is a row of the table: `btr add` writes the effects
named so far into the model, `btr fit` fits it to all twelve logs, and the four logs at gain 400 are the test logs. The
columns are root mean square errors in multiples of the encoder's noise floor, as btr reports them, and mean absolute
errors in rad of `btr simulate` on the logs, averaged over the logs. Takes about two minutes on two cores. """

import bisect
import csv
from pathlib import Path

from asking import LOGS_OF_MACHINES, ROOT, ask, run

DATA = LOGS_OF_MACHINES / "bam_xl330_pendulum"
MODEL = ROOT / "robots" / "xl330_model.toml"
ASKED, CONFIRMING, UNSEEN = (100, 800), (200,), (400,)
MOST_EFFECTS = 6


def logs(gains: tuple[int, ...]) -> list[str]:
    """The logs at these position gains."""
    with open(DATA / "index.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["motor"] == "xl330" and int(row["kp"]) in gains]
    return [str(DATA / row["file"]) for row in rows]


# An absolute path, so that models written to other folders find the index.
INDEX = ["--set", f'logs.index="{DATA / "index.csv"}"']


def column(path: str, time: str, name: str) -> tuple[list[float], list[float]]:
    """Time since the start of the log, and a column of a CSV file."""
    with open(path, newline="") as file:
        rows = [(float(row[time]), float(row[name])) for row in csv.DictReader(file)]
    return [t - rows[0][0] for t, _ in rows], [x for _, x in rows]


def mean_error(btr: str, model: str, log: str, folder: Path) -> float:
    """Mean absolute error of a simulation with the log's commands, in rad."""
    simulated = str(folder / "simulated.csv")
    ask(btr, "simulate", *INDEX, model, "--log", log, "-o", simulated, "--overwrite")
    clock, said = column(simulated, "t", "q_hinge")
    times, measured = column(log, "t_s", "q_rad")
    errors = []
    for t, q in zip(times, measured):
        i = min(max(bisect.bisect_right(clock, t), 1), len(clock) - 1)
        share = min((t - clock[i - 1]) / (clock[i] - clock[i - 1]), 1.0)
        errors.append(abs(q - (said[i - 1] + share * (said[i] - said[i - 1]))))
    return sum(errors) / len(errors)


def mean_errors(btr: str, model: str, folder: Path) -> tuple[float, float, dict[str, float]]:
    """Mean absolute errors of the training logs and of the test logs, and of each test log."""
    errors = [
        {log: mean_error(btr, model, log, folder) for log in logs(gains)} for gains in (ASKED + CONFIRMING, UNSEEN)
    ]
    learnt, judged = (sum(part.values()) / len(part) for part in errors)
    return learnt, judged, {Path(log).stem: error for log, error in errors[1].items()}


class Ladder:
    """Prints one row per step."""

    def __init__(self, btr: str, folder: Path) -> None:
        self.btr, self.folder = btr, folder
        print(f"{'':<42}{'x noise floor':^20}{'mean abs. error, rad':^24}")
        print(f"{'step':<42}{'learnt':>10}{'unseen':>10}{'learnt':>12}{'unseen':>12}", flush=True)

    def line(self, step: str, train: float, held_out: float, model: str) -> dict[str, float]:
        learnt, judged, each = mean_errors(self.btr, model, self.folder)
        print(f"{step:<42}{train:10.1f}{held_out:10.1f}{learnt:12.4f}{judged:12.4f}", flush=True)
        return each

    def fitted(self, step: str, model: str, name: str) -> tuple[dict, dict[str, float]]:
        """Fits a model and prints its line."""
        out = str(self.folder / name)
        said = ask(self.btr, "fit", *INDEX, model, *logs(ASKED + CONFIRMING), "--held-out", *logs(UNSEEN), "-o", out)
        if step.startswith("rigid"):
            first = said["error_ladder"][0]
            self.line("data sheet", first["train"], first["held_out"], model)
        return said, self.line(step, said["train"], said["held_out"], out)


def ladder_steps(answer: dict) -> list[tuple[str, list[str]]]:
    """The steps of a diagnosis, with the effects in the model after each."""
    present, found = [], []
    for step in (step["step"] for step in answer["error_ladder"]):
        sign, name = step[:2], step[2:]
        if sign == "+ ":
            present = [*present, name]
        elif sign == "- ":
            present = [other for other in present if other != name]
        else:
            continue
        found.append((step, present))
    return found


def study(btr: str, folder: Path) -> None:
    ladder = Ladder(btr, folder)
    said, each = ladder.fitted("rigid body and motor, fitted", str(MODEL), "rigid.toml")
    asked = [*logs(ASKED), "--held-out", *logs(CONFIRMING), "--max-effects", str(MOST_EFFECTS)]
    answer = ask(btr, "diagnose", *INDEX, str(MODEL), *asked)
    for k, (step, effects) in enumerate(ladder_steps(answer)):
        added = str(folder / f"added{k + 1}.toml")
        ask(btr, "add", *INDEX, str(MODEL), *effects, "-o", added)
        said, each = ladder.fitted(step, added, f"fitted{k + 1}.toml")
    print(f"\ndiagnose: {answer['verdict']}, {answer['rollouts']} rollouts in {answer['seconds']:.0f} s")
    for effect in answer["effects"]:
        print(f"  {effect['effect']:<36} alike: {', '.join(effect['alike']) or '-'}")
    print("fitted last:")
    for parameter in said["parameters"]:
        print(f"  {parameter['name']:<48}{parameter['value']:10.4g} {parameter['unit']}")
    print("mean absolute errors on the unseen gain, rad:")
    for log, error in each.items():
        print(f"  {log:<36}{error:8.4f}")


if __name__ == "__main__":
    run(study, DATA, __doc__)
