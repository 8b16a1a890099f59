#!/usr/bin/env python3
"""Arms of motion and torque that btr has never seen: does `btr diagnose` name what their URDF lacks, and nothing else?

    cargo build --release && python3 studies/foreign_arms.py --seeds 0..29 [--jobs 1] [--threads 1] [--out all.json]

Needs NumPy and MuJoCo (`pip install numpy mujoco`), whose inverse dynamics gives the rigid torques. A seed is an arm of
2 to 6 joints, its noise, two logs, and in some of them 2 s at rest, where friction is any torque up to Coulomb's. At
each joint are hidden, with a probability of the arm of 0, 0.5 or 1, Coulomb friction, viscous friction and a rotor
(`c`, `v`, `r`); and with equal chances a load, a link heavier than stated, a motor of the last two joints, or nothing.

A line per arm: outcome, seed, axes, rate, standstill, what is hidden -> what is named, verdict, the held-out error
before, the error learnt -> held out after, in noise floors. Outcomes: exact; alike (declared so, or the same on this
arm); partial (some is missing); extra (all, and more); wrong (some is missing, some is wrong); quiet and false_alarm,
where nothing is hidden. `~` marks what is less than the smoothed noise of the torque and may be named or not; `?` what
is missing, with its size in btr's noise floors; `!` a wrong name, with its probability.
"""

import argparse
import json
import subprocess
import tempfile
from collections import Counter, abc
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import mujoco
import numpy as np

from asking import BTR, quartiles

MODEL = 'name = "arm"\n[robot]\nurdf = "arm.urdf"\nbase = "fixed"\n[actuators."*"]\nkind = "prescribed"\n'
SHORT = {"coulomb_friction": "c", "viscous_friction": "v", "armature": "r"}
UNITS = dict(zip("xyz", np.eye(3)))
rms = lambda values: np.sqrt(np.mean(values**2, axis=0))  # noqa: E731
numbers = lambda values: " ".join(f"{value:.9g}" for value in values)  # noqa: E731
REST_S, RAMP_S = 2.0, 0.8
# Shares of the torque's noise: an effect below the first is invisible, rotors and coupled motors are above the second.
FAINT, SEEN, CONFIDENT, RIGHT = 20**-0.5, 5 * 50**-0.5, 0.95, 0.05


class Arm:
    """An arm as its URDF states it; each link extends along z, or along x where z would put two joints on one line."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.joints = n = int(rng.integers(2, 7))
        self.axes = "".join([rng.choice(list("zy")), *rng.choice(list("xyz"), n - 1)])
        self.masses = np.geomspace(rng.uniform(3.0, 12.0), rng.uniform(0.3, 2.0), n) * rng.uniform(0.85, 1.15, n)
        self.ends, self.coms, self.inertias = [], [], []
        for k, length in enumerate(rng.uniform(0.1, 0.5, n)):
            pair = self.axes[k : k + 2]
            unit = UNITS["x" if pair == "zz" or rng.random() < 0.2 and pair[1:] != "x" else "z"]
            aside = (1 - unit) * rng.uniform(-1, 1, 3)
            self.ends.append(length * unit + 0.1 * length * aside * (rng.random() < 0.5))
            self.coms.append(rng.uniform(0.35, 0.6) * length * unit + rng.uniform(0.01, 0.03) * aside)
            box = np.where(unit > 0, length, rng.uniform(0.15, 0.4, 3) * (0.1 + 0.3 * length))
            turn = np.linalg.qr(np.eye(3) + 0.2 * rng.standard_normal((3, 3)))[0]
            self.inertias.append(turn @ np.diag(np.sum(box**2) - box**2) @ turn.T * self.masses[k] / 12)
        self.reach, self.along = length, unit

    def urdf(self, factors: np.ndarray | float = 1.0, load: tuple[float, np.ndarray] | None = None) -> str:
        """With the masses times these factors, and a load (kg, place in the last link) fixed to the last link."""
        out, ends = ['<robot name="arm"><link name="link_0"/>'], [np.array([0, 0, 0.1]), *self.ends]
        for k, factor in enumerate(factors * np.ones(self.joints)):
            # As btr's mass of a link: another density, so that its inertia grows as well.
            inertial = factor * self.masses[k], self.coms[k], factor * self.inertias[k]
            axis = f'<axis xyz="{numbers(UNITS[self.axes[k]])}"/><limit lower="-6" upper="6" effort="99" velocity="9"/>'
            out.append(body(f"link_{k}", f"link_{k + 1}", *inertial, f'joint_{k + 1}" type="revolute', ends[k], axis))
        if load:
            inertial = load[0], np.zeros(3), 1e-7 * np.eye(3)
            out.append(body(f"link_{self.joints}", "load", *inertial, 'grip" type="fixed', load[1], ""))
        return "\n".join([*out, "</robot>\n"])


def body(parent: str, name: str, mass: float, com: np.ndarray, inertia: np.ndarray, *joint) -> str:
    """A link and the joint (name with type, place, more) before it."""
    moments = " ".join(f'i{"xyz"[a]}{"xyz"[b]}="{inertia[a, b]:.9g}"' for a in range(3) for b in range(a, 3))
    return f"""<link name="{name}"><inertial><origin xyz="{numbers(com)}"/><mass value="{mass:.9g}"/>
    <inertia {moments}/></inertial></link><joint name="{joint[0]}"><parent link="{parent}"/><child link="{name}"/>
    <origin xyz="{numbers(joint[1])}"/>{joint[2]}</joint>"""


def rigid(urdf: str, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """The torques that a motion requires of the rigid links, whose limits do not push."""
    model = mujoco.MjModel.from_xml_string(urdf)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data, tau = mujoco.MjData(model), np.empty_like(q)
    for row, moves in enumerate(zip(q, dq, ddq)):
        data.qpos[:], data.qvel[:], data.qacc[:] = moves
        mujoco.mj_inverse(model, data)
        tau[row] = data.qfrc_inverse
    return tau


class Motion:
    """Sums of three to five sines per joint about a posture; for a standstill, their time slows down and stops."""

    def __init__(self, rng: np.random.Generator, posture: np.ndarray, seconds: float, rate: float, stops: bool) -> None:
        self.t = np.arange(round(seconds * rate)) / rate
        s, r, dr = self.t, np.ones_like(self.t), np.zeros_like(self.t)
        begin = rng.uniform(1.0, seconds - REST_S - 2 * RAMP_S - 1.0)
        for sign, at in ((-1, begin), (1, begin + RAMP_S + REST_S)) if stops else ():
            # The smooth step 6u^5 - 15u^4 + 10u^3, its integral and its derivative.
            u = np.clip((self.t - at) / RAMP_S, 0, 1)
            s = s + sign * (RAMP_S * (u**6 - 3 * u**5 + 2.5 * u**4) + np.maximum(self.t - at - RAMP_S, 0))
            r, dr = r + sign * u**3 * (6 * u * u - 15 * u + 10), dr + sign * 30 * (u * (1 - u)) ** 2 / RAMP_S
        self.moving = r > 1e-12
        self.q, self.dq, self.ddq = (np.zeros((len(s), len(posture))) for _ in range(3))
        for joint, middle in enumerate(posture):
            f = rng.uniform(0.1, 0.8, rng.integers(3, 6))
            a = rng.uniform(0.4, 1.0, len(f)) * 0.13 / f**0.7
            a, w = a * min(1.0, 1.6 / a.sum()), 2 * np.pi * f
            angle = np.outer(s, w) + rng.uniform(0, 2 * np.pi, len(f))
            speed, change = np.cos(angle) @ (a * w), -np.sin(angle) @ (a * w * w)
            self.q[:, joint], self.dq[:, joint] = middle + np.sin(angle) @ a, self.moving * speed * r
            self.ddq[:, joint] = self.moving * (change * r * r + speed * dr)

    def dry(self, rng: np.random.Generator, speed: np.ndarray) -> np.ndarray:
        """Dry friction of size one: the direction of motion, and at rest any torque that it holds."""
        return np.where(self.moving, np.sign(speed), np.interp(self.t, self.t[[0, -1]], rng.uniform(-1, 1, 2)))


class Hidden:
    """What the arm has and its URDF lacks, in sizes that show beside the noise of the torques (shares of their rms)."""

    def __init__(self, rng: np.random.Generator, arm: Arm, motion: Motion, shares: np.ndarray, nothing: bool) -> None:
        forces, n = rigid(arm.urdf(), motion.q, motion.dq, motion.ddq), arm.joints
        self.arm, self.shared, self.factors, self.load = arm, np.zeros(3), np.ones(n), None
        self.noise = noise = shares * rms(forces)
        torque, speed, change = (rms(of[motion.moving]) for of in (forces, motion.dq, motion.ddq))
        # What each joint moves if the others rest, averaged over postures.
        q, still = motion.q[::200], 0 * motion.q[::200]
        pushed = [rigid(arm.urdf(), q, still, still + one).mean(0) for one in np.eye(n)]
        inertia = np.diag(pushed - rigid(arm.urdf(), q, still, still).mean(0))
        chance = 0.0 if nothing else rng.choice([0.0, 0.5, 1.0])
        more = "" if nothing else rng.choice(["", "load", "mass", "coupling"])
        spans = ((0.02, 0.15), (0.02, 0.15), (0.05, 0.4))
        drawn = [rng.uniform(*span, n) * (rng.random(n) < chance) for span in spans]
        self.coulomb, self.viscous = drawn[0] * torque, drawn[1] * torque / speed
        self.rotor = np.where(drawn[2] > 0, np.maximum(drawn[2] * inertia, SEEN * noise / change), 0.0)
        if more == "load":
            across = (1 - arm.along) * rng.standard_normal(3)
            aside = rng.uniform(0.02, 0.15) * across / np.linalg.norm(across)
            self.load = rng.uniform(0.3, 2.0) * arm.masses[-1], rng.uniform(0.2, 1.0) * arm.reach * arm.along + aside
        elif more == "mass":
            # About a vertical first axis, the first link's mass is nothing but a rotor.
            self.factors[rng.integers(arm.axes[0] == "z", n)] = rng.uniform(1.2, 1.6)
        elif more == "coupling":
            self.shared = rng.uniform(*np.transpose(spans)) * (torque[-1], torque[-1] / speed[-1], inertia[-1])
            shown = self.shared @ (np.sign(motion.dq[:, -2:].sum(1)), motion.dq[:, -1], motion.ddq[:, -1])
            # Larger if the joint before does not show it, but still a motor of the last joint's size.
            self.shared *= np.clip(SEEN * noise[-2] / rms(shown[motion.moving]), 1, 3)

    def laws(self, rng: np.random.Generator, motion: Motion) -> abc.Iterator[tuple[str, str, float, int, np.ndarray]]:
        """Names of effects at joints, a parameter with its value, the joint, and the torque."""
        n, dry = self.arm.joints, np.column_stack([motion.dry(rng, speed) for speed in motion.dq.T])
        # A coupled motor's drag and inertia are also viscous friction and a rotor of both joints.
        both, both_dry = (np.arange(n) >= n - 2) * 1.0, motion.dry(rng, motion.dq[:, -2:].sum(1))
        drag, rotor = self.viscous + both * self.shared[1], self.rotor + both * self.shared[2]
        laws = ("torque", self.coulomb, dry), ("coefficient", drag, motion.dq), ("inertia", rotor, motion.ddq)
        for effect, (parameter, sizes, law) in zip(SHORT, laws):
            for j in np.flatnonzero(sizes):
                yield f"{effect}@joint_{j + 1}", f".{parameter}@", sizes[j], j, sizes[j] * law[:, j]
        for effect, j, other in (("parent_coupling", n - 1, n - 2), ("child_coupling", n - 2, n - 1)):
            if self.shared.any():
                torque = self.shared @ (both_dry, motion.dq[:, other], motion.ddq[:, other])
                yield f"{effect}@joint_{j + 1}", ".coulomb@", self.shared[0], j, torque

    def torques(self, rng: np.random.Generator, motion: Motion) -> np.ndarray:
        """With noise; takes down each name's torque at the joints while they move (rms), and the true values."""
        n, self.shows, self.true, moves = self.arm.joints, {}, {}, (motion.q, motion.dq, motion.ddq)
        tau = rigid(self.arm.urdf(self.factors, self.load), *moves)
        changed = tau - rigid(self.arm.urdf(), *moves)
        heavier = [(k, f * self.arm.masses[k]) for k, f in enumerate(self.factors) if f > 1]
        laws = [(f"mass@link_{k + 1}", "@", mass, changed) for k, mass in heavier]
        laws += [(f"tool_load@link_{n}", ".mass@", self.load[0], changed)] if self.load else []
        for name, parameter, value, j, torque in self.laws(rng, motion):
            tau[:, j] += torque
            laws.append((name, parameter, value, np.outer(torque, np.eye(n)[j])))
        for name, parameter, value, torque in laws:
            self.shows[name], self.true[name.replace("@", parameter)] = rms(torque[motion.moving]), float(value)
        return tau + self.noise * rng.standard_normal(tau.shape)

    def twins(self, name: str) -> set[str]:
        """Names that are the same on this arm, whatever it does: the first link only turns about its axis."""
        groups = [{"armature@joint_1", "link_inertia@link_1", "inertia@link_1"}]
        if self.arm.axes[0] == "z":
            groups[0] |= {"payload@link_1", "com_offset@link_1", "mass@link_1"}
        if "armature@joint_1" in self.shows:
            # That rotor takes what differs in the inertia about the first axis.
            groups += [{"mass@link_1", "payload@link_1"}]
            groups += [{"armature@joint_2", "link_inertia@link_2"}] * (self.arm.axes[0] != self.arm.axes[1])
        return set().union(*(group for group in groups if name in group))


def write(folder: Path, seed: int, nothing: bool) -> tuple[Hidden, dict]:
    """Writes URDF, model and logs; what is hidden, and facts about the arm."""
    arm = Arm(rng := np.random.default_rng(seed))
    rate, stops, posture = float(rng.choice([200, 500, 1000])), rng.random() < 0.4, rng.uniform(-0.8, 0.8, arm.joints)
    longs = {"held_out": rng.uniform(8, 15), "learn": rng.uniform(15, 40)}
    motions = {name: Motion(rng, posture, seconds, rate, stops) for name, seconds in longs.items()}
    shares, encoders = rng.uniform(0.005, 0.02, arm.joints), rng.uniform(1e-5, 5e-5, arm.joints)
    hidden = Hidden(np.random.default_rng([seed, 1]), arm, motions["learn"], shares, nothing)
    header = ",".join(["t", *(f"{channel}_joint_{k + 1}" for channel in ("q", "tau") for k in range(arm.joints))])
    for name, motion in motions.items():
        q = motion.q + encoders * rng.standard_normal(motion.q.shape)
        rows = np.column_stack([motion.t, q, hidden.torques(rng, motion)])
        np.savetxt(folder / f"{name}.csv", rows, "%.9g", ",", header=header, comments="")
    (folder / "arm.urdf").write_text(arm.urdf())
    (folder / "arm.toml").write_text(MODEL)
    return hidden, {"seed": seed, "axes": arm.axes, "rate": rate, "rest": bool(stops)}


def judge(answer: dict, hidden: Hidden) -> dict:
    """The outcome, with what is missing, what is wrong, and what the intervals hold."""
    named, declared, values, ladder = {}, {}, {}, answer["error_ladder"]
    for effect in answer["effects"] + [{"effect": value["value"], **value} for value in answer["wrong_values"]]:
        for site in effect["site"] if isinstance(effect["site"], list) else [effect["site"]]:
            named[f"{effect['effect']}@{site}"] = effect["probability"] or 0.0
            declared[f"{effect['effect']}@{site}"] = {part for name in effect["alike"] for part in name.split(" + ")}
        values |= {p["name"]: p for p in effect["parameters"]}
    sigma = np.array([floor["sigma"] for floor in answer["noise_floor"] if floor["channel"].startswith("tau_")])
    faint = {name for name, shows in hidden.shows.items() if np.max(shows / hidden.noise) < FAINT}
    absent, wrong, instead = hidden.shows.keys() - named.keys(), set(), set()
    for name in named.keys() - hidden.shows.keys():
        both = {name.replace("asymmetric", part) for part in ("coulomb", "viscous")}
        meant = absent & (declared[name] | hidden.twins(name) | (both if both <= hidden.shows.keys() else set()))
        instead, wrong = instead | meant, wrong | (set() if meant else {name})
    missing = absent - faint - instead
    found = ("wrong", "partial") if missing else ("extra", "alike" if instead - faint else "exact")
    outcome = (found if hidden.shows.keys() - faint else ("false_alarm", "quiet"))[not wrong]
    checked = [(values[name], true) for name, true in hidden.true.items() if name in values]
    within = [p["ci95"][0] <= true <= p["ci95"][1] for p, true in checked if p["ci95"] and None not in p["ci95"]]
    floors = {name: round(float(np.max(shows / sigma)), 2) for name, shows in hidden.shows.items()}
    return {
        "outcome": outcome, "hidden": floors, "true": hidden.true, "named": named, "faint": sorted(faint),
        "missing": sorted(missing), "wrong": sorted(wrong), "alike": sorted(instead), "intervals": len(within),
        "confident_wrong": sorted(name for name in wrong if named[name] >= CONFIDENT), "held": sum(within),
        "checked": len(checked), "right": sum(abs(p["value"] / true - 1) <= RIGHT for p, true in checked),
        "before": ladder[0]["held_out"], "learnt": ladder[-1]["train"], "after": ladder[-1]["held_out"],
        **{key: answer[key] for key in ("verdict", "rollouts", "seconds")},
    }


def one_arm(seed: int, btr: str, threads: int, keep: Path, nothing: bool) -> dict:
    (folder := keep / str(seed)).mkdir(parents=True, exist_ok=True)
    hidden, facts = write(folder, seed, nothing)
    words = f"diagnose arm.toml learn.csv --held-out held_out.csv --json -q --threads {threads}".split()
    done = subprocess.run([btr, *words], cwd=folder, capture_output=True, text=True)
    (folder / "answer.json").write_text(done.stdout)
    if not (answer := json.loads(done.stdout or '{"ok": false}'))["ok"]:
        raise SystemExit(f"{seed}: {done.stdout}{done.stderr}")
    return {**facts, **judge(answer, hidden)}


def line(said: dict) -> str:
    def short(marks: dict[str, str]) -> str:
        grouped: dict[str, str] = {}
        for name, mark in sorted(marks.items()):
            effect, site = name.split("@")
            key, value = (SHORT[effect], site.split("_")[-1]) if effect in SHORT else (name, "")
            grouped[key] = grouped.get(key, "") + value + mark
        return " ".join(key + text for key, text in grouped.items()) or "-"

    marks = dict.fromkeys(said["hidden"], "") | dict.fromkeys(said["faint"], "~")
    hidden = short(marks | {name: f"?{said['hidden'][name]:.1f} " for name in said["missing"]})
    named = short({name: f"!{p:.2f} " if name in said["wrong"] else "" for name, p in said["named"].items()})
    arm = f"{said['seed']:>4} {said['axes']:<6} {said['rate']:4.0f} Hz {'rest' * said['rest']:<4}"
    errors = f"{said['before']:.2f}, {said['learnt']:.3f} -> {said['after']:.3f}, {said['rollouts']} rollouts"
    return f"{said['outcome']:<11} {arm} {hidden} -> {named} [{said['verdict']}] {errors}, {said['seconds']:.1f} s"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--btr", default=BTR)
    parser.add_argument("--seeds", default="0..9", help="A..B, both included")
    parser.add_argument("--nothing", action="store_true", help="hide nothing")
    parser.add_argument("--jobs", type=int, default=1, help="arms at a time")
    parser.add_argument("--threads", type=int, default=1, help="threads of btr for each arm")
    parser.add_argument("--keep", type=Path, help="where to keep models, logs and answers")
    parser.add_argument("--out", type=Path, help="where to write all outcomes as JSON")
    args, arms = parser.parse_args(), []
    first, last = map(int, args.seeds.split(".."))
    with tempfile.TemporaryDirectory() as temporary, ProcessPoolExecutor(args.jobs) as pool:
        settings = {"btr": args.btr, "threads": args.threads, "keep": args.keep or Path(temporary)}
        for said in pool.map(partial(one_arm, nothing=args.nothing, **settings), range(first, last + 1)):
            print(line(said), flush=True)
            arms.append(said)
            if args.out:
                args.out.write_text(json.dumps(arms, indent=1))
    of = {key: [said[key] for said in arms] for key in arms[0]}
    counts = ", ".join(f"{outcome} {count}" for outcome, count in Counter(of["outcome"]).most_common())
    spent = ", ".join(f"{key} {quartiles(of[key])[1]:.0f} (most {max(of[key]):.0f})" for key in ("rollouts", "seconds"))
    print(f"{len(arms)} arms: {counts}; {sum(map(len, of['confident_wrong']))} confident wrong names; median {spent}")
    values = [f"{sum(of[some])} of {sum(of[all_])}" for some, all_ in (("held", "intervals"), ("right", "checked"))]
    print("95 % intervals hold {} planted values; {} are within 5 %".format(*values))


if __name__ == "__main__":
    main()
