"""Helpers of the studies: running btr, and locating optional data."""

import argparse
import csv
import json
import math
import os
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BTR = str(ROOT / "target" / "release" / "btr")
# Public logs of real machines, which are not part of the project: BTR_DATA, or `shared/data` beside the workspace.
LOGS_OF_MACHINES = Path(os.environ.get("BTR_DATA", ROOT.parent / "shared" / "data")).resolve()


def ask(btr: str, *words: str) -> dict:
    """The output of a btr command."""
    done = subprocess.run([btr, *words, "--json", "-q"], capture_output=True, text=True)
    said = json.loads(done.stdout) if done.stdout.strip() else {"ok": False}
    if not said["ok"]:
        raise SystemExit(f"{' '.join([btr, *words])}\n{done.stdout}{done.stderr}")
    return said


def remaining(left: dict) -> str:
    """What a diagnosis leaves of a channel: in its unit, in noise floors, and in repeatability if runs tell it."""
    repeated = left["x_repeatability"]
    more = "" if repeated is None else f", {repeated:.2f} x_repeatability"
    return f"{left['channel']} {left['rmse']:.3g} {left['unit']}, {left['x_noise_floor']:.1f} x_noise_floor{more}"


def coevolved(btr: str, folder: Path, experiment: Path, seed: int, settings: dict[str, str] | None = None) -> dict:
    """The history of an experiment's run; starts or resumes the run if the folder has no finished one.

    The duration in seconds is written to `seconds.txt` in the same folder."""
    if not (folder / "history.json").exists():
        command = [btr, "coevolve", str(experiment), "--quiet", "--seed", str(seed), "--out", str(folder)]
        command += [word for key, value in (settings or {}).items() for word in ("--set", f"{key}={value}")]
        command += ["--resume"] if (folder / "checkpoint.bin").exists() else []
        began = time.monotonic()
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
        # Exit code 1: the run ended disengaged or missed its goal.
        if done.returncode not in (0, 1):
            raise SystemExit(f"{' '.join(command)}\n{done.stderr}")
        (folder / "seconds.txt").write_text(f"{time.monotonic() - began:.1f}")
    return json.loads((folder / "history.json").read_text())


def coevolved_text(btr: str, folder: Path, text: str, seed: int) -> dict:
    """The history of an experiment given as text, which is saved in the folder as `asked.toml`."""
    folder.mkdir(parents=True, exist_ok=True)
    experiment = folder / "asked.toml"
    experiment.write_text(text)
    return coevolved(btr, folder, experiment, seed)


def seconds(folder: Path) -> float:
    """Duration of a run."""
    return float((folder / "seconds.txt").read_text())


def simulated(btr: str, model: Path, log: Path, duration_s: float) -> list[dict[str, float]]:
    """The rows of a simulation with the model's own drive; overwrites `log`."""
    command = [btr, "simulate", str(model), "-o", str(log), "--overwrite", "-q"]
    subprocess.run([*command, "--set", f"simulation.duration_s={duration_s:.3f}"], cwd=ROOT, check=True)
    with log.open() as file:
        return [{name: float(value) for name, value in row.items() if value} for row in csv.DictReader(file)]


def heading_deg(row: dict[str, float]) -> float:
    """Heading of a robot's base in a row of a log."""
    w, x, y, z = (row[f"base_q{axis}"] for axis in "wxyz")
    return math.degrees(math.atan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z)))


def worst_error(run: dict) -> float:
    """The largest error of any parameter of a run against a hidden twin, in percent."""
    return max(abs(error) for error in run["revealed"]["error_percent"].values())


def quartiles(values: list[float]) -> tuple[float, float, float]:
    """Lower quartile, median and upper quartile, interpolated between the values."""
    if len(values) < 2:
        return values[0], values[0], values[0]
    lower, middle, upper = statistics.quantiles(values, n=4, method="inclusive")
    return lower, middle, upper


def run(study: Callable[[str, Path], None], data: Path, doc: str | None) -> None:
    """The command line of a study on optional data; `study` receives btr's path and a working folder."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--btr", default=BTR)
    parser.add_argument("--keep", type=Path, help="where to keep logs and models")
    args = parser.parse_args()
    if not data.exists():
        print("skipped: data not found")
        return
    with tempfile.TemporaryDirectory() as temporary:
        folder = args.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        study(args.btr, folder)
