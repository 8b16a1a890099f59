"""What studies share: asking btr, and the data that they may use where it is there."""

import argparse
import json
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BTR = str(ROOT / "target" / "release" / "btr")


def ask(btr: str, *words: str) -> dict:
    """What a verb of btr says."""
    done = subprocess.run([btr, *words, "--json", "-q"], capture_output=True, text=True)
    said = json.loads(done.stdout) if done.stdout.strip() else {"ok": False}
    if not said["ok"]:
        raise SystemExit(f"{' '.join([btr, *words])}\n{done.stdout}{done.stderr}")
    return said


def run(study: Callable[[str, Path], None], data: Path, doc: str | None) -> None:
    """The command line of a study on data that may not be there: `study` gets btr's path and a folder to work in."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--btr", default=BTR)
    parser.add_argument("--keep", type=Path, help="where to keep logs and models")
    args = parser.parse_args()
    if not data.exists():
        print("skipped: data not there")
        return
    with tempfile.TemporaryDirectory() as temporary:
        folder = args.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        study(args.btr, folder)
