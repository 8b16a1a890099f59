#!/usr/bin/env python3
"""Effects hidden in robots that btr has never seen, simulated by MuJoCo: what does `btr diagnose` say?

    cargo build --release && python3 -m venv target/venv && target/venv/bin/pip install mujoco
    target/venv/bin/python studies/foreign_robots.py --cases 60 [--kinds one,none] [--effects backlash] [--out all.json]

A seed is a case, whatever else is asked for: a robot of 2 to 7 joints (geometry, masses, rotors, soft or stiff servos,
mounted up, down or sideways), what its user knows of it (masses and gains within 10 to 20 %), logs (multisine, steps,
slow ramps, teleoperation; 18 to 500 Hz; 5 to 40 s), and what is hidden in them:

    one        an effect of btr's library
    two        two of them
    none       nothing
    outside    something that the library lacks
    constants  a constant that the model has wrong: rotor, mass, gain, length, centre of mass

MuJoCo keeps its defaults for solver, limits and dry friction, which is soft and creeps. It integrates by RK4, with its
default step of 2 ms where the clock and the effect allow: with its first-order integrators its own error is 0.3 to 6
noise floors, and btr finds that. `--integrator Euler` shows it. The size of an effect is chosen by the difference that
it makes in the readings: 2 to 40 noise floors.

A line per case: score, seed, what is hidden -> what btr names (with its probability), its verdict, and the held-out
error before -> after; `truth` is the error of btr's own model with the true constants and effects, about 1 if the
generator is right. `!` marks a wrong name with a probability of 0.95 or more, `=` an answer that fits the logs as well
as the truth does. To look into a case: `--keep DIR --only SEED` writes its files and asks btr.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from asking import BTR
from foreign.cases import build, plan, write
from foreign.glitches import damage
from foreign.score import Btr, Outcome, judge
from foreign.sizes import CONSTANTS, EFFECTS, OUTSIDE
from foreign.tables import draw, summary

KINDS = ("one", "two", "none", "outside", "constants")


def one_case(
    seed: int, btr: Btr, keep: Path | None, integrator: str, shows: tuple[float, float] | None, glitches: float
) -> Outcome:
    """A case from its seed to its score."""
    began = time.process_time()
    with tempfile.TemporaryDirectory() as temporary:
        folder = keep / str(seed) if keep else Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        case = build(seed, integrator, shows)
        files = write(case, folder)
        for number, log in enumerate(files.learn + files.held_out if glitches > 0.0 else []):
            damage(log, 1000 * seed + number, glitches)
        outcome = judge(btr, case, files, time.process_time() - began)
        (folder / "outcome.json").write_text(json.dumps(dataclasses.asdict(outcome), indent=1))
    return outcome


def seeds(first: int, count: int, kinds: list[str], effects: list[str]) -> Iterator[int]:
    """Seeds from the first on whose cases are of these kinds and hide one of these effects."""
    seed = first
    while count > 0:
        kind, hidden = plan(seed)
        if kind in kinds and (not effects or set(hidden) & set(effects)):
            yield seed
            count -= 1
        seed += 1


def listed(text: str, known: tuple[str, ...]) -> list[str]:
    """A comma-separated list of known words."""
    words = [word for word in text.split(",") if word]
    if unknown := set(words) - set(known):
        raise argparse.ArgumentTypeError(f"{', '.join(sorted(unknown))}: not of {', '.join(known)}")
    return words


def main() -> None:
    known = (*EFFECTS, *OUTSIDE, *CONSTANTS)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=30)
    parser.add_argument("--first", type=int, default=0, help="the first seed; tuning uses those below 1000")
    parser.add_argument("--only", type=int, help="this seed alone")
    parser.add_argument("--kinds", type=lambda text: listed(text, KINDS), default=list(KINDS), help=",".join(KINDS))
    parser.add_argument("--effects", type=lambda text: listed(text, known), default=[], help=", ".join(known))
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time")
    parser.add_argument("--threads", type=int, default=2, help="threads of btr for each case")
    parser.add_argument("--timeout", type=float, default=240.0, help="seconds of the processor for a diagnosis")
    parser.add_argument("--integrator", default="", help="Euler or implicitfast: MuJoCo's own error becomes an effect")
    parser.add_argument("--shows", type=float, nargs=2, metavar=("FROM", "TO"), help="how large effects are, in floors")
    parser.add_argument("--glitches", type=float, default=0.0, help="share of the readings that glitches replace")
    parser.add_argument("--keep", type=Path, help="where to keep models, logs and outcomes, a folder for each seed")
    parser.add_argument("--out", type=Path, help="where to write all outcomes as JSON")
    parser.add_argument("--again", type=Path, help="print the summary of such a file and stop")
    parser.add_argument("--figure", type=Path, help="where to draw the reliability of btr's probabilities, as SVG")
    parser.add_argument("--btr", default=BTR)
    args = parser.parse_args()
    outcomes: list[Outcome] = []
    if args.again:
        outcomes = [Outcome(**outcome) for outcome in json.loads(args.again.read_text())]
    else:
        chosen = [args.only] if args.only is not None else list(seeds(args.first, args.cases, args.kinds, args.effects))
        btr = Btr(args.btr, args.threads, args.timeout)
        with ProcessPoolExecutor(args.jobs) as pool:
            shows = tuple(args.shows) if args.shows else None
            settings = (btr, args.keep, args.integrator, shows, args.glitches)
            asked = {pool.submit(one_case, seed, *settings): seed for seed in chosen}
            for done in as_completed(asked):
                if error := done.exception():
                    print(f"not a case  {asked[done]:>5} {error!r}", flush=True)
                    continue
                outcomes.append(done.result())
                print(done.result().line(), flush=True)
                outcomes.sort(key=lambda outcome: outcome.seed)
                if args.out:
                    args.out.write_text(json.dumps([dataclasses.asdict(o) for o in outcomes], indent=1))
    print("\n" + summary(outcomes))
    if args.figure:
        draw(outcomes, args.figure)
        print(f"figure: {args.figure}")


if __name__ == "__main__":
    main()
