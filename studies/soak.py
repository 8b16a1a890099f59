#!/usr/bin/env python3
"""Does a Python process that works for long grow? Its memory beside a million rollouts and ten thousand diagnoses.

    pip install . && python3 studies/soak.py [--rollouts 1000000] [--diagnoses 10000]

The robot is a pendulum, the cheapest that there is: rollouts of 0.1 s in batches of 1000, and diagnoses of a log of 24
samples, half of which miss an effect and half of which do not. Resident memory is sampled a hundred times in each half,
and told for tenths of it. The exit code is 1 if the mean of the last tenth is more than 1 % and 2 MB above that of the
second; the first tenth warms up. Linux only.
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import btr

MODEL = """name = "soak"
[robot]
builtin = "pendulum"
length_m = 0.5
[actuators.hinge]
kind = "position"
kp = 10.0
kd = 0.2
[simulation]
control_s = 0.01
steps_per_control = 1
sample_every = 1
duration_s = {duration_s}
[noise]
position_rad = 0.001
[drive]
kind = "sine"
omega_rad_s = 12.0
set = {{ "amplitude@hinge" = 0.5 }}
[parameters]
"mass@bob" = {{ relative = [0.5, 1.5] }}
"""
FRICTION = '[[effects]]\neffect = "coulomb_friction"\nsite = "hinge"\ntorque = 0.8\n'
BATCH, SAMPLES = 1000, 100
# Growth that is none: a share of the memory, and what an allocator takes at once, in MB.
SHARE, CONSTANT_MB = 0.01, 2.0


def resident_mb() -> float:
    """Resident memory of this process."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    raise SystemExit("VmRSS: this system does not tell it")


def rollouts(model: btr.Model, count: int) -> Callable[[], int]:
    """Simulates batches of the model; says how many rollouts were done."""
    masses = np.linspace(0.6, 1.4, min(BATCH, count))

    def some() -> int:
        return len(model.simulate_all({"mass@bob": masses}))

    return some


def diagnoses(model: btr.Model, logs: list[btr.Log]) -> Callable[[], int]:
    """Diagnoses one log after the other."""
    asked = [0]

    def one() -> int:
        log = logs[asked[0] % len(logs)]
        asked[0] += 1
        btr.diagnose(model, [log], max_effects=1, executor=1)
        return 1

    return one


def soak(what: str, work: Callable[[], int], total: int) -> bool:
    """Works until `total` is done, and tells the memory; whether it stays."""
    memory, done, began = [], 0, time.monotonic()
    while done < total:
        done += work()
        while len(memory) < SAMPLES and done * SAMPLES >= (len(memory) + 1) * total:
            memory.append(resident_mb())
    tenths = [float(np.mean(part)) for part in np.array_split(memory, 10)]
    print(f"{done} {what} in {time.monotonic() - began:.0f} s; resident memory in MB, mean of each tenth:")
    print("  " + " ".join(f"{mean:7.1f}" for mean in tenths))
    growth = tenths[-1] - tenths[1]
    stays = growth <= SHARE * tenths[1] + CONSTANT_MB
    print(f"  from the second to the last: {growth:+.2f} MB, {'which is none' if stays else 'IT GROWS'}", flush=True)
    return stays


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rollouts", type=int, default=1_000_000)
    parser.add_argument("--diagnoses", type=int, default=10_000)
    args = parser.parse_args()
    short, longer = btr.Model(MODEL.format(duration_s=0.1)), MODEL.format(duration_s=0.24)
    model, reality = btr.Model(longer), btr.Model(longer + FRICTION)
    logs = [world.simulate(seed=seed) for seed in range(8) for world in (model, reality)]
    stays = [
        soak("rollouts", rollouts(short, args.rollouts), args.rollouts),
        soak("diagnoses", diagnoses(model, logs), args.diagnoses),
    ]
    sys.exit(0 if all(stays) else 1)


if __name__ == "__main__":
    main()
