"""The package's types: the stubs say what the compiled half is, and all of it is typed strictly."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mypy", reason="types are checked with mypy")
for library in ("pandas", "matplotlib", "ray"):
    pytest.importorskip(library, reason=f"what is typed with {library} is checked with it")

PACKAGE = Path(__file__).parents[2] / "crates" / "btr-py" / "python" / "btr"
USER = """
import btr

model = btr.load_model("leg.toml", {"simulation.control_s": 0.01})
log = btr.load_log("monday.csv", model=model)
answer = btr.diagnose(model, [log, "friday.mcap"], held_out="sunday.csv")
fitted: btr.Model = btr.fit(model, log, add=answer.names).model
answer.report("answer.html")
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where mypy runs, and keeps what it knows of the libraries from test to test."""
    return tmp_path_factory.mktemp("mypy")


def run(folder: Path, *arguments: object) -> str:
    """What mypy complains about."""
    command = [sys.executable, "-m", *map(str, arguments)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else done.stdout + done.stderr


def test_the_stubs_are_those_of_the_compiled_half(folder: Path) -> None:
    assert run(folder, "mypy.stubtest", "btr._btr") == ""


def test_the_package_is_typed_strictly(folder: Path) -> None:
    assert run(folder, "mypy", "--strict", PACKAGE) == ""


def test_whoever_uses_it_is_told_of_wrong_types(folder: Path) -> None:
    (folder / "user.py").write_text(USER)
    assert run(folder, "mypy", "--strict", "user.py") == ""
    (folder / "user.py").write_text(USER + "answer.report(3)\n")
    assert 'Argument 1 to "report"' in run(folder, "mypy", "--strict", "user.py")
