#!/usr/bin/env python3
"""Public MuJoCo models in btr: do both simulators compute the same, and what is lost?

    pip install . mujoco gymnasium gymnasium-robotics dm_control robosuite
    python studies/import_mujoco.py [--states 100] [--only panda] [--lost]

Every model ships in a package on PyPI; nothing of it is copied here. `Model.from_mujoco` imports it, and two things are
compared where constraints (contacts, limits, dry friction, equalities) are off in both, as MuJoCo's are soft:

    accelerations  in random states under random torques: the largest difference, relative to the largest acceleration
                   of the state (MuJoCo's `mj_forward`, btr's `Model.accelerations`)
    trajectory     0.5 s with the model's own actuators and random commands, held for 10 ms each, from rest: the largest
                   difference of a position, relative to the range of the motions (MuJoCo by RK4 with steps of 0.1 ms,
                   btr with steps of 1 and 0.5 ms: where only the step counts, a quarter remains). None with a
                   floating base, of which logs have no start, with actuators that btr lacks, or where MuJoCo itself
                   is unstable without constraints

`lost` is the number of things that btr cannot represent; `--lost` prints them. Where one of them acts without
constraints (a fluid, a tendon's spring, gravity compensation), accelerations differ: such models are marked with `*`.
Models that btr refuses are listed with the reason.
"""

import argparse
import importlib.util
import tempfile
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

import btr
from btr._mujoco import described

GYM, FARAMA = "gymnasium/envs/mujoco/assets", "gymnasium_robotics/envs/assets"
SUITE, ROBOTS = "dm_control/suite", "robosuite/models/assets/robots"
GRIPPERS = "robosuite/models/assets/grippers"
MODELS = [
    *(f"{GYM}/{name}.xml" for name in ("ant", "half_cheetah", "hopper", "humanoid", "inverted_double_pendulum")),
    *(f"{GYM}/{name}.xml" for name in ("reacher", "pusher_v5", "swimmer", "walker2d_v5")),
    *(f"{SUITE}/{name}.xml" for name in ("acrobot", "cartpole", "cheetah", "finger", "fish", "hopper", "humanoid")),
    *(f"{SUITE}/{name}.xml" for name in ("humanoid_CMU", "dog", "quadruped", "walker")),
    "dm_control/mujoco/testing/assets/arm.xml",
    "dm_control/locomotion/walkers/assets/rodent.xml",
    "dm_control/third_party/kinova/jaco_arm.xml",
    *(f"{ROBOTS}/{name}/robot.xml" for name in ("panda", "iiwa", "ur5e", "sawyer", "kinova3", "jaco", "xarm7")),
    *(f"{ROBOTS}/{name}/robot.xml" for name in ("baxter", "gr1", "spot", "tiago")),
    f"{GRIPPERS}/robotiq_gripper_140.xml",
    f"{GRIPPERS}/inspire_right_hand.xml",
    f"{FARAMA}/adroit_hand/adroit_relocate.xml",
    f"{FARAMA}/hand/reach.xml",
    f"{FARAMA}/fetch/reach.xml",
    "dm_control/mujoco/testing/assets/model_with_ball_joints.xml",
]
ROOTS = {"gym/pusher_v5": "r_shoulder_pan_link"}
ACTING = ("the fluid", "gravity", "the tendon", "a damping that", "a spring that", "of the base's")
DRIVING = ("the actuator", "the force of", "of the motor")
TICK_S, DURATION_S = 0.01, 0.5


@dataclass
class Row:
    """What is known of one model."""

    name: str
    joints: int = 0
    base: str = ""
    accelerations: float = np.nan
    trajectory: tuple[float, float] = (np.nan, np.nan)
    lost: tuple[str, ...] = ()
    refused: str = ""

    @property
    def acts(self) -> bool:
        """Whether something acts without constraints that btr does not have."""
        return any(mark in what and "no force" not in what for what in self.lost for mark in ACTING)

    def line(self) -> str:
        if self.refused:
            return f"{self.name:<34} refused: {self.refused}"
        errors = "  ".join(f"{error:8.1e}" for error in self.trajectory).replace("nan", "  -")
        found = f"{self.accelerations:8.1e}{'*' if self.acts else ' '} {errors}"
        return f"{self.name:<34}{self.joints:>4} {self.base:<9}{found}{len(self.lost):>6}"


def path_of(name: str) -> Path:
    """The file of a model in the package that ships it, which is not imported."""
    package, _, inside = name.partition("/")
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        raise SystemExit(f"{package} is not installed: see the head of this file")
    return Path(spec.origin).parent / inside


def short(name: str) -> str:
    package, *folders, file = Path(name).with_suffix("").parts
    named = {"robot": folders[-1], "reach": f"{folders[-1]}_reach"}
    return f"{package.replace('gymnasium', 'gym')}/{named.get(file, file)}"


class Both:
    """One model in both simulators, without constraints."""

    def __init__(self, name: str, folder: Path) -> None:
        self.mj = mujoco.MjModel.from_xml_path(str(path_of(name)))
        self.mj.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.lost = tuple(btr.Model.from_mujoco(self.mj, root=ROOTS.get(short(name))).not_represented)
        # In the pair that is compared, btr has no limits, friction, shapes and followers either.
        self.mj.jnt_limited[:], self.mj.dof_frictionloss[:], self.mj.eq_active0[:] = 0, 0, 0
        self.mj.geom_contype[:], self.mj.geom_conaffinity[:] = 0, 0
        self.robot = described(self.mj, ROOTS.get(short(name)))
        self.model = btr.Model.from_mujoco(self.mj, root=ROOTS.get(short(name)))
        self.file = folder / "model.toml"
        self.model.save(self.file)
        self.data = mujoco.MjData(self.mj)
        names = [self.mj.joint(j).name for j in range(self.mj.njnt)]
        by_name = {name or f"joint{j}": j for j, name in enumerate(names)}
        self.order = np.array([by_name[joint] for joint in self.model.joints], dtype=int)
        self.qpos, self.dofs = self.mj.jnt_qposadr[self.order], self.mj.jnt_dofadr[self.order]
        self.floats = self.robot["base"] == "floating"
        free = [j for j in range(self.mj.njnt) if self.mj.jnt_type[j] == 0]
        self.free = free[0] if self.floats else -1

    def accelerations(self, rng: np.random.Generator) -> float:
        """The relative difference of accelerations in a random state."""
        mj, data, many = self.mj, self.data, len(self.order)
        mujoco.mj_resetData(mj, data)
        q, dq = data.qpos[self.qpos] + rng.uniform(-1.5, 1.5, many), rng.normal(0, 3, many)
        scale = float(np.sum(mj.body_mass))
        torques, base = rng.normal(0, scale, many), None
        data.qpos[self.qpos], data.qvel[self.dofs], data.qfrc_applied[self.dofs] = q, dq, torques
        if self.floats:
            place, dof = mj.jnt_qposadr[self.free], mj.jnt_dofadr[self.free]
            turn = rng.normal(size=4)
            turn /= np.linalg.norm(turn)
            rotation = np.empty(9)
            mujoco.mju_quat2Mat(rotation, turn)
            rotation = rotation.reshape(3, 3)
            pose, linear, angular = np.array([*rng.normal(size=3), *turn]), rng.normal(size=3), rng.normal(0, 3, 3)
            data.qpos[place : place + 7] = pose
            data.qvel[dof : dof + 6] = [*linear, *(rotation.T @ angular)]
            base = (pose, np.array([*linear, *angular]))
        mj.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
        mujoco.mj_forward(mj, data)
        mj.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
        expected = data.qacc[self.dofs]
        if self.floats:
            expected = np.array([*(rotation @ data.qacc[dof + 3 : dof + 6]), *data.qacc[dof : dof + 3], *expected])
        found = self.model.accelerations(q, dq, torques, base=base)
        return float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))

    def commands(self, rng: np.random.Generator) -> np.ndarray:
        """Controls at every tick: sums of slow sines within the controls' ranges."""
        ticks = np.arange(round(DURATION_S / TICK_S) + 1) * TICK_S
        waves = [np.sin(2 * np.pi * rng.uniform(0.3, 1.5) * ticks) for _ in range(self.mj.nu)]
        middle, half = np.zeros(self.mj.nu), np.full(self.mj.nu, 0.05)
        limited = self.mj.actuator_ctrllimited.astype(bool)
        low, high = self.mj.actuator_ctrlrange[limited].T
        middle[limited] = np.clip(0, low, high)
        half[limited] = 0.05 * np.minimum(np.maximum(high, 0), np.maximum(-low, 0))
        return middle[:, None] + half[:, None] * np.array(waves).reshape(self.mj.nu, len(ticks))

    def reference(self, controls: np.ndarray) -> np.ndarray:
        """MuJoCo's positions at every tick, with fine steps of RK4."""
        mj, data = self.mj, self.data
        mj.opt.timestep, mj.opt.integrator = 0.0001, mujoco.mjtIntegrator.mjINT_RK4
        mujoco.mj_resetData(mj, data)
        rows = []
        for tick in range(controls.shape[1]):
            rows.append(data.qpos[self.qpos].copy())
            data.ctrl[:] = controls[:, tick]
            for _ in range(round(TICK_S / mj.opt.timestep)):
                mujoco.mj_step(mj, data)
        unstable = data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0
        return np.array(rows).T if not unstable else np.full((len(self.order), controls.shape[1]), np.nan)

    def simulated(self, log: btr.Log, step_s: float) -> np.ndarray:
        """btr's positions at every tick."""
        steps = round(TICK_S / step_s)
        settings = {"simulation.control_s": TICK_S, "simulation.steps_per_control": steps}
        run = btr.load_model(self.file, settings).simulate(log)
        return np.array([np.asarray(run[f"q_{joint}"])[::steps] for joint in self.model.joints])

    def trajectory(self, rng: np.random.Generator) -> tuple[float, float]:
        """The relative differences of positions, with two steps of btr."""
        controls = self.commands(rng)
        positions = self.reference(controls)
        if np.isnan(positions).any():
            return np.nan, np.nan
        channels = {}
        for joint, row in zip(self.model.joints, positions):
            command = self.robot["joints"][joint].get("command") or {}
            # btr smooths the beginning of a log: what stands still begins where it is.
            channels[f"q_{joint}"] = np.full_like(row, row[0])
            channels[f"dq_{joint}"] = np.zeros_like(row)
            actuator = self.actuator_of(joint, command)
            if actuator is not None:
                factor, offset = command.get("factor", 1.0), command.get("offset", 0.0)
                channels[f"cmd_{joint}"] = factor * controls[actuator] + offset
            else:
                channels[f"cmd_{joint}"] = np.zeros_like(row)
        log = btr.Log(np.arange(controls.shape[1]) * TICK_S, channels)
        motion = float(np.max(np.ptp(positions, axis=1)))
        errors = []
        for step_s in (0.001, 0.0005):
            found = self.simulated(log, step_s)
            many = min(found.shape[1], positions.shape[1])
            errors.append(float(np.max(np.abs(found[:, :many] - positions[:, :many])) / motion))
        return errors[0], errors[1]

    def actuator_of(self, joint: str, command: dict) -> int | None:
        if self.robot["joints"][joint]["actuator"]["kind"] == "passive":
            return None
        index = self.order[self.model.joints.index(joint)]
        return next(a for a in range(self.mj.nu) if self.mj.actuator_trnid[a][0] == index)


def row_of(name: str, states: int) -> Row:
    row, rng = Row(short(name)), np.random.default_rng(7)
    with tempfile.TemporaryDirectory() as folder:
        try:
            both = Both(name, Path(folder))
        except btr.BtrError as error:
            row.refused = str(error).partition("\n")[0]
            return row
        row.joints, row.base, row.lost = len(both.order), both.robot["base"], both.lost
        row.accelerations = max(both.accelerations(rng) for _ in range(states))
        if not both.floats and not any(what.startswith(DRIVING) for what in row.lost):
            row.trajectory = both.trajectory(rng)
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--states", type=int, default=100)
    parser.add_argument("--only", default="", help="models whose name contains this")
    parser.add_argument("--lost", action="store_true", help="print what is not represented")
    args = parser.parse_args()
    print(f"{'model':<34}{'joints':>4} base     accelerations  trajectory 1 and 0.5 ms  lost")
    rows = []
    for name in MODELS:
        if args.only in short(name):
            rows.append(row_of(name, args.states))
            print(rows[-1].line(), flush=True)
            for what in rows[-1].lost if args.lost else ():
                print(f"      {what}")
    whole = [row for row in rows if not row.refused and not row.acts]
    agree = sum(row.accelerations < 1e-9 for row in whole)
    print(f"\nwithin 1e-9 where all that acts is represented: {agree} of {len(whole)}")


if __name__ == "__main__":
    main()
