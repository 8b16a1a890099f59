#!/usr/bin/env python3
"""Robots that do not repeat themselves: does `btr diagnose` still name the hidden effect, and are its intervals true?

    cargo build --release && python3 -m venv venv && venv/bin/pip install numpy
    venv/bin/python studies/repeats.py [--seeds 100..119] [--effects coulomb_friction,none]

Reality is the desk arm of `robots/arm.urdf` with masses and gains off by up to 10 %, one hidden effect (or none), and
what differs from run to run: the hidden effect's size, the gains and the encoders' offsets of each run (`runs`), or a
disturbance of the readings that wanders within a run (`wander`, an Ornstein-Uhlenbeck process). Both are about five
times the encoders' noise. Two commands are given four times each, and a third one twice, held out. It prints for each
seed the verdict, the degree, what was named, and whether the 95 % intervals hold the mean values of reality.
"""

import argparse
import csv
import json
import subprocess
import tempfile
import tomllib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asking import BTR, ROOT

JOINTS = ["yaw", "shoulder", "elbow"]
LINKS = ["turret", "upper", "forearm"]
NOISE_RAD = 0.0005
TICK_S, DURATION_S = 0.01, 4.0
# What differs from run to run: share of an effect's size, share of a gain, offset of an encoder in rad.
RUN_EFFECT, RUN_GAIN, RUN_OFFSET_RAD = 0.12, 0.01, 0.002
# A disturbance that wanders: its size in rad and its memory in s.
WANDER_RAD, WANDER_S = 0.0025, 0.3

MODEL = """name = "desk arm"
[robot]
urdf = "{urdf}"
base = "fixed"
{actuators}
[simulation]
control_s = 0.01
steps_per_control = 10
sample_every = 10
[noise]
position_rad = 0.0005
"""
EFFECTS = {
    "coulomb_friction": {"yaw": {"torque": 0.30}, "shoulder": {"torque": 0.40}, "elbow": {"torque": 0.10}},
    "armature": {"yaw": {"inertia": 0.020}, "shoulder": {"inertia": 0.020}, "elbow": {"inertia": 0.003}},
    "command_delay": {joint: {"delay": 0.020} for joint in JOINTS},
}
KP = {"yaw": 20.0, "shoulder": 25.0, "elbow": 12.0}
KD = {"yaw": 0.5, "shoulder": 0.6, "elbow": 0.25}


@dataclass
class Case:
    """A planted robot: the hidden effect, its site, its values, and the factors of its gains."""

    seed: int
    kind: str
    effect: str
    site: str
    values: dict
    factors: dict


def plant(seed: int, kind: str, effects: list[str]) -> Case:
    rng = np.random.default_rng(seed)
    effect = effects[seed % len(effects)]
    site = JOINTS[rng.integers(3)]
    size = rng.uniform(0.7, 1.5)
    values = {name: size * value for name, value in EFFECTS.get(effect, {}).get(site, {}).items()}
    factors = {name: rng.uniform(0.92, 1.08) for name in [*(f"kp@{j}" for j in JOINTS), *(f"kd@{j}" for j in JOINTS)]}
    return Case(seed, kind, effect, site, values, factors)


def actuators(gains: dict) -> str:
    of = lambda j: f'[actuators."{j}"]\nkind = "position"\nkp = {gains[f"kp@{j}"]}\nkd = {gains[f"kd@{j}"]}\n'
    return "\n".join(of(joint) for joint in JOINTS)


def nominal() -> dict:
    return {f"kp@{j}": KP[j] for j in JOINTS} | {f"kd@{j}": KD[j] for j in JOINTS}


def model_text(gains: dict) -> str:
    free = "\n".join(f'"{name}" = {{ relative = [0.8, 1.25] }}' for name in gains)
    return MODEL.format(urdf=ROOT / "robots/arm.urdf", actuators=actuators(gains)) + f"[parameters]\n{free}\n"


def command(rng, t):
    """Sums of sines in the joints' ranges."""
    columns = []
    for _ in JOINTS:
        wave = lambda: rng.uniform(0.1, 0.3) * np.sin(2 * np.pi * rng.uniform(0.2, 1.4) * t + rng.uniform(0, 6))
        columns.append(np.clip(t / 0.5, 0, 1) * sum(wave() for _ in range(3)))
    return np.array(columns).T


def run(btr: str, case: Case, commands: Path, out: Path, folder: Path, rng) -> None:
    """One run of reality: simulated with what differs in it, then read by its encoders."""
    gains = {name: value * case.factors[name] for name, value in nominal().items()}
    values = dict(case.values)
    offsets = np.zeros(3)
    if case.kind == "runs":
        gains = {name: value * (1 + RUN_GAIN * rng.standard_normal()) for name, value in gains.items()}
        values = {name: value * max(0.0, 1 + RUN_EFFECT * rng.standard_normal()) for name, value in values.items()}
        offsets = RUN_OFFSET_RAD * rng.standard_normal(3)
    text = MODEL.format(urdf=ROOT / "robots/arm.urdf", actuators=actuators(gains))
    if case.effect in EFFECTS:
        settings = "".join(f"{name} = {value}\n" for name, value in values.items())
        text += f'[[effects]]\neffect = "{case.effect}"\nsite = "{case.site}"\n{settings}'
    text = text.replace("position_rad = 0.0005", "position_rad = 0.0")
    model = folder / f"{out.stem}.toml"
    model.write_text(text)
    subprocess.run([btr, "-q", "simulate", model, "--log", commands, "-o", out, "--overwrite"], check=True)
    with out.open() as file:
        rows = list(csv.reader(file))
    head, data = rows[0], np.array(rows[1:], dtype=float)
    for k, joint in enumerate(JOINTS):
        column = head.index(f"q_{joint}")
        noise = NOISE_RAD * rng.standard_normal(len(data)) + offsets[k]
        if case.kind == "wander":
            noise += wander(rng, len(data))
        data[:, column] += noise
    keep = [0] + [head.index(f"{kind}_{joint}") for kind in ("cmd", "q") for joint in JOINTS]
    with out.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([head[k] for k in keep])
        writer.writerows(data[:, keep].tolist())


def wander(rng, n):
    keep = np.exp(-TICK_S / WANDER_S)
    values, state = np.empty(n), WANDER_RAD * rng.standard_normal()
    for i in range(n):
        state = keep * state + WANDER_RAD * np.sqrt(1 - keep * keep) * rng.standard_normal()
        values[i] = state
    return values


def ask(btr: str, case: Case, folder: Path) -> dict:
    rng = np.random.default_rng([case.seed, 1])
    t = np.arange(0, DURATION_S + TICK_S / 2, TICK_S)
    learn, held_out = [], []
    for name, runs, logs in [("a", 4, learn), ("b", 4, learn), ("c", 2, held_out)]:
        told = folder / f"{name}.csv"
        values = command(rng, t)
        with told.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["t"] + [f"cmd_{j}" for j in JOINTS] + [f"q_{j}" for j in JOINTS])
            writer.writerows([[x, *row, 0.0, 0.0, 0.0] for x, row in zip(t, values)])
        for k in range(runs):
            out = folder / f"{name}{k}.csv"
            run(btr, case, told, out, folder, rng)
            logs.append(out)
    model = folder / "model.toml"
    model.write_text(model_text(nominal()))
    told = [btr, "--json", "-q", "diagnose", model, *learn, "--held-out", *held_out, "-j", "1"]
    answer = json.loads(subprocess.run(told, capture_output=True, text=True, check=False).stdout)
    fitted = None
    if case.effect in EFFECTS:
        told = [btr, "--json", "-q", "fit", model, *learn, "--held-out", *held_out, "-j", "1"]
        told += ["--add", f"{case.effect}@{case.site}"]
        fitted = json.loads(subprocess.run(told, capture_output=True, text=True, check=False).stdout)
    return {"diagnose": answer, "fit": fitted}


def judge(case: Case, answer: dict) -> dict:
    """What was named, and how many of the intervals hold the truth."""
    found = answer["diagnose"]
    sites = lambda effect: [effect["site"]] if isinstance(effect["site"], str) else effect["site"]
    named = [f"{effect['effect']}@{site}" for effect in found["effects"] for site in sites(effect)]
    named += [f"{v['value']}@{v['site']}" for v in found["wrong_values"]]
    truth = [f"{case.effect}@{case.site}"] if case.effect in EFFECTS else []
    known = {f"{case.effect}.{name}@{case.site}": value for name, value in case.values.items()}
    known |= {name: value * case.factors[name] for name, value in nominal().items()}
    hits = []
    for estimate in (answer["fit"] or {}).get("parameters", []):
        if estimate["ci95"] and estimate["name"] in known:
            (low, high), true = estimate["ci95"], known[estimate["name"]]
            hits.append((low <= true <= high, (high - low) / abs(true), estimate["name"].startswith(case.effect)))
    return {
        "verdict": found["verdict"],
        "degree": found["degree"],
        "right": named == truth,
        "named": named,
        "last": found["error_ladder"][-1],
        "degree_of_fit": (answer["fit"] or {}).get("degree"),
        "hits": hits,
        "rollouts": found["rollouts"],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="100..119")
    parser.add_argument("--effects", default="coulomb_friction,armature,command_delay,none")
    parser.add_argument("--kinds", default="runs,wander")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--btr", default=BTR, help="the program to ask")
    args = parser.parse_args()
    first, last = (int(x) for x in args.seeds.split(".."))
    kinds, effects = args.kinds.split(","), args.effects.split(",")
    cases = [plant(seed, kind, effects) for kind in kinds for seed in range(first, last + 1)]

    def one(case: Case) -> tuple[Case, dict]:
        with tempfile.TemporaryDirectory() as folder:
            return case, judge(case, ask(args.btr, case, Path(folder)))

    verdicts, hits, effect_hits = Counter(), [], []
    with ThreadPoolExecutor(args.jobs) as pool:
        for case, told in pool.map(one, cases):
            hits += [hit for hit, _, _ in told["hits"]]
            effect_hits += [hit for hit, _, of_effect in told["hits"] if of_effect]
            verdicts[(case.kind, "hidden" if case.effect in EFFECTS else "quiet", told["degree"], told["right"])] += 1
            width = np.median([w for _, w, _ in told["hits"]]) if told["hits"] else float("nan")
            print(
                f"{case.seed} {case.kind:<7} {case.effect}@{case.site:<9} {told['verdict']:<16} {told['degree']:<26}"
                f" {told['last']['train']:.2f} {told['last']['held_out']:.2f} {', '.join(told['named']) or '-'}"
                f"  fit {told['degree_of_fit']} {sum(h for h, _, _ in told['hits'])}/{len(told['hits'])}"
                f" width {width:.3f}  {told['rollouts']} rollouts",
                flush=True,
            )
    for key, count in sorted(verdicts.items(), key=str):
        print(f"{count:4d}  {key[0]} {key[1]}: {key[2]}, {'the truth alone named' if key[3] else 'other names'}")
    for name, of in [("all parameters", hits), ("the effect's", effect_hits)]:
        if of:
            print(f"intervals that hold the truth, {name}: {sum(of)} of {len(of)} ({100 * np.mean(of):.1f} %)")


if __name__ == "__main__":
    main()
