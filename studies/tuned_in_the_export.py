#!/usr/bin/env python3
"""Is a controller better on the robot if it was tuned in the exported model instead of the original one?

    cargo build --release && maturin develop --release && python3 studies/tuned_in_the_export.py [--seeds 1..10]

Needs btr, NumPy and MuJoCo (`pip install 'btr[mujoco]'`). The arms and their hidden effects are those of
`export_round_trip.py`. The controller commands reference + lead * velocity + push * acceleration + shift in each joint,
which makes position servos follow a fast motion: nine numbers, tuned for the root mean square of what is missed, once
in the nominal MJCF file and once in the one that btr exported, with its effects. Both are then tried on the real arm. A
line per seed, in mrad.
"""

import argparse
import tempfile
from pathlib import Path

import btr
import mujoco
import numpy as np
from export_round_trip import JOINTS, RATE_HZ, identified, nominal, planted, recorded, replayed

SECONDS = 2.5
STEPS = 8
# Of lead in s, push in s^2 and shift in rad; for each joint.
DIFFERENCE = 0.003


def reference(rng):
    """A motion that begins at rest, with its velocity and acceleration: arrays of shape (times, joints)."""
    t = np.arange(int(SECONDS * RATE_HZ)) / RATE_HZ
    waves = [(rng.uniform(0.15, 0.35), rng.uniform(1.5, 5.0)) for _ in range(2 * len(JOINTS))]
    gentle = 1 - np.exp(-((t / 0.5) ** 3))
    motion = np.stack([gentle * sum(a * np.sin(w * t) for a, w in waves[k::3]) for k in range(3)], axis=1)
    velocity = np.gradient(motion, 1 / RATE_HZ, axis=0)
    return t, motion, velocity, np.gradient(velocity, 1 / RATE_HZ, axis=0)


def missed(model, effects, task, x):
    """Motion less reference, in rad: an array of shape (times * joints,)."""
    t, motion, velocity, acceleration = task
    lead, push, shift = np.reshape(x, (3, 3))
    moved = replayed(model, effects, t, motion + lead * velocity + push * acceleration + shift, motion[0])
    return (moved - motion).ravel()


def error(model, effects, task, x):
    """Its root mean square."""
    return float(np.sqrt(np.mean(missed(model, effects, task, x) ** 2)))


def tuned(model, effects, task):
    """The controller with the least error, by damped Gauss-Newton steps from the bare reference on."""
    x, damping = np.zeros(9), 1e-3
    here = missed(model, effects, task, x)
    for _ in range(STEPS):
        moved = [missed(model, effects, task, x + DIFFERENCE * unit) for unit in np.eye(9)]
        slope = (np.stack(moved, axis=1) - here[:, None]) / DIFFERENCE
        normal = slope.T @ slope
        for damping in (damping / 10, damping, 10 * damping, 100 * damping):
            step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), -slope.T @ here)
            there = missed(model, effects, task, x + step)
            if np.sum(there**2) < np.sum(here**2):
                x, here = x + step, there
                break
    return x


def case(seed, folder):
    rng = np.random.default_rng(seed)
    text = nominal()
    (folder / "robot.xml").write_text(text)
    real, beside, said = planted(rng, text)
    *learn, held_out = recorded(rng, real, beside)
    answer, fitted = identified(learn, held_out)
    exported = fitted.model.export("mujoco", folder / "robot.xml")
    exported.save(folder / "fitted.xml")
    original = mujoco.MjModel.from_xml_path(str(folder / "robot.xml"))
    model = mujoco.MjModel.from_xml_path(str(folder / "fitted.xml"))
    task = reference(rng)
    bare = error(real, beside, task, np.zeros(9))
    before = tuned(original, None, task)
    after = tuned(model, exported.effects, task)
    promised = [error(original, None, task, before), error(model, exported.effects, task, after)]
    reached = [error(real, beside, task, before), error(real, beside, task, after)]
    print(
        f"{seed:4}  planted {', '.join(said)}; found {', '.join(answer.names) or 'nothing'}; untuned {1e3 * bare:.1f}; "
        f"tuned in the original {1e3 * reached[0]:.1f} (there {1e3 * promised[0]:.1f}), "
        f"in the export {1e3 * reached[1]:.1f} (there {1e3 * promised[1]:.1f}) mrad",
        flush=True,
    )
    return reached[1] / reached[0]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1..10", help="A..B, both included")
    first, last = map(int, parser.parse_args().seeds.split(".."))
    ratios = []
    for seed in range(first, last + 1):
        with tempfile.TemporaryDirectory() as folder:
            ratios.append(case(seed, Path(folder)))
    better = sum(ratio < 1 for ratio in ratios)
    print(f"better on the robot if tuned in the export: {better} of {len(ratios)}")
    print(f"error there, as a share of that of the original's: {np.median(ratios):.2f} (median)")


if __name__ == "__main__":
    main()
