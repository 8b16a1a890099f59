#!/usr/bin/env python3
"""A real arm: which effects does the model of an SO-101 lack on all joints, and how far does the error fall?

    cargo build --release && BTR_DATA=FOLDER python3 studies/so101.py [--keep runs/so101]

The model is `robots/so101.toml`; the logs are segments of 10 to 18 s from public ones (SAGE, Apache-2.0):
`sage_so101` in the folder BTR_DATA, or `../shared/data` next to this project. They are training logs, held-out logs
by which `diagnose` confirms its findings, and test logs, unseen motions of another kind. The whole logs last 34 to
205 s and would take ten times as long. The end of `large_amplitude` is left out: there all joints stop up to 0.14 rad
short at once, as if the gripper had met the table, which the model does not have.

The five servos are of the same type. Therefore the effect that `diagnose` first finds on some joints is added to all
of them before the next diagnosis; of effects that the logs cannot distinguish, the one with the fewest parameters is
taken. Errors are root mean squares: over all joints in multiples of the encoders' noise floor (0.44 mrad), and on the
test logs per joint in mrad. Takes about ten minutes on two cores. """

import csv
from pathlib import Path

from asking import LOGS_OF_MACHINES, ROOT, ask, remaining, run

DATA = LOGS_OF_MACHINES / "sage_so101" / "episodes"
MODEL = ROOT / "robots" / "so101.toml"
# The model's joints (those of the arm's makers) and the logs' names of them, shoulder to gripper.
JOINTS = {
    "shoulder_pan": "Rotation",
    "shoulder_lift": "Pitch",
    "elbow_flex": "Elbow",
    "wrist_flex": "Wrist_Pitch",
    "wrist_roll": "Wrist_Roll",
}
# Motion, start and end in s.
LEARN = [
    ("hold_under_gravity", 16, 34),
    ("prbs_excitation", 4, 14),
    ("velocity_ramp", 4, 18),
    ("large_amplitude", 40, 58),
    ("random_waypoints", 2, 20),
]
CONFIRM = [("friction_gravity", 4, 18), ("fast_transitions", 4, 18)]
JUDGE = [("pick_place", 4, 22), ("multisine", 4, 18), ("step_response", 4, 18), ("inertia_coupling", 4, 16)]
# Maximum numbers of effects, before and after the first effect is added to all servos.
MOST_EFFECTS = (1, 2)


def cut(motion: str, begin_s: float, end_s: float, folder: Path) -> str:
    """A segment of a log in btr's format."""
    path = folder / f"{motion}.csv"
    with open(DATA / f"{motion}.csv", newline="") as source, open(path, "w", newline="") as target:
        writer = csv.writer(target)
        writer.writerow(["t", *(f"cmd_{joint}" for joint in JOINTS), *(f"q_{joint}" for joint in JOINTS)])
        for row in csv.DictReader(source):
            if begin_s <= float(row["t_s"]) < end_s:
                told, said = ([row[f"{kind}_{name}"] for name in JOINTS.values()] for kind in ("q_cmd", "q"))
                writer.writerow([row["t_s"], *told, *said])
    return str(path)


class Ladder:
    """Fits models and prints a line for each."""

    def __init__(self, btr: str, folder: Path) -> None:
        self.btr, self.folder = btr, folder
        self.learn = [cut(*window, folder) for window in LEARN]
        self.confirm = [cut(*window, folder) for window in CONFIRM]
        self.judge = [cut(*window, folder) for window in JUDGE]
        print(f"{'':<46}{'x noise floor':^18}  test, mrad")
        print(f"{'step':<46}{'train':>9}{'test':>9}  {''.join(f'{joint:>15}' for joint in JOINTS)}", flush=True)

    def line(self, step: str, train: float, held_out: float, model: str) -> None:
        errors = {
            channel["name"]: channel["rmse"] for channel in ask(self.btr, "compare", model, *self.judge)["channels"]
        }
        each = "".join(f"{1000 * errors[f'q_{joint}']:15.1f}" for joint in JOINTS)
        print(f"{step:<46}{train:9.2f}{held_out:9.2f}  {each}", flush=True)

    def fit(self, step: str, model: str, effects: list[str], name: str) -> str:
        """The model with these effects, fitted."""
        out = str(self.folder / name)
        added = [word for effect in effects for word in ("--add", effect)]
        said = ask(self.btr, "fit", model, *self.learn, "--held-out", *self.judge, *added, "-o", out)
        if not effects:
            first = said["error_ladder"][0]
            self.line("as its makers have it", first["train"], first["held_out"], model)
        self.line(step, said["train"], said["held_out"], out)
        return out

    def diagnose(self, model: str, most: int) -> dict:
        held_out = ["--held-out", *self.confirm]
        said = ask(self.btr, "diagnose", model, *self.learn, *held_out, "--max-effects", str(most))
        print(f"  diagnose: {said['verdict']}, {said['rollouts']} rollouts in {said['seconds']:.0f} s")
        for step in said["error_ladder"][1:]:
            print(f"    {step['step']:<42}{step['train']:9.2f}{step['held_out']:9.2f} (confirming)")
        for effect in said["effects"]:
            print(f"    {effect['effect']} alike: {', '.join(effect['alike']) or '-'}", flush=True)
        return said


def sites(effect: dict) -> list[str]:
    return effect["site"] if isinstance(effect["site"], list) else [effect["site"]]


def simplest(btr: str, effect: dict) -> str:
    """Of an effect and those that the logs cannot distinguish from it at the same joint, the one with the fewest
    parameters."""
    here = [name.split("@")[0] for name in effect["alike"] if name.split("@")[1] in sites(effect)]
    return min([effect["effect"], *here], key=lambda name: len(ask(btr, "effects", name)["effects"][0]["parameters"]))


def study(btr: str, folder: Path) -> None:
    ladder = Ladder(btr, folder)
    ladder.fit("fitted", str(MODEL), [], "plain.toml")
    said = ladder.diagnose(str(MODEL), MOST_EFFECTS[0])
    if said["effects"]:
        friction = simplest(btr, said["effects"][0])
        everywhere = [f"{friction}@{joint}" for joint in JOINTS]
        fitted = ladder.fit(f"+ {friction} on all joints", str(MODEL), everywhere, "alike.toml")
        said = ladder.diagnose(fitted, MOST_EFFECTS[1])
        found = [f"{effect['effect']}@{site}" for effect in said["effects"] for site in sites(effect)]
        if found:
            ladder.fit(f"+ {' + '.join(found)}", fitted, found, "final.toml")
    share = f"{100 * said['unexplained_share']:.1f} % of the squared error is not noise"
    print(f"\nverdict: {said['verdict']}, degree {said['degree']}; {share}")
    for left in said["remaining"]:
        print(f"  remaining: {remaining(left)}")
    law = said.get("residual_law")
    print("law of what remains: " + (f"{law['law']} on {law['on']} of {law['site']}" if law else "none found"))


if __name__ == "__main__":
    run(study, DATA, __doc__)
