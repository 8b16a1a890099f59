#!/usr/bin/env python3
"""The same bytes from every build and every width of vector registers.

    cargo build && cargo build --release && python3 studies/same_bytes.py

Asks the programs of both profiles, each with at most 1, 2, 4 and 8 lanes (`BTR_LANES`) and with one and two threads, to
simulate, fit, diagnose and co-evolve small robots, and compares the hashes of what they write: logs, `history.json`,
models, and the documents of `--json` without how long they took. The exit code is 1 if a hash differs.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from asking import ROOT

ROBOTS = ROOT / "robots"
ARM_LOGS = [str(ROBOTS / "arm" / "learn_1.csv")]
# Name, arguments, and the files that it writes; exit codes 0 and 1 are both fine.
JOBS: list[tuple[str, list[str], list[str]]] = [
    ("rollout of the Nao", ["simulate", f"{ROBOTS}/nao.toml", "-o", "nao.csv"], ["nao.csv"]),
    ("rollout of the ant", ["simulate", f"{ROBOTS}/ant.toml", "-o", "ant.csv"], ["ant.csv"]),
    (
        "the ant on the reference engine",
        ["simulate", f"{ROBOTS}/ant.toml", "--set", "simulation.engine=rapier", "-o", "rapier.csv"],
        ["rapier.csv"],
    ),
    ("replay of the arm", ["simulate", f"{ROBOTS}/arm.toml", "--log", ARM_LOGS[0], "-o", "arm.csv"], ["arm.csv"]),
    ("fit of the arm", ["fit", f"{ROBOTS}/arm.toml", *ARM_LOGS, "--add", "coulomb_friction@yaw", "--json"], []),
    ("diagnosis of the arm", ["diagnose", f"{ROBOTS}/arm.toml", *ARM_LOGS, "--max-effects", "1", "--json"], []),
    (
        "loop of the pendulum",
        ["coevolve", f"{ROBOTS}/pendulum.toml", "--out", "pendulum", "-q"],
        ["pendulum/history.json", "pendulum/adapted.toml"],
    ),
    (
        "loop of the ant",
        [
            *["coevolve", f"{ROBOTS}/ant-series.toml", "--out", "ant", "-q", "--set", "coevolve.iterations=1"],
            *["--set", "coevolve.controllers.generations=2", "--set", "coevolve.simulators.generations=2"],
        ],
        ["ant/history.json", "ant/adapted.toml"],
    ),
]


def timeless(document: object) -> object:
    """A JSON document without how long it took."""
    if isinstance(document, dict):
        return {key: timeless(value) for key, value in document.items() if key != "seconds"}
    return [timeless(item) for item in document] if isinstance(document, list) else document


def hashed(btr: str, arguments: list[str], files: list[str], lanes: int, threads: int) -> str:
    """A hash of all that a job gives."""
    environment = os.environ | {"BTR_LANES": str(lanes)}
    with tempfile.TemporaryDirectory() as folder:
        command = [btr, *arguments, "-j", str(threads)]
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        if done.returncode not in (0, 1):
            raise SystemExit(f"{' '.join(command)}\n{done.stderr}")
        written = [done.stdout] if "--json" in arguments else [Path(folder, name).read_text() for name in files]
    as_bytes = (json.dumps(timeless(json.loads(text))) if text.startswith("{") else text for text in written)
    return hashlib.sha256("\n".join(as_bytes).encode()).hexdigest()[:16]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--release", default=str(ROOT / "target" / "release" / "btr"))
    parser.add_argument("--debug", default=str(ROOT / "target" / "debug" / "btr"))
    parser.add_argument("--lanes", default="1,2,4,8")
    args = parser.parse_args()
    lanes = [int(one) for one in args.lanes.split(",")]
    programs = [("release", str(Path(args.release).resolve())), ("debug", str(Path(args.debug).resolve()))]
    runs = [(name, btr, n, 1 + n % 2) for name, btr in programs for n in lanes]
    differing = 0
    for job, arguments, files in JOBS:
        found: dict[str, list[str]] = {}
        for profile, btr, n, threads in runs:
            which = f"{profile} with {n} lanes on {threads} threads"
            found.setdefault(hashed(btr, arguments, files, n, threads), []).append(which)
        same = len(found) == 1
        differing += not same
        print(f"{job:<33} {next(iter(found)) if same else 'DIFFERS'}", flush=True)
        if not same:
            print("\n".join(f"    {digest}: {', '.join(which)}" for digest, which in found.items()))
    print(f"{len(JOBS)} jobs, {len(runs)} builds and widths each: {differing} differ")
    sys.exit(1 if differing else 0)


if __name__ == "__main__":
    main()
