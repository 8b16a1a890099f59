#!/usr/bin/env python3
"""Interrupts real tests by a program in every way and at random moments, and counts what must not happen.

    cargo build --release
    python3 studies/robot_programs.py [--trials 200] [--seed 1] [--workers 3] [--btr target/release/btr] [--plain]

The robot is `crates/btr-cli/tests/cli/robot.py`: it and its two children, which ignore SIGTERM, write down when they
drive it. A trial is a run of four real tests that is interrupted one to three times and resumed until it is done. A run
that is resumed after SIGKILL and finds its program still running waits for it, and ends with an error if it does not
end: that is no violation, since it says so. `--plain` leaves out the keys that btr had not always, to measure an older
one. Needs Linux and Python's standard library only.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ROBOT = ROOT / "crates/btr-cli/tests/cli/robot.py"
TESTS = 4
STOP_S = 0.2
# A run that does not end within this time after an interruption is stuck.
STUCK_S = 30.0
# Nothing may drive this long after btr has ended: what is written then was begun before.
SETTLED_S = 0.1

EXPERIMENT = """name = "interrupted"
seed = 1
[robot]
builtin = "pendulum"
length_m = 0.5
[actuators.hinge]
kind = "position"
kp = 10.0
kd = 0.2
[simulation]
control_s = 0.01
steps_per_control = 2
sample_every = 2
duration_s = 0.5
[parameters]
"mass@bob" = { relative = [0.5, 1.5] }
[drive]
kind = "sine"
omega_rad_s = 8.0
search = "all"
[fitness]
energy = 1.0
[coevolve]
iterations = 2
distance = { name = "rmse", channels = ["q_*"] }
controllers = { generations = 2, search = { algorithm = "ga", population = 6 } }
simulators = { generations = 4, search = { algorithm = "cma_es", population = 6 } }
transfer = { count = 2 }
[reality]
kind = "command"
run = ["python3", "robot.py", "{references}", "{log}", "{trial}", "drive=0.3", "stubborn"]
timeout_s = 3.0
retries = 1
"""
SAFELY = f"""stop_s = {STOP_S}
on_stop = ["python3", "robot.py", "stop"]
"""


class Trial:
    """One run in a folder of its own, and what went wrong in it."""

    def __init__(self, folder: Path, btr: Path, plain: bool, rng: random.Random) -> None:
        self.folder, self.btr, self.rng = folder, btr, rng
        self.wrong: Counter[str] = Counter()
        self.kinds: list[str] = []
        (folder / "robot.py").write_text(ROBOT.read_text())
        (folder / "run.toml").write_text(EXPERIMENT + ("" if plain else SAFELY))

    def notes(self, name: str) -> list[tuple[float, int, str]]:
        path = self.folder / name
        lines = path.read_text().splitlines() if path.exists() else []
        fields = (line.split(" ") for line in lines)
        return [(float(at), int(group), test) for at, group, test in fields]

    def start(self) -> subprocess.Popen[bytes]:
        resume = ["--resume"] if (self.folder / "run/checkpoint.bin").exists() else []
        command = [self.btr, "coevolve", "run.toml", "--out", "run", "-q", "-j", "1", *resume]
        with (self.folder / "stderr.txt").open("wb") as told:
            null = subprocess.DEVNULL
            return subprocess.Popen(command, cwd=self.folder, stdout=null, stderr=told, start_new_session=True)

    def interrupt(self, kind: str) -> None:
        """Starts or resumes the run, interrupts it at a random moment, and waits until it has ended."""
        self.kinds.append(kind)
        run = self.start()
        time.sleep(self.rng.uniform(0.0, 1.5))
        KINDS[kind](self, run)
        try:
            run.wait(STUCK_S)
        except subprocess.TimeoutExpired:
            self.wrong["stuck"] += 1
            run.kill()
            run.wait()
        # A signal that comes before btr listens ends it like `kill`: it has started no program, nor found one.
        if self.refused():
            # It says that the robot may still move, and how to end the program: here that is done.
            self.end_robots()
        elif kind != "kill" and run.returncode >= 0:
            self.check_stillness(time.monotonic())

    def refused(self) -> bool:
        """Whether the last run ended since a program that a killed run had started did not end by itself."""
        _, _, error = (self.folder / "stderr.txt").read_text().rpartition("error: ")
        return "which a killed run started, still runs" in error

    def check_stillness(self, ended: float) -> None:
        time.sleep(SETTLED_S + 0.1)
        if any(at > ended + SETTLED_S for at, _, _ in self.notes("beats")):
            self.wrong["driving after btr ended"] += 1
            self.end_robots()

    def end_robots(self) -> None:
        """Ends what an older btr leaves, so that the trial can go on."""
        for group in {group for _, group, _ in self.notes("beats")} & living_groups():
            with suppress(ProcessLookupError):
                os.killpg(group, signal.SIGKILL)

    def finish(self) -> None:
        """Resumes the run without a further interruption, and looks at what all of it has come to."""
        run = self.start()
        try:
            code = run.wait(STUCK_S)
        except subprocess.TimeoutExpired:
            code = None
            run.kill()
        history = self.folder / "run/history.json"
        tests = json.loads(history.read_text())["tests"] if history.exists() else []
        done = sum("done" in test["verdict"] for test in tests)
        if code != 0 or done < TESTS:
            self.wrong["test lost"] += max(1, TESTS - done)
        often = Counter(test for _, _, test in self.notes("done"))
        self.wrong["test done twice"] += sum(count - 1 for count in often.values())
        self.wrong["two at once"] += self.overlaps()
        if {group for _, group, _ in self.notes("beats")} & living_groups():
            self.wrong["driving after btr ended"] += 1
            self.end_robots()

    def overlaps(self) -> int:
        spans: dict[int, tuple[float, float]] = {}
        for at, group, _ in self.notes("beats"):
            first, last = spans.get(group, (at, at))
            spans[group] = (min(first, at), max(last, at))
        ordered = sorted(spans.values())
        return sum(before[1] > after[0] for before, after in zip(ordered, ordered[1:]))


def living_groups() -> set[int]:
    groups = set()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, group = stat.read_text().rpartition(")")[2].split()[:3]
        except OSError:
            continue
        if state != "Z":
            groups.add(int(group))
    return groups


def ctrl_c(trial: Trial, run: subprocess.Popen[bytes]) -> None:
    """To the terminal's process group: an older btr's robot is in it as well."""
    os.killpg(run.pid, signal.SIGINT)


def ctrl_c_twice(trial: Trial, run: subprocess.Popen[bytes]) -> None:
    ctrl_c(trial, run)
    time.sleep(trial.rng.uniform(0.0, 0.3))
    if run.poll() is None:
        ctrl_c(trial, run)


def terminate(trial: Trial, run: subprocess.Popen[bytes]) -> None:
    run.terminate()


def hang_up(trial: Trial, run: subprocess.Popen[bytes]) -> None:
    os.killpg(run.pid, signal.SIGHUP)


def shut_down(trial: Trial, run: subprocess.Popen[bytes]) -> None:
    """As an operating system that shuts down: SIGTERM to every process, the robot's program first."""
    robots = {group for _, group, _ in trial.notes("beats")} & living_groups()
    for group in [*robots, run.pid]:
        with suppress(ProcessLookupError):
            os.killpg(group, signal.SIGTERM)


def kill(trial: Trial, run: subprocess.Popen[bytes]) -> None:
    run.kill()


def second_run(trial: Trial, run: subprocess.Popen[bytes]) -> None:
    """A second run in the same folder must end, and the first one go on."""
    second = trial.start()
    try:
        code = second.wait(STUCK_S)
    except subprocess.TimeoutExpired:
        code = None
        second.kill()
    if run.poll() is None and code != 2:
        trial.wrong["second run in a folder"] += 1


def time_out(trial: Trial, run: subprocess.Popen[bytes]) -> None:
    """The program hangs: it is stopped until it is ended, and its children drive on."""
    for group in {group for _, group, _ in trial.notes("beats")} & living_groups():
        with suppress(ProcessLookupError):
            os.kill(group, signal.SIGSTOP)
            # One that is about to end with a whole log is no program that hangs.
            if group in {group for _, group, _ in trial.notes("done")}:
                os.kill(group, signal.SIGCONT)


KINDS: dict[str, Callable[[Trial, subprocess.Popen[bytes]], None]] = {
    "Ctrl-C": ctrl_c,
    "Ctrl-C twice": ctrl_c_twice,
    "SIGTERM": terminate,
    "hang-up": hang_up,
    "shutdown": shut_down,
    "kill": kill,
    "second run": second_run,
    "time-out": time_out,
}


def carried_out(number: int, options: argparse.Namespace) -> Trial:
    rng = random.Random(f"{options.seed} {number}")
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(Path(folder), options.btr.resolve(), options.plain, rng)
        kinds = list(KINDS)
        # Every kind is equally often the first one.
        for kind in [kinds[number % len(kinds)], *rng.choices(kinds, k=rng.randint(0, 2))]:
            trial.interrupt(kind)
        trial.finish()
    return trial


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=3)
    parser.add_argument("--btr", type=Path, default=ROOT / "target/release/btr")
    parser.add_argument("--plain", action="store_true")
    options = parser.parse_args()
    kinds: Counter[str] = Counter()
    wrong: Counter[str] = Counter()
    with ThreadPoolExecutor(options.workers) as pool:
        for number, trial in enumerate(pool.map(lambda number: carried_out(number, options), range(options.trials))):
            kinds.update(trial.kinds)
            wrong += trial.wrong
            if +trial.wrong:
                print(f"trial {number}, {', '.join(trial.kinds)}: {dict(+trial.wrong)}", flush=True)
    print(f"{options.trials} runs of {TESTS} real tests, {kinds.total()} interruptions: {dict(kinds)}")
    print(f"violations: {dict(wrong) or 'none'}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
