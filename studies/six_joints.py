#!/usr/bin/env python3
"""Planted six-joint arms: motion and torque at 1 kHz, with friction, rotors, a payload and a coupled wrist to be found.

    cargo build --release && python3 studies/six_joints.py --seeds 300..319 [--seconds 60] [--rate 1000] [--jobs 1]

Needs NumPy and MuJoCo (`pip install numpy mujoco`). MuJoCo's inverse dynamics gives the rigid torques. On top come, at
each joint, viscous and Coulomb friction and a rotor; 2.8 kg are carried on a flange of 0.2 kg; and the motor of joint 6
turns with joint 5, so that its friction acts on both and depends on the sum of both velocities: no effect of btr is
that. Sizes, motion and noise are drawn from the seed. btr sees the URDF without all this and one log, of which the last
quarter is held out.

A line per seed: how many of the twelve friction values and six rotors were named within 5 %, the payload, its link,
the law over the neighbour, the errors in noise floors, rollouts and seconds.
"""

import argparse
import csv
import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np

from asking import BTR
from foreign.glitches import damage

JOINTS = 6
# Mass in kg, length in m, radius in m of each link, and the axis of the joint before it.
LINKS = [
    (9.0, 0.30, 0.09, "0 0 1"),
    (12.0, 0.40, 0.07, "0 1 0"),
    (5.0, 0.36, 0.06, "0 1 0"),
    (2.0, 0.14, 0.045, "0 0 1"),
    (1.2, 0.10, 0.04, "0 1 0"),
    (0.2, 0.06, 0.035, "0 0 1"),
]
PAYLOAD_KG = 2.8
# What may be named: each joint's friction and rotor, the load, and the motor that turns with joints 5 and 6.
PLANTED = {
    *(f"{effect}@joint_{joint}" for effect in ("coulomb_friction", "viscous_friction", "armature")
      for joint in range(1, JOINTS + 1)),
    "tool_load@link_6", "parent_coupling@joint_6", "child_coupling@joint_5",
}
# Typical sizes at each joint: N·m·s/rad, N·m, kg·m², noise of the torque in N·m.
VISCOUS = [8.0, 10.0, 5.0, 1.0, 0.9, 0.4]
COULOMB = [9.0, 10.0, 6.0, 1.5, 1.4, 0.7]
ROTOR = [0.9, 1.1, 0.5, 0.06, 0.05, 0.03]
NOISE_NM = [2.5, 2.5, 1.5, 0.25, 0.2, 0.12]
ENCODER_RAD = 2e-5
HELD_OUT = 0.25
MODEL = """name = "six_joints"
[robot]
urdf = "arm.urdf"
base = "fixed"
[actuators."*"]
kind = "prescribed"
"""


def urdf(payload: tuple[float, np.ndarray] | None) -> str:
    """The arm; with a payload (kg, place in the flange's frame) as one more link fixed to the flange."""
    out = ['<robot name="six"><link name="base"/>']
    for k, (mass, length, radius, axis) in enumerate(LINKS, 1):
        across, along = mass * (3 * radius**2 + length**2) / 12, mass * radius**2 / 2
        out.append(
            f'<link name="link_{k}"><inertial><origin xyz="0 0 {length / 2}"/><mass value="{mass}"/><inertia '
            f'ixx="{across:.9g}" iyy="{across:.9g}" izz="{along:.9g}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
        parent, lift = ("base", 0.1) if k == 1 else (f"link_{k - 1}", LINKS[k - 2][1])
        out.append(
            f'<joint name="joint_{k}" type="revolute"><parent link="{parent}"/><child link="link_{k}"/>'
            f'<origin xyz="0 0 {lift}"/><axis xyz="{axis}"/><limit lower="-3" upper="3" effort="500" velocity="9"/>'
            "</joint>"
        )
    if payload:
        mass, place = payload
        out.append(
            f'<link name="load"><inertial><origin xyz="0 0 0"/><mass value="{mass}"/><inertia ixx="1e-6" iyy="1e-6" '
            'izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="grip" type="fixed"><parent '
            f'link="link_6"/><child link="load"/><origin xyz="{place[0]} {place[1]} {place[2]}"/></joint>'
        )
    return "".join([*out, "</robot>"])


class Truth:
    """What the arm has and its URDF lacks, drawn from a seed."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        drawn = lambda sizes: np.array(sizes) * self.rng.uniform(0.6, 1.4, JOINTS)  # noqa: E731
        self.viscous, self.coulomb, self.rotor = drawn(VISCOUS), drawn(COULOMB), drawn(ROTOR)
        self.coupled = np.array([0.5 * self.viscous[5], 0.5 * self.coulomb[5], 0.5 * self.rotor[5]])
        self.place = np.array([*self.rng.uniform(-0.05, 0.05, 2), self.rng.uniform(0.08, 0.14)])

    def whole(self, of_joint: np.ndarray, which: int) -> np.ndarray:
        """Values with the coupled motor's, which turns with both joints of the wrist."""
        return of_joint + np.array([0, 0, 0, 0, 1, 1]) * self.coupled[which]

    def torques(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        model = mujoco.MjModel.from_xml_string(urdf((PAYLOAD_KG, self.place)))
        data = mujoco.MjData(model)
        tau = np.empty_like(q)
        for row in range(len(q)):
            data.qpos[:], data.qvel[:], data.qacc[:] = q[row], dq[row], ddq[row]
            mujoco.mj_inverse(model, data)
            tau[row] = data.qfrc_inverse
        tau += self.viscous * dq + self.coulomb * np.sign(dq) + self.rotor * ddq
        both, ddboth = dq[:, 4] + dq[:, 5], ddq[:, 4] + ddq[:, 5]
        shared = self.coupled[0] * both + self.coupled[1] * np.sign(both) + self.coupled[2] * ddboth
        tau[:, 4] += shared
        tau[:, 5] += shared
        return tau


def motion(rng: np.random.Generator, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sums of five sines per joint, about a posture of its own."""
    q, dq, ddq = (np.zeros((len(t), JOINTS)) for _ in range(3))
    for joint in range(JOINTS):
        q[:, joint] = rng.uniform(-0.7, 0.7)
        for k in range(1, 6):
            w, phase = rng.uniform(0.5, 0.9) * k, rng.uniform(0, math.tau)
            a = rng.uniform(0.4, 1.0) * (0.55 if joint < 3 else 0.8) / k
            q[:, joint] += a * np.sin(w * t + phase)
            dq[:, joint] += a * w * np.cos(w * t + phase)
            ddq[:, joint] -= a * w * w * np.sin(w * t + phase)
    return q, dq, ddq


def write_logs(folder: Path, seed: int, seconds: float, rate: float) -> Truth:
    truth = Truth(seed)
    t = np.arange(round(seconds * rate)) / rate
    q, dq, ddq = motion(truth.rng, t)
    tau = truth.torques(q, dq, ddq) + truth.rng.standard_normal(q.shape) * NOISE_NM
    q = q + ENCODER_RAD * truth.rng.standard_normal(q.shape)
    cut = round((1 - HELD_OUT) * len(t))
    header = ["t", *(f"q_joint_{k + 1}" for k in range(JOINTS)), *(f"tau_joint_{k + 1}" for k in range(JOINTS))]
    for name, part in (("learn", slice(0, cut)), ("held_out", slice(cut, None))):
        rows = np.column_stack([t[part] - t[part][0], q[part], tau[part]])
        with open(folder / f"{name}.csv", "w", newline="") as file:
            csv.writer(file).writerows([header, *([f"{value:.8g}" for value in row] for row in rows)])
    (folder / "arm.urdf").write_text(urdf(None))
    (folder / "arm.toml").write_text(MODEL)
    return truth


def ask(btr: str, folder: Path, words: list[str]) -> tuple[dict, float, float, float]:
    """The answer, with seconds, seconds of CPU and MB."""
    began, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([btr, *words, "--json", "-q"], cwd=folder, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    answer = json.loads(done.stdout)
    if not answer["ok"]:
        sys.exit(f"{words}: {answer}")
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return answer, time.monotonic() - began, cpu, after.ru_maxrss / 1024


def named(answer: dict) -> dict[str, float]:
    """Values of what was named, by `effect.parameter@joint`."""
    return {p["name"]: p["value"] for effect in answer["effects"] for p in effect["parameters"]}


def within(value: float | None, truth: float, share: float = 0.05) -> bool:
    return value is not None and abs(value / truth - 1.0) <= share


def friction(values: dict[str, float], joint: int, what: str) -> list[float]:
    """The values of a friction law's Coulomb or viscous part at a joint, under any name that has it."""
    site = f"@joint_{joint}"
    names = {
        "coulomb": ["coulomb_friction.torque", "asymmetric_friction.coulomb_forward",
                    "asymmetric_friction.coulomb_backward"],
        "viscous": ["viscous_friction.coefficient", "asymmetric_friction.viscous_forward",
                    "asymmetric_friction.viscous_backward"],
    }[what]
    return [values[name + site] for name in names if name + site in values]


def named_effects(answer: dict) -> list[str]:
    return [f"{effect['effect']}@{site}" for effect in answer["effects"] for site in sites(effect)]


def sites(effect: dict) -> list[str]:
    return effect["site"] if isinstance(effect["site"], list) else [effect["site"]]


def judge(answer: dict, truth: Truth) -> dict:
    values = named(answer)
    right = {"coulomb": 0, "viscous": 0}
    for joint in range(1, JOINTS + 1):
        for what, true_values in (("coulomb", truth.coulomb), ("viscous", truth.whole(truth.viscous, 0))):
            found = friction(values, joint, what)
            right[what] += bool(found) and all(within(value, true_values[joint - 1]) for value in found)
    inertias = truth.whole(truth.rotor, 2)
    rotors = sum(within(values.get(f"armature.inertia@joint_{k + 1}"), inertias[k]) for k in range(JOINTS))
    loads = {name: value for name, value in values.items() if ".mass@" in name}
    law = answer.get("residual_law") or {}
    coupled = [name for name in named_effects(answer) if "coupling" in name]
    text = f"{law.get('site', '-')}: {law.get('law', '-')}; {' '.join(coupled)}"
    return {**right, "rotors": rotors, "loads": loads, "law": text,
            "load_right": any(within(v, PAYLOAD_KG) and n.endswith("link_6") for n, v in loads.items()),
            "others": [name for name in named_effects(answer) if name not in PLANTED],
            "law_right": {"parent_coupling@joint_6", "child_coupling@joint_5"} <= set(coupled) or
            law.get("site") in ("joint_5", "joint_6") and
            any(name in law.get("law", "") for name in ("dq_parent", "dq_child"))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--btr", default=BTR)
    parser.add_argument("--seeds", default="300..302", help="A..B, both included")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=1000.0, help="samples per second")
    parser.add_argument("--glitches", type=float, default=0.0, help="share of the readings that glitches replace")
    parser.add_argument("--keep", type=Path)
    args = parser.parse_args()
    first, last = (int(part) for part in args.seeds.split(".."))
    for seed in range(first, last + 1):
        with tempfile.TemporaryDirectory() as temporary:
            folder = (args.keep / str(seed)) if args.keep else Path(temporary)
            folder.mkdir(parents=True, exist_ok=True)
            truth = write_logs(folder, seed, args.seconds, args.rate)
            if args.glitches > 0.0:
                for number, log in enumerate(("learn.csv", "held_out.csv")):
                    damage(folder / log, 1000 * seed + number, args.glitches)
            words = ["diagnose", "arm.toml", "learn.csv", "--held-out", "held_out.csv", "-o", "found.toml"]
            (folder / "found.toml").unlink(missing_ok=True)
            answer, seconds, cpu, megabytes = ask(args.btr, folder, words)
            (folder / "answer.json").write_text(json.dumps(answer, indent=1))
            said = judge(answer, truth)
            last_step = answer["error_ladder"][-1]
            print(
                f"{seed} {answer['verdict']:>17} coulomb {said['coulomb']} viscous {said['viscous']} "
                f"rotors {said['rotors']} load {'ok' if said['load_right'] else said['loads']} "
                f"coupling {'ok' if said['law_right'] else said['law']} others {said['others']} "
                f"error {last_step['train']:.3f} held out {last_step['held_out']:.3f} "
                f"rollouts {answer['rollouts']} {seconds:.1f} s "
                f"cpu {cpu:.1f} s {megabytes:.0f} MB",
                flush=True,
            )


if __name__ == "__main__":
    main()
