"""A robot that is none: this program and its children note every moment in which they drive it.

python3 robot.py REFERENCES LOG TRIAL [drive=SECONDS] [children=N] [stubborn] [hang] [fail] [leave] [noisy]
    [early]
python3 robot.py stop [fail]

It drives on for as long as there is a file `hold-TEST`.
"""

import csv
import math
import os
import signal
import sys
import time
from pathlib import Path

PERIOD_S = 0.01


def note(name: str, what: str) -> None:
    with Path(name).open("a") as file:
        file.write(f"{time.monotonic():.6f} {os.getpgrp()} {what}\n")


def child(test: str, options: dict[str, str]) -> None:
    """Drives until it is ended."""
    if "stubborn" in options:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    while True:
        note("beats", test)
        time.sleep(PERIOD_S)


def write(log: str, references: str, share: float) -> None:
    """A log of a share of the test, from its beginning."""
    with Path(references).open() as file:
        rows = list(csv.DictReader(file))
    rows = rows[: math.ceil(share * len(rows))]
    text = "".join(f"{row['t']},{row['cmd_hinge']},{0.9 * float(row['cmd_hinge'])},0.0,0.0\n" for row in rows)
    Path(log).write_text("t,cmd_hinge,q_hinge,dq_hinge,tau_hinge\n" + text)


def main(references: str, log: str, trial: str, options: dict[str, str]) -> int:
    test = Path(trial).parent.name
    children = []
    for _ in range(int(options.get("children", 2))):
        children.append(os.fork())
        if children[-1] == 0:
            child(test, options)
    if "early" in options:
        write(log, references, 0.5)
    ends = time.monotonic() + float(options.get("drive", 0.2))
    while "hang" in options or Path(f"hold-{test}").exists() or time.monotonic() < ends:
        note("beats", test)
        if "noisy" in options:
            sys.stdout.write("x" * 3_000_000)
        time.sleep(PERIOD_S)
    if "fail" in options:
        return 3
    if "leave" not in options:
        for pid in children:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
    write(log, references, 1.0)
    note("done", test)
    return 0


if __name__ == "__main__":
    if sys.argv[1] == "stop":
        note("stops", "stop")
        sys.exit("fail" in sys.argv)
    sys.exit(main(*sys.argv[1:4], dict(option.partition("=")[::2] for option in sys.argv[4:])))
