#!/usr/bin/env python3
"""Another simulator as the robot: an arm in MuJoCo has an effect in a joint that btr's model lacks.

    pip install . mujoco
    python examples/mujoco_reality.py [--plant coulomb_friction|armature|command_delay]

The two simulators are independent: MuJoCo reads the same URDF, with other masses and gains, uses its own time steps,
and has noisy encoders. The loop requests the motions on which simulations that explain the previous tests disagree, and
fits masses and gains to them; a large error remains. What the model lacks is then diagnosed from the real tests, added
and fitted, and evaluated on held-out motions. Takes half a minute. """

import argparse
import math
import tempfile
from pathlib import Path

import mujoco
import numpy as np

import btr

ROBOTS = Path(__file__).parents[1] / "robots"
STEP_S, NOISE_RAD, QUANTUM_RAD = 0.0001, 0.0005, 0.0017453
# Masses and gains of the robot, relative to the model file.
MASS, KP, KD = {"turret": 1.1, "upper": 0.9, "forearm": 1.15}, 1.06, 0.95
PLANTED = {"coulomb_friction": 0.25, "armature": 0.03, "command_delay": 0.02}  # N·m, kg·m², s
JOINT = "shoulder"

# Tables that turn the model file of the arm into an experiment.
LOOP = """
[drive]
kind = "sine"
omega_rad_s = 4.0
search = "all"

[fitness]
energy = 1.0

[coevolve]
method = "estimation_exploration"
iterations = 4
distance = { name = "rmse", channels = ["q_*"] }
transfer = { count = 2 }

[coevolve.controllers]
generations = 5
search = { algorithm = "ga", population = 16 }

[coevolve.simulators]
generations = 10
search = { algorithm = "cma_es" }
refine = 5
"""


class Robot:
    """The arm in MuJoCo. Called with a controller, it executes the references and returns the encoders' readings."""

    def __init__(self, planted: str, model: btr.Model) -> None:
        self.joints, self.noise = model.joints, np.random.default_rng(1)
        self.delay_s = np.zeros(len(self.joints))
        if planted == "command_delay":
            self.delay_s[self.joints.index(JOINT)] = PLANTED["command_delay"]
        spec = mujoco.MjSpec.from_file(str(ROBOTS / "arm.urdf"))
        spec.option.timestep, spec.option.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        for joint, (kp, kd) in {"yaw": (20, 0.5), "shoulder": (25, 0.6), "elbow": (12, 0.25)}.items():
            servo = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            servo.gainprm[0], servo.biastype = KP * kp, mujoco.mjtBias.mjBIAS_AFFINE
            servo.biasprm[1:3] = -KP * kp, -KD * kd
        if planted == "armature":
            spec.joint(JOINT).armature = PLANTED["armature"]
        if planted == "coulomb_friction":
            # The stiffest possible constraint: with MuJoCo's defaults a sticking joint creeps.
            joint = spec.joint(JOINT)
            joint.frictionloss = PLANTED["coulomb_friction"]
            joint.solref_friction, joint.solimp_friction = [2 * STEP_S, 1], [0.999, 0.9999, 0.0001, 0.5, 2]
        self.model = spec.compile()
        for link, factor in MASS.items():
            body = self.model.body(link)
            body.mass *= factor
            body.inertia *= factor
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))

    def __call__(self, controller: btr.Controller) -> btr.Log:
        return self.play(controller.references, controller.start)

    def play(self, references: btr.Log, start: dict[str, float]) -> btr.Log:
        """The encoders' readings at every tick for these commands, from rest at `start`."""
        data, clock_s = mujoco.MjData(self.model), references.clock_s
        commands = np.array([references[f"cmd_{joint}"] for joint in self.joints])
        data.qpos[:] = [start[joint] for joint in self.joints]
        positions, velocities, torques = (np.zeros_like(commands) for _ in range(3))
        for tick in range(len(clock_s)):
            positions[:, tick], velocities[:, tick], torques[:, tick] = data.qpos, data.qvel, data.actuator_force
            while tick + 1 < len(clock_s) and data.time < clock_s[tick + 1] - STEP_S / 2:
                arrived = np.searchsorted(clock_s, data.time - self.delay_s + 1e-9, side="right") - 1
                data.ctrl[:] = np.take_along_axis(commands, np.maximum(arrived, 0)[:, None], axis=1)[:, 0]
                mujoco.mj_step(self.model, data)
        positions += self.noise.normal(0, NOISE_RAD, positions.shape)
        read = QUANTUM_RAD * np.round(positions / QUANTUM_RAD)
        channels = {"cmd": commands, "q": read, "dq": velocities, "tau": torques}
        named = {f"{kind}_{joint}": rows[k] for kind, rows in channels.items() for k, joint in enumerate(self.joints)}
        return btr.Log(clock_s, named)


def fresh(joints: list[str], seed: int) -> btr.Log:
    """Commands that the loop has not used: sums of sines of growing amplitude."""
    rng, clock_s = np.random.default_rng(seed), np.arange(0, 4.005, 0.01)
    swell = np.minimum(clock_s / 0.5, 1)
    waves = {joint: (rng.uniform(0.1, 0.25, 4), rng.uniform(1, 9, 4), rng.uniform(0, math.tau, 4)) for joint in joints}
    commands = {
        f"cmd_{joint}": swell * sum(a * np.sin(w * clock_s + p) for a, w, p in zip(*wave))
        for joint, wave in waves.items()
    }
    return btr.Log(clock_s, commands)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plant", choices=PLANTED, default="coulomb_friction")
    planted = parser.parse_args().plant
    arm = btr.load_model(ROBOTS / "arm.toml", {"simulation.duration_s": 3.0})
    robot = Robot(planted, arm)

    print(f"planted in MuJoCo: {planted}@{JOINT} {PLANTED[planted]}")
    held_out = [robot.play(fresh(arm.joints, seed), dict.fromkeys(arm.joints, 0.0)) for seed in (1, 2)]
    with tempfile.TemporaryDirectory() as folder:
        experiment, out = btr.Model(arm.text + LOOP, arm.path), Path(folder) / "run"
        run = btr.coevolve(experiment, robot, out=out, seed=1)
        print(f"\nthe loop\n{run!r}")

        learn = [btr.load_log(path) for path in run.logs]
        found = btr.diagnose(arm, learn, held_out=held_out)
        print(f"\nwhat the model lacks, by what MuJoCo did\n{found!r}")
        if found.verdict != "effect_missing":
            return
        run = btr.coevolve(experiment.add(*found.names), robot, out=out, seed=1, resume=True)
        print(f"\nthe loop goes on with it\n{run!r}")

    fitted = btr.fit(arm, learn, held_out=held_out, add=found.names)
    print(f"\nthe arm with {', '.join(found.names)}\n{fitted!r}")


if __name__ == "__main__":
    main()
