"""A servo that swings a pendulum, and the logs of its bench: the studies `xl330.py` and `sts3250.py`.

`diagnose` names effects one after the other, and drops those that later ones make superfluous. Each of its steps is a
row of the table: `btr add` writes the effects named so far into the model, `btr fit` fits it to all logs but the
unseen ones. The columns are root mean square errors in multiples of the encoder's noise floor, as btr reports them,
and mean absolute errors in rad of `btr simulate` on the logs, averaged over the logs. """

import bisect
import csv
from dataclasses import dataclass, field
from pathlib import Path

from asking import LOGS_OF_MACHINES, ask, remaining

DATA = LOGS_OF_MACHINES / "bam_xl330_pendulum"


@dataclass
class Servo:
    """A servo's model and its logs: those to learn from, those that confirm findings, those that judge."""

    model: str
    asked: list[str]
    confirming: list[str]
    unseen: list[str]
    most_effects: int
    # Words for every call of btr, such as settings of the model.
    settings: list[str] = field(default_factory=list)

    @property
    def learnt(self) -> list[str]:
        return self.asked + self.confirming


def column(path: str, time: str, name: str) -> tuple[list[float], list[float]]:
    """Time since the start of the log, and a column of a CSV file."""
    with open(path, newline="") as file:
        rows = [(float(row[time]), float(row[name])) for row in csv.DictReader(file)]
    return [t - rows[0][0] for t, _ in rows], [x for _, x in rows]


class Ladder:
    """Prints one row per step."""

    def __init__(self, btr: str, servo: Servo, folder: Path) -> None:
        self.btr, self.servo, self.folder = btr, servo, folder
        print(f"{'':<42}{'x noise floor':^20}{'mean abs. error, rad':^24}")
        print(f"{'step':<42}{'learnt':>10}{'unseen':>10}{'learnt':>12}{'unseen':>12}", flush=True)

    def mean_error(self, model: str, log: str) -> float:
        """Mean absolute error of a simulation with the log's commands, in rad."""
        simulated = str(self.folder / "simulated.csv")
        ask(self.btr, "simulate", *self.servo.settings, model, "--log", log, "-o", simulated, "--overwrite")
        clock, said = column(simulated, "t", "q_hinge")
        times, measured = column(log, "t_s", "q_rad")
        errors = []
        for t, q in zip(times, measured):
            i = min(max(bisect.bisect_right(clock, t), 1), len(clock) - 1)
            share = min((t - clock[i - 1]) / (clock[i] - clock[i - 1]), 1.0)
            errors.append(abs(q - (said[i - 1] + share * (said[i] - said[i - 1]))))
        return sum(errors) / len(errors)

    def line(self, step: str, train: float, held_out: float, model: str) -> dict[str, float]:
        """Prints the errors of a model; those of the unseen logs in rad, by the log's name."""
        parts = [{log: self.mean_error(model, log) for log in logs} for logs in (self.servo.learnt, self.servo.unseen)]
        learnt, judged = (sum(part.values()) / len(part) for part in parts)
        print(f"{step:<42}{train:10.1f}{held_out:10.1f}{learnt:12.4f}{judged:12.4f}", flush=True)
        return {Path(log).stem: error for log, error in parts[1].items()}

    def fitted(self, step: str, model: str, name: str) -> tuple[dict, dict[str, float]]:
        """Fits a model and prints its line."""
        out, servo = str(self.folder / name), self.servo
        held_out = ["--held-out", *servo.unseen]
        said = ask(self.btr, "fit", *servo.settings, model, *servo.learnt, *held_out, "-o", out)
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


def follow(btr: str, servo: Servo, folder: Path) -> None:
    """Prints the ladder of a servo, and what its diagnosis says."""
    ladder = Ladder(btr, servo, folder)
    said, each = ladder.fitted("rigid body and motor, fitted", servo.model, "rigid.toml")
    asked = [*servo.asked, "--held-out", *servo.confirming, "--max-effects", str(servo.most_effects)]
    answer = ask(btr, "diagnose", *servo.settings, servo.model, *asked)
    for k, (step, effects) in enumerate(ladder_steps(answer)):
        added = str(folder / f"added{k + 1}.toml")
        ask(btr, "add", *servo.settings, servo.model, *effects, "-o", added)
        said, each = ladder.fitted(step, added, f"fitted{k + 1}.toml")
    tell(answer)
    print("fitted last:")
    for parameter in said["parameters"]:
        print(f"  {parameter['name']:<48}{parameter['value']:10.4g} {parameter['unit']}")
    print("mean absolute errors on the unseen logs, rad:")
    for log, error in each.items():
        print(f"  {log:<36}{error:8.4f}")


def tell(answer: dict) -> None:
    """The verdict of a diagnosis, what it names, and what it leaves."""
    stopped = ", stopped before the end" if answer["cut_short"] else ""
    cost = f"{answer['rollouts']} rollouts in {answer['seconds']:.0f} s{stopped}"
    print(f"\ndiagnose: {answer['verdict']}, degree {answer['degree']}, {cost}")
    for effect in answer["effects"]:
        alike = ", ".join(effect["alike"]) or "-"
        print(f"  {effect['effect']:<26} probability {effect['probability']:.2f}, alike: {alike}")
    for left in answer["remaining"]:
        print(f"  remaining: {remaining(left)}")
