#!/usr/bin/env python3
"""Is a controller better on the robot if it was tuned in the exported model instead of the original one?

    cargo build --release && maturin develop --release && python3 studies/tuned_in_the_export.py [--seeds 1..10]

Needs btr, NumPy and MuJoCo (`pip install 'btr[mujoco]'`). The arms and their hidden effects are those of
`export_round_trip.py`. The controller commands reference + lead * velocity + push * acceleration + shift in each joint,
which makes position servos follow a fast motion: nine numbers, tuned by CMA-ES for the root mean square of what is
missed, once in the nominal MJCF file and once in the one that btr exported, with its effects; with the same budget.
Both are then tried on the real arm. A line per seed, in mrad.
"""

import argparse
import tempfile
from pathlib import Path

import btr
import mujoco
import numpy as np
from export_round_trip import JOINTS, RATE_HZ, identified, nominal, planted, recorded, replayed

SECONDS = 2.5
EVALUATIONS = 160
# Lead in s, push in s^2, shift in rad; for each joint.
BOUNDS = [(-0.02, 0.2)] * 3 + [(-0.01, 0.02)] * 3 + [(-0.15, 0.15)] * 3


def reference(rng):
    """A motion that begins at rest, with its velocity and acceleration: arrays of shape (times, joints)."""
    t = np.arange(int(SECONDS * RATE_HZ)) / RATE_HZ
    waves = [(rng.uniform(0.15, 0.35), rng.uniform(1.5, 5.0)) for _ in range(2 * len(JOINTS))]
    gentle = 1 - np.exp(-((t / 0.5) ** 3))
    motion = np.stack([gentle * sum(a * np.sin(w * t) for a, w in waves[k::3]) for k in range(3)], axis=1)
    velocity = np.gradient(motion, 1 / RATE_HZ, axis=0)
    return t, motion, velocity, np.gradient(velocity, 1 / RATE_HZ, axis=0)


def missed(model, effects, task, x):
    """Root mean square of reference less motion, in rad."""
    t, motion, velocity, acceleration = task
    lead, push, shift = np.reshape(x, (3, 3))
    moved = replayed(model, effects, t, motion + lead * velocity + push * acceleration + shift, motion[0])
    error = float(np.sqrt(np.mean((moved - motion) ** 2)))
    return error if np.isfinite(error) else np.inf


def tuned(model, effects, task, seed):
    """The controller that CMA-ES finds, from the bare reference on."""
    search = btr.search.CMAES(BOUNDS, np.zeros(9), 0.1, seed=seed, maxfevals=EVALUATIONS)
    while not search.stop():
        solutions = search.ask()
        search.tell(solutions, [missed(model, effects, task, x) for x in solutions])
    return search.result.xbest


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
    bare = missed(real, beside, task, np.zeros(9))
    before = tuned(original, None, task, seed)
    after = tuned(model, exported.effects, task, seed)
    promised = [missed(original, None, task, before), missed(model, exported.effects, task, after)]
    reached = [missed(real, beside, task, before), missed(real, beside, task, after)]
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
