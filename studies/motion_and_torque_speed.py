#!/usr/bin/env python3
"""Rows per second and memory of logs of motion and torque, from seconds to an hour at 1 kHz.

    cargo build --release && python3 studies/motion_and_torque_speed.py [--seconds 10,60,600,3600]

Needs NumPy and MuJoCo. A planted six-joint arm (six_joints.py) is compared with its model, and friction and rotors of
all joints are fitted. Both read, check and smooth the log; a row counts once per joint.
"""

import argparse
import tempfile
from pathlib import Path

from asking import BTR
from six_joints import JOINTS, ask, write_logs

FRICTION = [word for effect in ("viscous_friction", "coulomb_friction", "armature") for word in ("--add", effect)]
LOGS = {"compare": ["learn.csv", "held_out.csv"], "fit": ["learn.csv", "--held-out", "held_out.csv", *FRICTION]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--btr", default=BTR)
    parser.add_argument("--seconds", default="10,60,600,3600")
    parser.add_argument("--rate", type=float, default=1000.0, help="samples per second")
    args = parser.parse_args()
    print(f"{'log s':>7} {'rows':>9} {'verb':>8} {'s':>8} {'cpu s':>8} {'rows x joints/s':>16} {'MB':>7}")
    for seconds in map(float, args.seconds.split(",")):
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            write_logs(folder, 1, seconds, args.rate)
            rows = round(seconds * args.rate)
            for verb, words in LOGS.items():
                _, took, cpu, megabytes = ask(args.btr, folder, [verb, "arm.toml", *words])
                speed = rows * JOINTS / took
                print(f"{seconds:7.0f} {rows:9} {verb:>8} {took:8.2f} {cpu:8.2f} {speed:16.0f} {megabytes:7.0f}",
                      flush=True)


if __name__ == "__main__":
    main()
