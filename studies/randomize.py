#!/usr/bin/env python3
"""Do the draws of a fit contain the robot?

    cargo build --release && maturin develop --release && python3 studies/randomize.py [--seeds 1..20]

Needs btr and NumPy. Reality is the desk arm of `robots/arm.toml` with masses and gains within its bounds and a Coulomb
friction in the yaw joint, simulated by btr with the noise of its encoders. It is fitted twice: with the friction, so
that the error left is noise, and without it, so that the other values stand in for it. Printed is how many of the true
values lie within the middle 95 % of `FitResult.draws`, and how wide that is as a share of the bounds, for both.
"""

import argparse
from pathlib import Path

import btr
import numpy as np

ARM = Path(__file__).resolve().parent.parent / "robots" / "arm.toml"
LOGS = sorted((ARM.parent / "arm").glob("learn_*.csv"))[:2]
FRICTION = "coulomb_friction.torque@yaw"


def covered(fitted, truth):
    """Whether each true value is within the middle 95 % of the draws, and how wide that is as a share of the bounds."""
    drawn, bounds = fitted.draws(400), {p.name: (p.min, p.max) for p in fitted.space}
    within, widths = [], []
    for name, values in drawn.items():
        low, high = np.quantile(values, [0.025, 0.975])
        within.append(low <= truth[name] <= high)
        if name != FRICTION:
            widths.append((high - low) / (bounds[name][1] - bounds[name][0]))
    return within, widths


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1..20", help="A..B, both included")
    first, last = map(int, parser.parse_args().seeds.split(".."))
    model = btr.load_model(ARM)
    found = {"with the friction": ([], [], []), "without it": ([], [], [])}
    for seed in range(first, last + 1):
        rng = np.random.default_rng(seed)
        truth = {p.name: float(p.min + (p.max - p.min) * rng.uniform(0.2, 0.8)) for p in model.parameters}
        truth[FRICTION] = float(rng.uniform(0.15, 0.35))
        reality = model.add("coulomb_friction@yaw").at(truth)
        logs = []
        for k, path in enumerate(LOGS):
            commands = btr.load_log(path)
            logs.append(reality.simulate(commands, seed=100 * seed + k))
        for what, add in [("with the friction", ["coulomb_friction@yaw"]), ("without it", [])]:
            fitted = btr.fit(model, logs, add=add)
            within, widths = covered(fitted, truth)
            for kept, new in zip(found[what], (within, widths, [fitted.train])):
                kept.extend(new)
    for what, (within, widths, errors) in found.items():
        print(
            f"fitted {what}: {np.median(errors):.2f} noise floors; {sum(within)} of {len(within)} true values within "
            f"the middle 95 % ({np.mean(within):.3f}), which is {np.median(widths):.2f} of the bounds wide (median)"
        )


if __name__ == "__main__":
    main()
