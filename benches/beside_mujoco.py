"""btr compared with MuJoCo: the same robots, servos, commands and time steps, one core, in alternation.

    python3 -m venv venv && venv/bin/pip install mujoco
    venv/bin/python benches/beside_mujoco.py [--rounds 20]

btr writes the robot as MJCF (masses, inertias, joints, rotor inertia, servos with their limits, shapes, floor) together
with the log of its own run; MuJoCo starts where that log starts and gets the log's commands, step by step, inside
`mujoco.rollout`, so no Python runs between its steps. Its integrator is `implicitfast`, all other settings are its
defaults. btr's figure includes whole rollouts (worlds, controllers, sensors, logs), of a single candidate and of a
population with other masses, which is simulated with SIMD. MuJoCo steps the candidates of a population one by one, so
its figure is that of one rollout. Processor time is counted, and the two alternate, so that other load on the machine
affects both; the ratio of medians is more reliable than either figure. Every scene is shown with btr's own engine
(auto) and with its reference (rapier).

The table's last columns, computed before any timing, show whether both did the same: the distance moved along x, and
the base's height at the end relative to the start; for a fixed robot, the difference of joint angles at the end.
Contact stiffness differs between all engines, so the agreement is only rough. """

import argparse
import csv
import json
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
DURATION_S = 2.0
# Robot, time step in s, candidates at once, engine.
SCENES = [
    ("nao", 0.001, 64, "auto"),
    ("nao", 0.001, 1, "auto"),
    ("nao", 0.001, 1, "rapier"),
    ("nao", 0.055 / 7, 64, "auto"),
    ("nao", 0.055 / 7, 1, "auto"),
    ("ant", 0.001, 64, "auto"),
    ("ant", 0.001, 1, "auto"),
    ("ant", 0.001, 1, "rapier"),
    ("arm", 0.001, 64, "auto"),
    ("arm", 0.001, 1, "auto"),
    ("arm", 0.001, 1, "rapier"),
]
ROLLOUTS_PER_ROUND = 2
# Maximum distance of the bases at the end (m); a base below this fraction of its height has fallen.
APART_M, FALLEN = 0.1, 0.7
# Maximum difference of joint angles of a fixed robot (rad).
APART_RAD = 0.01


def example(name, *arguments):
    """Runs one of btr's examples, built beforehand, and returns its output."""
    command = [ROOT / "target/release/examples" / name, *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


class Scene:
    """A robot in MuJoCo and in one of btr's engines."""

    def __init__(self, name, dt_s, population, engine, folder):
        self.name, self.dt_s, self.population, self.engine = name, dt_s, population, engine
        example("export_mjcf", name, engine, dt_s, DURATION_S, folder)
        self.model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
        self.data = mujoco.MjData(self.model)
        with open(folder / "log.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.log = {column: np.array([float(row[column]) for row in rows]) for column in rows[0]}
        self.start, self.commands = self.start_state(), self.all_commands()
        self.us = {"btr": [], "MuJoCo": []}

    def start_state(self):
        """The log's first row as MuJoCo's full physics state."""
        if self.floats():
            axes = ["x", "y", "z", "qw", "qx", "qy", "qz"]
            self.data.qpos[:7] = [self.log[f"base_{axis}"][0] for axis in axes]
        for joint in self.joints():
            self.data.joint(joint).qpos = self.log[f"q_{joint}"][0]
        spec = mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.empty(mujoco.mj_stateSize(self.model, spec))
        mujoco.mj_getState(self.model, self.data, state, spec)
        return state

    def floats(self):
        return "base_x" in self.log

    def joints(self):
        """The driven joints in the order of the actuators."""
        return [self.model.joint(joint).name for joint, _ in self.model.actuator_trnid]

    def all_commands(self):
        """A row per step; the log's last row is the state after the last one."""
        return np.stack([self.log[f"cmd_{joint}"][:-1] for joint in self.joints()], axis=1)

    def mujoco_rollout(self):
        """All states, a row per step: time, positions, velocities."""
        return mujoco.rollout.rollout(self.model, self.data, self.start, self.commands)[0][0]

    def time_btr(self):
        repetitions = 1 if self.population > 1 else ROLLOUTS_PER_ROUND
        printed = example("step_speed", self.name, self.engine, self.dt_s, DURATION_S, repetitions, self.population)
        self.us["btr"] += [json.loads(line)["us_per_step"] for line in printed.splitlines()]

    def time_mujoco(self):
        for _ in range(ROLLOUTS_PER_ROUND):
            begin = time.thread_time()
            self.mujoco_rollout()
            self.us["MuJoCo"].append((time.thread_time() - begin) * 1e6 / len(self.commands))

    def agreement(self):
        """The motion of both, and whether they agree."""
        last = self.mujoco_rollout()[-1]
        if not self.floats():
            apart = max(abs(self.log[f"q_{joint}"][-1] - q) for joint, q in zip(self.joints(), last[1:], strict=False))
            return f"joints apart by {apart:.1e} rad  {'same' if apart < APART_RAD else 'DIFFERENT'}"
        x, _, z = last[1:4]
        start = {axis: self.log[f"base_{axis}"][0] for axis in "xyz"}
        end = {axis: self.log[f"base_{axis}"][-1] for axis in "xyz"}
        apart = np.linalg.norm(last[1:3] - [end["x"], end["y"]])
        heights = end["z"] / start["z"], z / start["z"]
        same = apart < APART_M and min(heights) > FALLEN
        moved = f"{end['x'] - start['x']:6.3f}/{x - start['x']:6.3f}"
        return f"{moved}  {heights[0]:.2f}/{heights[1]:.2f}  {'same' if same else 'DIFFERENT'}"

    def row(self):
        cell = {engine: f"{min(us):7.1f} /{statistics.median(us):7.1f}" for engine, us in self.us.items()}
        ratio = statistics.median(self.us["btr"]) / statistics.median(self.us["MuJoCo"])
        label = f"{self.name} {self.dt_s * 1e3:.3f} ms {self.population:2} {self.engine}"
        return f"{label:24}{cell['btr']:>18}{cell['MuJoCo']:>18}{1 / ratio:8.2f}   {self.agreement()}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=20, help="rounds of both, in alternation (default: 20)")
    rounds = parser.parse_args().rounds
    build = ["cargo", "build", "--release", "--quiet", "-p", "btr-physics", "--examples"]
    subprocess.run(build, cwd=ROOT, check=True)
    with tempfile.TemporaryDirectory() as folder:
        scenes = [Scene(*scene, Path(folder)) for scene in SCENES]
    for _ in range(rounds):
        for scene in scenes:
            scene.time_btr()
            scene.time_mujoco()
    print(
        f"µs of processor time per step and candidate, minimum / median of {rounds} rounds "
        f"of rollouts of {DURATION_S:g} s; "
        f"MuJoCo {mujoco.__version__}; moved and height: btr/MuJoCo"
    )
    print(f"{'':24}{'btr':>18}{'MuJoCo':>18}{'faster':>8}   moved along x, m  height  agreement")
    for scene in scenes:
        print(scene.row())


if __name__ == "__main__":
    main()
