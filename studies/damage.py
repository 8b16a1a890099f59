#!/usr/bin/env python3
"""Damages folders of runs in every way, resumes them, and counts what must not happen: another result without a word.

    cargo build --release
    python3 studies/damage.py --flips 300 --kills 100 --full-disks 20 --two-at-once 20 --gone 20 [--seed 1]

- flips: one bit of one file of a finished or half finished run, in a twin or by a program; every file is drawn equally
  often. The resumed run must end with the same bytes, or with an exit code and a word on that file.
- kills: SIGKILL, SIGTERM and SIGINT at random moments; the last resume must give the same bytes and leave no litter.
- full disks: a small file system fills up during the run, and is made larger. Mounting needs root.
- two at once: two processes in one folder.
- gone: the folder is removed during the run, which is resumed where it was rescued.

Needs Linux and Python's standard library only. """

import argparse
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

from robot_programs import EXPERIMENT, ROBOT, ROOT, TESTS

TWIN = 'kind = "twin"\nparameters = { "mass@bob" = 1.3 }\n'
PROGRAM = """kind = "command"
run = ["python3", "robot.py", "{references}", "{log}", "{trial}", "drive=0", "children=0"]
timeout_s = 30.0
"""
REALITIES = {"twin": TWIN, "program": PROGRAM}
RESULTS = ("history.json", "adapted.toml", "checkpoint.bin")
STUCK_S = 60.0


class Run:
    """A run in a folder of its own."""

    def __init__(self, work: Path, btr: Path, name: str = "run") -> None:
        self.work, self.btr, self.name = work, btr, name

    @property
    def folder(self) -> Path:
        return self.work / self.name

    def start(self) -> subprocess.Popen[str]:
        """Begins the run, or resumes it where there is a checkpoint."""
        resume = ["--resume"] if (self.folder / "checkpoint.bin").exists() else []
        command = [self.btr, "coevolve", "run.toml", "--out", self.name, "-j", "1", *resume]
        return subprocess.Popen(command, cwd=self.work, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def finish(self) -> tuple[int, str]:
        """Exit code and output of a run that is left alone."""
        return ended(self.start())

    def results(self) -> list[bytes]:
        return [(self.folder / name).read_bytes() for name in RESULTS if (self.folder / name).exists()]

    def wrong(self, whole: list[bytes], code: int, said: str, lost: int = 0) -> str:
        """What is wrong with a run that should have ended like the whole one; empty if nothing is. So many tests may
        have been done twice as their logs were lost."""
        done = self.work / "done"
        tests = done.read_text().splitlines() if done.exists() else []
        if code != 0:
            return f"exit code {code}: {said[-300:]}"
        if self.results() != whole:
            return "other bytes"
        if len(tests) > len({line.split()[-1] for line in tests}) + lost:
            return "a test was done twice"
        litter = [path.name for path in self.folder.rglob("*.tmp")]
        return f"litter: {litter}" if litter else ""


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    said, _ = process.communicate(timeout=STUCK_S)
    return process.returncode, said


def prepare(work: Path, reality: str) -> None:
    """The experiment in a working folder."""
    work.mkdir(parents=True, exist_ok=True)
    text = EXPERIMENT[: EXPERIMENT.index("[reality]")] + "[reality]\n" + REALITIES[reality]
    (work / "run.toml").write_text(text)
    shutil.copy(ROBOT, work / "robot.py")


class Study:
    """Runs of both realities that nothing has happened to, whole and half done, and what went wrong in others."""

    def __init__(self, base: Path, btr: Path, seed: int) -> None:
        self.base, self.btr, self.seed = base, btr, seed
        self.whole: dict[str, list[bytes]] = {}
        self.lasts_s: dict[str, float] = {}
        for reality in REALITIES:
            run = Run(base / f"{reality} finished", btr)
            prepare(run.work, reality)
            began = time.monotonic()
            code, said = run.finish()
            self.lasts_s[reality] = time.monotonic() - began
            if code != 0:
                raise SystemExit(said)
            self.whole[reality] = run.results()
            self.make_half(Run(base / f"{reality} half", btr), reality)

    def make_half(self, run: Run, reality: str) -> None:
        """A run that was killed after its third test began."""
        prepare(run.work, reality)
        process = run.start()
        while not (run.folder / f"transfers/{TESTS // 2:04}").exists():
            time.sleep(0.001)
        process.kill()
        process.wait()

    @contextmanager
    def trial(self, kind: str, number: int, state: str = "") -> Iterator[tuple[Run, random.Random, str]]:
        """A run in a temporary folder: new, or a copy of one in this state."""
        rng = random.Random(f"{self.seed} {kind} {number}")
        reality = rng.choice(sorted(REALITIES))
        with tempfile.TemporaryDirectory(dir=self.base) as folder:
            work = Path(folder) / "work"
            if state:
                shutil.copytree(self.base / f"{reality} {state}", work)
            else:
                prepare(work, reality)
            yield Run(work, self.btr), rng, reality

    def flip(self, number: int) -> tuple[str, str]:
        state = ("finished", "half")[number % 2]
        with self.trial("flip", number, state) as (run, rng, reality):
            files = sorted(path for path in run.folder.rglob("*") if path.is_file() and path.stat().st_size > 0)
            path = rng.choice(files)
            content = bytearray(path.read_bytes())
            bit = rng.randrange(8 * len(content))
            content[bit // 8] ^= 1 << bit % 8
            path.write_bytes(content)
            code, said = run.finish()
            of = path.relative_to(run.folder)
            what = re.sub(r"\.\w{6}\.btr\.tmp$", ".*.btr.tmp", of.name)
            # A word on the test's folder will do for a file in it.
            is_named = str(of) in said or (of.parent.name and f"{run.name}/{of.parent}" in said)
            if code not in (0, -signal.SIGABRT) and is_named and "panicked" not in said:
                return f"{what}: told", ""
            told = "computed again" if "is not used" in said or "written again" in said else "same bytes"
            wrong = run.wrong(self.whole[reality], code, said)
            return f"{what}: {told}", wrong and f"{reality} {state}, bit {bit} of {of}: {wrong}"

    def kill(self, number: int) -> tuple[str, str]:
        kinds = []
        with self.trial("kill", number) as (run, rng, reality):
            for _ in range(rng.randint(1, 3)):
                kind = rng.choice((signal.SIGKILL, signal.SIGTERM, signal.SIGINT))
                process = run.start()
                time.sleep(rng.uniform(0.0, self.lasts_s[reality]))
                with suppress(ProcessLookupError):
                    process.send_signal(kind)
                if ended(process)[0] == 0:
                    break
                kinds.append(kind.name)
            return " ".join(kinds) or "too late", run.wrong(self.whole[reality], *run.finish())

    def full_disk(self, number: int) -> tuple[str, str]:
        with self.trial("full disk", number) as (run, rng, reality):
            disk = run.work / "disk"
            disk.mkdir()
            on_disk = Run(run.work, self.btr, "disk/run")
            options = f"size={rng.randrange(8, 200)}k"
            subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", disk], check=True)
            try:
                code, said = on_disk.finish()
                subprocess.run(["mount", "-o", "remount,size=8m", disk], check=True)
                if code != 0 and "space" not in said:
                    return "full", f"exit code {code} does not tell: {said[-300:]}"
                kinds = {0: "room enough", 1: "full during the run", 2: "full at its beginning"}
                wrong = on_disk.wrong(self.whole[reality], *on_disk.finish())
                return kinds.get(code, f"exit code {code}"), wrong and f"{reality}, {options}: {wrong}"
            finally:
                subprocess.run(["umount", disk], check=True)

    def two_at_once(self, number: int) -> tuple[str, str]:
        with self.trial("two", number, ("", "half")[number % 2]) as (run, rng, reality):
            first = run.start()
            time.sleep(rng.uniform(0.0, self.lasts_s[reality] / 2))
            second = run.start()
            codes = [ended(first), ended(second)]
            refused = [said for code, said in codes if code == 2]
            if any("in use" not in said and "already contains" not in said for said in refused):
                return "two", f"not told: {refused}"
            wrong = run.wrong(self.whole[reality], min(code for code, _ in codes), "")
            return f"{len(refused)} refused", wrong

    def gone(self, number: int) -> tuple[str, str]:
        with self.trial("gone", number) as (run, rng, reality):
            process = run.start()
            while not (run.folder / "checkpoint.bin").exists():
                time.sleep(0.001)
            time.sleep(rng.uniform(0.0, self.lasts_s[reality]))
            shutil.rmtree(run.folder, ignore_errors=True)
            code, said = ended(process)
            if code == 0:
                return "too late", ""
            kept = Run(run.work, self.btr, "run.rescued")
            if code != 1 or not kept.folder.exists():
                return "gone", f"exit code {code}: {said[-300:]}"
            # The log of the test in which the folder is removed goes with it.
            return "rescued", kept.wrong(self.whole[reality], *kept.finish(), lost=1)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ways = ("flips", "kills", "full-disks", "two-at-once", "gone")
    for way in ways:
        parser.add_argument(f"--{way}", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--btr", type=Path, default=ROOT / "target/release/btr")
    options = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory() as base, ThreadPoolExecutor(options.workers) as pool:
        study = Study(Path(base), options.btr.resolve(), options.seed)
        for way, trial in zip(ways, (study.flip, study.kill, study.full_disk, study.two_at_once, study.gone)):
            count = getattr(options, way.replace("-", "_"))
            if way == "full-disks" and count and os.geteuid() != 0:
                print("full-disks: skipped, mounting needs root")
                continue
            kinds: Counter[str] = Counter()
            for number, (kind, wrong) in enumerate(pool.map(trial, range(count))):
                # Several kills of one run count each.
                kinds.update(kind.split() if kind.startswith("SIG") else [kind])
                bad += bool(wrong)
                if wrong:
                    print(f"{way} {number}: {wrong}", flush=True)
            if count:
                print(f"{way}: {count}", *(f"  {kind}: {n}" for kind, n in sorted(kinds.items())), sep="\n", flush=True)
    print(f"violations: {bad or 'none'}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
