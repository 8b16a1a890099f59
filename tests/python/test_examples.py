"""The examples and that of the README run unchanged and give the results that they state."""

import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from program import BTR

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
# Examples with cells of text and code that open as notebooks.
NOTEBOOKS = ["coevolve", "compare_diagnose_fit", "own_robot"]


def said(name: str, folder: Path, *arguments: str) -> str:
    """The output of an example; its files go into the folder."""
    command = [sys.executable, str(EXAMPLES / f"{name}.py"), *arguments]
    environment = {**os.environ, "TMPDIR": str(folder), "MPLBACKEND": "Agg"}
    run = subprocess.run(command, capture_output=True, text=True, timeout=300, env=environment, cwd=folder, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout


def numbers(line: str) -> list[float]:
    """The numbers in a line."""
    return [float(number) for number in re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e[+-]\d+)?(?![\w.])", line)]


def value(text: str, name: str) -> float:
    """The number in a row of the last table with this name, or behind an equals sign."""
    *_, row = [line for line in text.splitlines() if line.startswith((f"{name} ", f"{name}="))]
    return numbers(row.removeprefix(name))[0]


def test_a_model_and_its_logs(tmp_path: Path) -> None:
    text = said("compare_diagnose_fit", tmp_path)
    before, after = text.split("before: ")[1].split("after: ")
    assert before.startswith("yaw: ") and "effect_missing ['coulomb_friction@yaw']" in before
    assert after.startswith("every joint is within")
    # The worst channel on held-out logs: rmse, error, fit, bias, lag, floor, chi.
    assert numbers(before.split("q_yaw")[1].splitlines()[0])[6] > 20
    assert all(
        numbers(after.split(f"q_{joint} ")[1].splitlines()[0])[6] < 1.5 for joint in ("yaw", "shoulder", "elbow")
    )
    [step] = [line for line in text.splitlines() if line.startswith("  + coulomb_friction@yaw: ")]
    assert max(numbers(step)) < 1.5
    written = {path.name for path in tmp_path.glob("btr_*/*")}
    assert written >= {"fitted.toml", "why.html"} and ("fitted.png" in written) == (find_spec("matplotlib") is not None)


def test_own_robot(tmp_path: Path) -> None:
    text = said("own_robot", tmp_path)
    assert "log_1.csv: fine" in text and "\nknee: " in text and "\nmissing: backlash@knee\n" in text
    [step] = [line for line in text.splitlines() if line.startswith("+ backlash@knee")]
    learnt, held_out = numbers(step)
    assert learnt < 1.5 and held_out < 1.5
    # The true values of the example.
    assert abs(value(text, "mass@shank") - 0.36) < 0.005 and abs(value(text, "backlash.gap@knee") - 0.03) < 0.001
    assert abs(value(text, "mass@thigh") - 0.5) < 0.01


def test_the_loop(tmp_path: Path) -> None:
    text = said("coevolve", tmp_path)
    first, rest = text.split("interrupted\n")
    assert re.findall(r"test (\d+):", first) == ["0", "1", "2", "3"] and "iteration 2:" in first
    assert re.findall(r"test (\d+):", rest)[0] == "4", "no test is asked for twice"
    assert "1 real tests failed, the last one: the cable came off" in text
    found, larger = rest.split("missing: coulomb_friction@hinge\n")
    assert "stopped: disengaged" in found and "stopped: iterations_done" in larger
    phi = [float(phi) for phi in re.findall(r"iteration \d+: phi (\S+)", text)]
    assert phi[-1] < phi[2] / 20, phi
    assert abs(value(text, "mass@bob") - 1.2) < 0.02 and abs(value(text, "kp@hinge") - 9.0) < 0.1
    assert abs(value(text, "coulomb_friction.torque@hinge") - 0.4) < 0.02


def test_own_effect(tmp_path: Path) -> None:
    lines = said("own_effect", tmp_path).splitlines()
    errors = {line.split(":")[0]: numbers(line.split(":")[1]) for line in lines if not line.startswith(" ")}
    assert list(errors) == ["nominal model", "with an expression", "with a function"]
    before, expression, function = errors.values()
    assert min(before) > 5 and max(*expression, *function) < 1.5
    assert sum("95 % interval 0.2" in line for line in lines) == 3, lines


@pytest.mark.parametrize("planted", ["coulomb_friction", "armature", "command_delay"])
def test_another_simulator_as_the_robot(planted: str, tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="the robot is one in MuJoCo")
    text = said("mujoco_reality", tmp_path, "--plant", planted)
    assert f"\nmissing: {planted}@shoulder\n" in text
    ladder, goes_on = text.split("what the model lacks")[1].split("the loop goes on with it")
    assert numbers(ladder.strip().splitlines()[-1])[-1] <= 1.5
    rows = [line for line in goes_on.split("\n\n")[1].splitlines() if line[0].isdigit()]
    without, added = (float(row.split()[2]) for row in rows[-2:])
    assert added <= without / 2


def test_both_robots_in_rerun(tmp_path: Path) -> None:
    rerun = pytest.importorskip("rerun", reason="the viewer is Rerun: pip install rerun-sdk")
    if BTR is None:
        pytest.skip("no btr executable: set BTR, or build it")
    overlay, recording = tmp_path / "overlay.mcap", tmp_path / "overlay.rrd"
    arm, log = ROOT / "robots/arm.toml", ROOT / "robots/arm/held_out_1.csv"
    subprocess.run([BTR, "compare", arm, log, "-o", overlay, "-q"], check=True, stdout=subprocess.DEVNULL)
    said("rerun_overlay", tmp_path, str(overlay), "--save", str(recording))
    printed = [sys.executable, "-m", "rerun", "rrd", "print", str(recording)]
    chunks = subprocess.run(printed, capture_output=True, text=True, check=True).stdout
    assert rerun.__version__ and "Blueprint" in chunks
    joints = [f"/{name}/joint_states/position" for name in ("measured", "model", "difference")]
    assert all(f" - {entity} - " in chunks for entity in ("/tf", *joints))
    # Rerun has read both robots.
    assert all(f"/{robot}/visual_geometries/" in chunks for robot in ("measured", "model"))


def cells(name: str) -> list[str]:
    """The code of an example, cell by cell."""
    parts = re.split(r"^# %%(.*)\n", (EXAMPLES / f"{name}.py").read_text(), flags=re.MULTILINE)
    assert parts[0] == "", "what stands before the first cell is in no notebook"
    return [code for kind, code in zip(parts[1::2], parts[2::2], strict=True) if "[markdown]" not in kind]


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_an_example_runs_as_a_notebook(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for code in cells(name):
        compile(code, name, "exec")
    # Its working directory is the folder of the file; it has no `__file__`.
    monkeypatch.chdir(EXAMPLES)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    known: dict = {}
    exec(cells(name)[0], known)
    assert known["OUT"].parent == tmp_path and "__file__" not in known


def test_the_example_of_the_readme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "robots").symlink_to(ROOT / "robots")
    monkeypatch.chdir(tmp_path)
    [example] = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    known: dict = {}
    exec(example, known)
    assert known["answer"].names == ["coulomb_friction@yaw"] and 'answer.names == ["coulomb_friction@yaw"]' in example
    assert (tmp_path / "fitted.toml").exists()
    # The law that is written down in the text below it.
    [law] = re.findall(r"`(arm\.add_law\(.*?\))`", (ROOT / "README.md").read_text())
    assert eval(law, known).text.count("[[effects]]") == 1


def test_every_example_is_run_here() -> None:
    others = {"own_effect", "mujoco_reality", "rerun_overlay"}
    assert {path.stem for path in EXAMPLES.glob("*.py")} == {*NOTEBOOKS, *others}
