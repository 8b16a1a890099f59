#!/usr/bin/env python3
"""Mutates the files of whole journeys (a model, its robot, logs as CSV and MCAP, an index), gives them to the command
line, and counts what must not happen: panics, signals, hangs, complaints that name no file.

    cargo build --release
    python3 studies/hostile_files.py --runs 50000 [--seed 1] [--keep hostile]

Each run changes one file, or two, of one journey and calls one verb. A process may take 4 GB of addresses and 10 s.
Simulations are short (`simulation.max_steps`). Run folders are damaged by damage.py; single readers are fuzzed faster
in one process by `just fuzz`. Needs Linux and Python's standard library only. """

import argparse
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import local

from robot_programs import ROOT

CORPUS = ROOT / "tests/fuzz/corpus"
NAMES = ("model.toml", "robot.urdf", "log.csv", "index.csv")
SHORT = ("-q", "-j", "1", "--set", "simulation.max_steps=2000")
# A verb with its arguments, and how often it is called beside the others.
VERBS = {
    ("simulate", "model.toml", "-o", "out.csv", *SHORT): 3,
    ("simulate", "model.toml", "--log", "log.csv", "-o", "out.mcap", *SHORT): 1,
    ("check", "model.toml", "log.csv", *SHORT): 3,
    ("check", "model.toml", "log.mcap", *SHORT): 2,
    ("compare", "model.toml", "log.csv", "--report", "out.html", *SHORT): 1,
    ("coevolve", "model.toml", "--dry-run", "--out", "run", *SHORT): 2,
    ("info", "log.csv", "--json"): 1,
    ("info", "log.mcap"): 2,
    ("convert", "log.mcap", "out.csv"): 1,
    ("add", "model.toml", "coulomb_friction", "-o", "out.toml"): 1,
}
TOKENS = (
    "0 -0 1 -1 0.0 1e-12 1e9 1e300 1e308 -1e308 1e999 5e-324 nan inf -inf 1000000 4294967295 9223372036854775807 "
    "18446744073709551616 true \"\" '' ../ ../../x /dev/zero / . * @ # , ; "
    "]]> <![CDATA[ <!-- &amp; &#0; <a> </a> [ ] [[ ]] { } "
    "(((((((( [[[[[[[[ {joint} q dq t atan2( ^ /0 \x00 \ufeff \x1b[31m ä"
).split(" ")
# A file of the journey, or one that a changed file names.
NAMED = re.compile(r"(model|robot|log|index|out)\.\w+|^error: .+: .+\(os error \d+\)", re.M)
WORD = re.compile(rb"[\w.+@-]+")
MOST_BYTES = 4 << 30
LONGEST_S = 10.0


def journeys(btr: Path) -> list[dict[str, bytes]]:
    """The files of each journey; a log as MCAP is the one that btr makes of the CSV."""
    made = []
    for path in sorted((CORPUS / "model").iterdir()):
        parts = path.read_bytes().split(b"\n===\n")
        files = {name: part for name, part in zip(NAMES, [*parts, b"", b"", b""])}
        files["log.csv"] = files["log.csv"] or (CORPUS / "csv/swing").read_bytes()
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "log.csv").write_bytes(files["log.csv"])
            subprocess.run([btr, "convert", "log.csv", "log.mcap", "-q"], cwd=folder, check=True)
            files["log.mcap"] = (Path(folder) / "log.mcap").read_bytes()
        made.append(files)
    return made


def mutated(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """A file with a few changes, mostly one."""
    changed = bytearray(data)
    while True:
        at = rng.randrange(len(changed) + 1)
        piece = slice(at, at + rng.choice((1, 4, 16, 200)))
        words = [match.span() for match in WORD.finditer(changed)]
        match rng.randrange(8):
            case 0 if at < len(changed):
                changed[at] ^= 1 << rng.randrange(8)
            case 1 if at < len(changed):
                changed[at : at + 8] = rng.choice((b"\0", b"\xff" * 4, b"\xff" * 8, b"\x7f\xf0\0\0\0\0\0\0"))
            case 2:
                del changed[piece]
            case 3:
                changed[at:at] = changed[piece] * rng.choice((1, 1, 50))
            case 4:
                begin = rng.randrange(len(other) + 1)
                changed[piece] = other[begin : begin + 40]
            case 5:
                changed[at:at] = rng.choice(TOKENS).encode()
            case _ if words:
                changed[slice(*rng.choice(words))] = rng.choice(TOKENS).encode()
        if rng.random() < 0.6:
            return bytes(changed)


def limited() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def judged(verb: tuple[str, ...], btr: Path, folder: Path) -> tuple[str, str]:
    """How a run ended, and what is wrong with that; empty if nothing is."""
    command = [btr, *verb]
    try:
        run = subprocess.run(command, cwd=folder, preexec_fn=limited, timeout=LONGEST_S, capture_output=True)
    except subprocess.TimeoutExpired:
        return "hang", f"longer than {LONGEST_S} s"
    said = (run.stdout + run.stderr).decode(errors="replace")
    if run.returncode == 101 or "panicked" in said:
        return "panic", said[-300:]
    if run.returncode < 0 or run.returncode not in (0, 1, 2):
        return "signal", f"exit code {run.returncode}: {said[-300:]}"
    if run.returncode == 2 and not NAMED.search(said):
        return "names no file", said[-300:]
    return f"exit code {run.returncode}", ""


class Study:
    def __init__(self, base: Path, options: argparse.Namespace) -> None:
        self.base, self.options, self.journeys = base, options, journeys(options.btr)
        self.thread = local()

    def folder(self) -> Path:
        """A folder of this thread; its files are written anew by every run."""
        if not hasattr(self.thread, "folder"):
            self.thread.folder = Path(tempfile.mkdtemp(dir=self.base))
        return self.thread.folder

    def run(self, number: int) -> tuple[str, str]:
        rng = random.Random(f"{self.options.seed} {number}")
        verb = rng.choices(list(VERBS), weights=list(VERBS.values()))[0]
        files, folder = dict(rng.choice(self.journeys)), self.folder()
        # What the verb names is changed more often than what its files name.
        read = [name for name in verb if name in files]
        for _ in range(rng.choice((1, 1, 2))):
            name = rng.choice(read if rng.random() < 0.7 else sorted(files))
            files[name] = mutated(rng, files[name], rng.choice(self.journeys)[name])
        for name, data in files.items():
            (folder / name).write_bytes(data)
        for output in folder.glob("out.*"):
            output.unlink()
        kind, wrong = judged(verb, self.options.btr, folder)
        if wrong and self.options.keep:
            shutil.copytree(folder, self.options.keep / str(number), dirs_exist_ok=True)
        return f"{verb[0]}: {kind}", wrong and f"btr {' '.join(verb)}: {wrong}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="a folder for the files of what went wrong")
    parser.add_argument("--btr", type=Path, default=ROOT / "target/release/btr")
    options = parser.parse_args()
    options.btr = options.btr.resolve()
    kinds: Counter[str] = Counter()
    bad = 0
    in_memory = "/dev/shm" if os.path.isdir("/dev/shm") else None
    with tempfile.TemporaryDirectory(dir=in_memory) as base, ThreadPoolExecutor(options.workers) as pool:
        study = Study(Path(base), options)
        numbers = range(options.first, options.first + options.runs)
        for number, (kind, wrong) in zip(numbers, pool.map(study.run, numbers)):
            kinds[kind] += 1
            bad += bool(wrong)
            if wrong:
                print(f"{number}: {wrong}", flush=True)
    print(f"runs: {options.runs}", *(f"  {kind}: {count}" for kind, count in sorted(kinds.items())), sep="\n")
    print(f"violations: {bad or 'none'}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
