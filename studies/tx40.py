#!/usr/bin/env python3
"""A real industrial arm: from a URDF and one log of motion and torque to friction, rotors and a coupled wrist.

    cargo build --release && BTR_DATA=FOLDER python3 studies/tx40.py [--keep runs/tx40]

The log and the URDF of a Staubli TX40 are those of github.com/thanhndv212/figaroh-examples: `staubli_tx40` in the
folder BTR_DATA, or `../shared/data` next to this project. No command was recorded: the joints follow their measured
motion, and the torques that it requires are compared. Of the log (1 kHz, of which btr takes means), the first 65 % are
learnt, the rest is held out. The URDF's inertials stay as they are.

Each step of the ladder has more terms than the one before, and is fitted to the learnt part in one call of `btr fit`.
Friction and rotors are added with `--add`; offsets, and the friction of the wrist motor that turns with joints 5 and 6,
are formulas in the model file.
The reference is least squares by the publishers' terms, on held-out torques that are not smoothed.

`btr diagnose` is asked about the URDF alone. Errors are 100·rms(error)/rms(torque); of all joints, both are the roots
of sums of squares. In the last second and a half the arm stands still: friction holds torques there that no motion
tells, and btr leaves them out. The column `whole log` is the error of all joints with them, as the reference has it.
"""

import csv
import math
from pathlib import Path

from asking import LOGS_OF_MACHINES, ask, run

DATA = LOGS_OF_MACHINES / "staubli_tx40"
JOINTS = range(1, 7)
LEARNT = 0.65
FRICTION = ["--add", "viscous_friction", "--add", "coulomb_friction"]
ROTORS = ["--add", "armature"]

MODEL = """name = "tx40"
[robot]
urdf = "{urdf}"
base = "fixed"
[actuators."*"]
kind = "prescribed"
"""

# What formulas add: an offset of each joint, and friction of motors that turn with two joints of the wrist.
FORMULA = '[[effects]]\neffect = "formula"\nsite = "joint_{joint}"\non = "torque"\nlaw = "{law}"\n'
OFFSET = "-offset"
COUPLING = "-offset - viscous*dq_{other} - coulomb*tanh((dq + dq_{other})/0.05)"
OTHER = {5: "child", 6: "parent"}


def with_formulas(coupled: bool) -> str:
    """The model with an offset on each joint, and with coupled wrist motors."""
    free, effects = "[parameters]\n", ""
    for joint in JOINTS:
        both = coupled and joint in OTHER
        effects += FORMULA.format(joint=joint, law=COUPLING.format(other=OTHER[joint]) if both else OFFSET)
        for name in ["offset", "viscous", "coulomb"] if both else ["offset"]:
            free += f'"formula.{name}@joint_{joint}" = {{ bounds = [-20.0, 20.0], value = 0.0 }}\n'
            effects += f"{name} = 0.0\n"
    return MODEL + free + effects


def write(model: str, path: Path) -> str:
    path.write_text(model.replace("{urdf}", str(DATA / "tx40_mdh_modified.urdf")))
    return str(path)


def logs(folder: Path) -> list[str]:
    """The two parts of the recording as logs of btr's, each from 0 s."""
    with open(DATA / "episodes" / "joint_side_1kHz.csv", newline="") as file:
        rows = list(csv.reader(file))[1:]
    learnt = int(LEARNT * len(rows))
    header = ["t", *(f"q_joint_{joint}" for joint in JOINTS), *(f"tau_joint_{joint}" for joint in JOINTS)]
    paths = []
    for name, part in (("learnt", rows[:learnt]), ("held_out", rows[learnt:])):
        paths.append(str(folder / f"{name}.csv"))
        with open(paths[-1], "w", newline="") as file:
            begin = float(part[0][0])
            csv.writer(file).writerows([header, *([f"{float(row[0]) - begin:.3f}", *row[1:]] for row in part)])
    return paths


def errors(btr: str, model: str, log: str, keep_standstill: bool = False) -> list[float]:
    """Percent of the rms torque, of each joint and of all."""
    kept = ["--set", "channels.keep_standstill=true"] if keep_standstill else []
    channels = ask(btr, "compare", model, log, *kept)["channels"]
    power = sum((100.0 * c["rmse"] / c["error_percent"]) ** 2 for c in channels)
    every = 100.0 * math.sqrt(sum(c["rmse"] ** 2 for c in channels) / power)
    return [*(c["error_percent"] for c in channels), every]


class Ladder:
    """Prints the errors of models."""

    def __init__(self, btr: str, folder: Path) -> None:
        self.btr, self.folder = btr, folder
        self.learnt, self.held_out = logs(folder)
        joints = "".join(f"{f'joint {joint}':>9}" for joint in JOINTS)
        more = f"{'all':>9}{'whole log':>11}{'reference':>11}{'rollouts':>10}{'s':>7}"
        print(f"{'error, % of rms torque':<40}{'':>9}{joints}{more}")

    def line(self, step: str, model: str, reference: str, cost: dict | None = None) -> None:
        for name, log in (("learnt", self.learnt), ("held out", self.held_out)):
            numbers = "".join(f"{error:9.1f}" for error in errors(self.btr, model, log))
            last = name == "held out"
            more = f"{errors(self.btr, model, log, keep_standstill=True)[-1]:11.1f}"
            more += f"{reference:>11}" if last else ""
            more += f"{cost['rollouts']:10d}{cost['seconds']:7.1f}" if last and cost else ""
            print(f"{'' if last else step:<40}{name:>9}{numbers}{more}", flush=True)

    def fit(self, step: str, model: str, added: list[str], reference: str) -> None:
        out = str(self.folder / "fitted.toml")
        cost = ask(self.btr, "fit", model, self.learnt, "--held-out", self.held_out, *added, "-o", out)
        self.line(step, out, reference, cost)


def tell(answer: dict) -> None:
    """What a diagnosis names."""
    print(f"\ndiagnose: {answer['verdict']}, {answer['rollouts']} rollouts in {answer['seconds']:.0f} s")
    for effect in answer["effects"]:
        sites = effect["site"] if isinstance(effect["site"], list) else [effect["site"]]
        established = "established" if effect["established"] else "not established"
        print(f"  {effect['effect']} on {', '.join(sites)}: probability {effect['probability']:.2f}, {established};")
        print(f"    alike: {', '.join(effect['alike']) or '-'}")


def study(btr: str, folder: Path) -> None:
    ladder = Ladder(btr, folder)
    rigid = write(MODEL, folder / "rigid.toml")
    offsets = write(with_formulas(coupled=False), folder / "offsets.toml")
    coupled = write(with_formulas(coupled=True), folder / "coupled.toml")
    ladder.line("URDF alone", rigid, "70")
    ladder.fit("+ viscous friction", rigid, FRICTION[:2], "31")
    ladder.fit("+ Coulomb friction", rigid, FRICTION, "-")
    ladder.fit("  with offsets", offsets, FRICTION, "30")
    ladder.fit("+ armature", rigid, FRICTION + ROTORS, "-")
    ladder.fit("  with offsets", offsets, FRICTION + ROTORS, "20")
    ladder.fit("  with offsets and coupled wrist", coupled, FRICTION + ROTORS, "12")
    found = str(folder / "found.toml")
    answer = ask(btr, "diagnose", rigid, ladder.learnt, "--held-out", ladder.held_out, "-o", found)
    ladder.line("as diagnosed", found, "-", answer)
    tell(answer)


if __name__ == "__main__":
    run(study, DATA, __doc__)
