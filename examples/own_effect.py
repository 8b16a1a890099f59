"""A user-defined physical effect: a law as an expression, then as a function, fitted to the logs of the bundled desk
arm.

    python examples/own_effect.py

The arm's model has no friction; its logs show some. Takes about a quarter of a minute.
"""

from __future__ import annotations

import math
from pathlib import Path

import btr

ROBOTS = Path(__file__).parents[1] / "robots"
LEARN = sorted((ROBOTS / "arm").glob("learn_*.csv"))[:2]
HELD_OUT = sorted((ROBOTS / "arm").glob("held_out_*.csv"))[:1]


def friction(
    q: float, dq: float, ddq: float, cmd: float, tau: float, t: float, forward: float, backward: float
) -> float:
    """Dry friction in N·m that may differ by direction; its jump is smoothed over 0.01 rad/s."""
    return -(forward if dq > 0 else backward) * math.tanh(dq / 0.01)


def tell(what: str, fitted: btr.FitResult) -> None:
    """Prints the errors in multiples of the sensors' noise, and the law's parameters with their intervals."""
    print(f"{what}: error {fitted.train:.2f}, held out {fitted.held_out:.2f}")
    for number in fitted.parameters:
        if number["name"].startswith("formula."):
            interval = "withheld" if number["ci95"] is None else "{:.3f} .. {:.3f}".format(*number["ci95"])
            print(f"  {number['name']} = {number['value']:.3f} N·m, 95 % interval {interval}")


def main() -> None:
    arm = btr.load_model(ROBOTS / "arm.toml")
    tell("nominal model", btr.fit(arm, LEARN, held_out=HELD_OUT))

    # `a` is a free parameter between 0 and 2 N·m, `b` (in rad/s) is known. The command line can read the saved file.
    rubbing = arm.add_law("-a*tanh(dq/b)", site="yaw", a=(0.0, 2.0), b=0.01)
    tell("with an expression", btr.fit(rubbing, LEARN, held_out=HELD_OUT))

    # A function can compute anything. It is slower, so it is fitted to one log.
    either_way = arm.add_law(friction, site="yaw", forward=(0.0, 2.0), backward=(0.0, 2.0))
    tell("with a function", btr.fit(either_way, LEARN[:1], held_out=HELD_OUT))


if __name__ == "__main__":
    main()
