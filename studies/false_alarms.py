#!/usr/bin/env python3
"""Robots with nothing hidden, and readings whose noise is not Gaussian: does `btr diagnose` find something anyway?

    cargo build --release && python3 -m venv venv && venv/bin/pip install numpy
    venv/bin/python studies/false_alarms.py [--first 10000] [--trials 1000] [--kinds outliers,ar1]

A seed is a trial: an arm of one to three joints (random links, servos of kind position), whose masses and gains differ
from the model's by up to 8 % within the bounds of its free parameters, two logs of 4 s at 100 Hz, and a kind of noise
that the model does not state, so that btr estimates it from the log:

    gauss      white noise of 0.3 to 2 mrad, the control
    quantised  an encoder of 9 to 13 bits per turn without further noise
    ar1        an autoregressive noise, correlated over 1 to 10 samples
    dropouts   white noise; 1 to 10 % of the samples are missing, alone or in bursts of up to 5
    outliers   white noise; 0.2 to 2 % of the readings are off by 10 to 300 times as much
    jitter     white noise; readings are late by up to 20 % of a sample, and the stamps do not say so
    stamps     the same, and the stamps say so
    mixture    two or three of these at once

The truth is simulated by btr itself with a time step of 0.5 ms; the model has one of 2.5 ms. So everything in the logs
but the noise is in the model. The right verdict is `nothing_missing`; what else is said is a false alarm, and worst is
a name.
Seeds below 10000 are for tuning.
"""

import argparse
import csv
import json
import subprocess
import tempfile
import time
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asking import BTR

STEP_S, FINE_S, LENGTH_S = 0.01, 0.001, 4.0
KINDS = ("gauss", "quantised", "ar1", "dropouts", "outliers", "jitter", "stamps")


@dataclass
class Arm:
    """A chain of links of random geometry, with what its user knows of it and its true values."""

    urdf: str
    joints: int
    values: dict[str, float]
    true: dict[str, float]

    def model(self, values: dict[str, float], *, truth: bool) -> str:
        """A model file with these masses and gains."""
        text = f'name = "arm"\n[robot]\nurdf = "{"true" if truth else "arm"}.urdf"\nbase = "fixed"\n'
        for k in range(self.joints):
            text += f'[actuators.j{k}]\nkind = "position"\nkp = {values[f"kp@j{k}"]}\nkd = {values[f"kd@j{k}"]}\n'
        fine = (20, 2) if truth else (4, 4)
        text += f"[simulation]\ncontrol_s = {STEP_S}\nsteps_per_control = {fine[0]}\nsample_every = {fine[1]}\n"
        if truth:
            return text + "[noise]\nposition_rad = 0.0\n"
        return text + "[parameters]\n" + "".join(f'"{name}" = {{ relative = [0.8, 1.25] }}\n' for name in values)


def arm_of(rng: np.random.Generator) -> Arm:
    joints = int(rng.choice([1, 2, 3], p=[0.6, 0.3, 0.1]))
    values: dict[str, float] = {}
    for k in range(joints):
        values[f"mass@l{k}"] = round(float(rng.uniform(0.2, 1.0)), 4)
        values[f"kp@j{k}"] = round(float(rng.uniform(15, 40) * (joints - k) ** 1.5), 3)
        values[f"kd@j{k}"] = round(float(rng.uniform(0.4, 1.2) * (joints - k) ** 1.2), 4)
    true = {name: value * float(rng.uniform(0.92, 1.08)) for name, value in values.items()}
    shape = [(rng.uniform(0.1, 0.25), rng.choice(["0 1 0", "1 0 0", "0 0 1"])) for _ in range(joints)]
    return Arm(json.dumps(shape), joints, values, true)


def urdf(arm: Arm, values: dict[str, float]) -> str:
    """Rods: a link's mass is in its middle."""
    text, at = '<robot name="arm"><link name="base"/>', "0 0 0"
    for k, (length, axis) in enumerate(json.loads(arm.urdf)):
        parent, mass = ("base" if k == 0 else f"l{k - 1}"), values[f"mass@l{k}"]
        across = mass * (length**2 / 12 + 0.02**2)
        inertia = f'ixx="{mass * 0.02**2}" iyy="{across}" izz="{across}" ixy="0" ixz="0" iyz="0"'
        text += (
            f'<joint name="j{k}" type="revolute"><parent link="{parent}"/><child link="l{k}"/>'
            f'<origin xyz="{at}"/><axis xyz="{axis}"/>'
            f'<limit lower="-3" upper="3" effort="1000" velocity="100"/></joint>'
            f'<link name="l{k}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="{mass}"/><inertia {inertia}/>'
            f"</inertial></link>"
        )
        at = f"{length} 0 0"
    return text + "</robot>"


def commands(rng: np.random.Generator, joints: int) -> np.ndarray:
    """Sums of sines from rest, one column per joint."""
    t = np.arange(0, LENGTH_S + STEP_S / 2, STEP_S)
    wave = lambda: rng.uniform(0.1, 0.35) * np.sin(2 * np.pi * rng.uniform(0.2, 1.5) * t + rng.uniform(0, 6))
    return np.array([np.clip(t / 0.5, 0, 1) * sum(wave() for _ in range(3)) for _ in range(joints)]).T


@dataclass
class Sensors:
    """The sensors of a robot: the same in all of its logs."""

    kinds: set[str]
    sigma_rad: float
    memory: float  # samples over which an autoregressive noise is correlated
    lost: float  # share of the samples
    burst: int
    hit: float  # share of the readings
    bits: int  # per turn
    late: float  # share of a sample

    @staticmethod
    def of(rng: np.random.Generator, kinds: set[str]) -> "Sensors":
        return Sensors(
            kinds,
            sigma_rad=rng.uniform(0.0003, 0.002),
            memory=rng.uniform(1, 10),
            lost=rng.uniform(0.01, 0.1),
            burst=int(rng.choice([1, 5])),
            hit=rng.uniform(0.002, 0.02),
            bits=int(rng.integers(9, 14)),
            late=rng.uniform(0.05, 0.2),
        )

    def noise(self, rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
        white = rng.standard_normal(shape)
        if "ar1" not in self.kinds:
            return white * (0.0 if self.kinds == {"quantised"} else self.sigma_rad)
        keep, noise = float(np.exp(-1.0 / self.memory)), white.copy()
        for i in range(1, len(noise)):
            noise[i] = keep * noise[i - 1] + np.sqrt(1 - keep * keep) * white[i]
        return self.sigma_rad * noise

    def missing(self, rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
        gone = np.zeros(shape, dtype=bool)
        for i, j in np.argwhere(rng.random(shape) < self.lost / ((1 + self.burst) / 2)):
            gone[max(i, 1) : max(i, 1) + int(rng.integers(1, self.burst + 1)), j] = True
        return gone

    def read(self, rng: np.random.Generator, fine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The stamps and readings of positions every `FINE_S`."""
        t = np.arange(0, LENGTH_S + STEP_S / 2, STEP_S)
        late = np.zeros(len(t))
        if self.kinds & {"jitter", "stamps"}:
            late[1:-1] = rng.uniform(0, self.late * STEP_S, len(t) - 2)
        clock = np.arange(len(fine)) * FINE_S
        q = np.array([np.interp(t + late, clock, column) for column in fine.T]).T
        q += self.noise(rng, q.shape)
        if "outliers" in self.kinds:
            hit = rng.random(q.shape) < self.hit
            hit[0] = False
            q += hit * self.sigma_rad * 10 ** rng.uniform(1, 2.5, q.shape) * rng.choice([-1, 1], q.shape)
        if "quantised" in self.kinds:
            quantum = 2 * np.pi / 2**self.bits
            q = np.round(q / quantum) * quantum
        if "dropouts" in self.kinds:
            q[self.missing(rng, q.shape)] = np.nan
        return (t + late if "stamps" in self.kinds else t), q


def plan(seed: int) -> tuple[np.random.Generator, set[str], str]:
    """The generator of a trial, its kinds of noise, and what they are called."""
    rng = np.random.default_rng(seed)
    which = seed % (len(KINDS) + 1)
    if which < len(KINDS):
        return rng, {KINDS[which]}, KINDS[which]
    return rng, set(rng.choice(KINDS[1:], int(rng.integers(2, 4)), replace=False)), "mixture"


def written(path: Path, names: list[str], rows: np.ndarray) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows([["" if np.isnan(x) else float(x) for x in row] for row in rows])
    return path


def case(btr: str, seed: int, folder: Path) -> list[Path]:
    """Writes the model and the logs of a trial; the logs' names."""
    rng, kinds, _ = plan(seed)
    arm, sensors = arm_of(rng), Sensors.of(rng, kinds)
    for name, values in [("arm", arm.values), ("true", arm.true)]:
        (folder / f"{name}.urdf").write_text(urdf(arm, values))
        (folder / f"{name}.toml").write_text(arm.model(values, truth=name == "true"))
    joints, logs = [f"j{k}" for k in range(arm.joints)], []
    for name in "ab":
        cmd = commands(rng, arm.joints)
        t = np.arange(len(cmd)) * STEP_S
        columns = [f"cmd_{j}" for j in joints] + [f"q_{j}" for j in joints]
        given = written(folder / f"{name}_cmd.csv", ["t", *columns], np.column_stack([t, cmd, 0.0 * cmd]))
        out = folder / f"{name}_true.csv"
        command = [btr, "-q", "simulate", folder / "true.toml", "--log", given, "-o", out, "--overwrite", "-j", "1"]
        subprocess.run(command, check=True)
        with out.open() as file:
            rows = list(csv.reader(file))
        fine = np.array([[float(row[rows[0].index(f"q_{j}")]) for j in joints] for row in rows[1:]])
        stamps, q = sensors.read(rng, fine)
        logs.append(written(folder / f"{name}.csv", ["t", *columns], np.column_stack([stamps, cmd, q])))
    return logs


def answer(btr: str, seed: int, keep: Path | None) -> dict:
    """What btr says of a trial."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = keep / str(seed) if keep else Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        logs = case(btr, seed, folder)
        command = [btr, "--json", "-q", "diagnose", folder / "arm.toml", *logs, "-j", "1"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    found = json.loads(done.stdout) if done.stdout.strip() else {}
    if "verdict" not in found:
        return {"verdict": "refused", "names": [], "error": None, "why": done.stdout + done.stderr}
    names = [f"{e['effect']}@{e['site']}" for e in found["effects"]]
    names += [f"{v['value']}@{v['site']}" for v in found["wrong_values"]]
    last = found["error_ladder"][-1]
    return {"verdict": found["verdict"], "names": names, "error": last["held_out"] or last["train"], "why": ""}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=10_000, help="the first seed")
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--kinds", type=lambda text: set(text.split(",")), help="of these kinds of noise alone")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="where to keep models and logs, a folder for each seed")
    parser.add_argument("--btr", default=BTR)
    args = parser.parse_args()
    seeds = [s for s in range(args.first, args.first + args.trials) if not args.kinds or plan(s)[2] in args.kinds]
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    began = time.monotonic()
    with ThreadPoolExecutor(args.jobs) as pool:
        for seed, told in zip(seeds, pool.map(lambda seed: answer(args.btr, seed, args.keep), seeds)):
            _, kinds, name = plan(seed)
            named = bool(told["names"])
            counts[name].update({"trials": 1, told["verdict"]: 1, "named": int(named)})
            if told["verdict"] != "nothing_missing":
                which = "+".join(sorted(kinds))
                error = "" if told["error"] is None else f" error {told['error']:.3f}"
                print(f"{seed} {which}: {told['verdict']} {', '.join(told['names'])}{error} {told['why']}", flush=True)
    columns = ["trials", "nothing_missing", "named", "unexplained", "partly_explained", "refused"]
    print("\nnoise      " + "".join(f"{column:>18}" for column in columns))
    for name in [*KINDS, "mixture"]:
        if counts[name]:
            print(f"{name:<11}" + "".join(f"{counts[name][column]:>18}" for column in columns))
    total = sum(counts.values(), Counter())
    print(f"{'all':<11}" + "".join(f"{total[column]:>18}" for column in columns))
    print(f"{time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
