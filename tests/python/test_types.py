"""The package's types: the stubs match the compiled module, and the package passes mypy --strict."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mypy", reason="types are checked with mypy")
for library in ("pandas", "matplotlib", "ray", "viser"):
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
# Types of the attributes of results.
RESULTS = """
from typing import Literal

from typing_extensions import assert_type

import btr
from btr import documents

answer = btr.diagnose("leg.toml", "monday.csv")
assert_type(
    answer.verdict,
    Literal["effect_missing", "value_wrong", "partly_explained", "nothing_missing", "unexplained"],
)
assert_type(answer.wrong_values[0].parameters[0].in_model, float)
assert_type(answer.effects[0], documents.EffectReport)
assert_type(answer.effects[0].site, str | list[str])
assert_type(answer.effects[0].parameters[0].ci95, tuple[float, float] | None)
assert_type(answer.error_ladder[-1].held_out, float | None)
assert_type(answer.ranking[0][0].delta_bic, float)
if answer.residual_law is not None and answer.next_experiment is not None:
    assert_type(answer.residual_law.on, Literal["torque", "command", "reading"])
    assert_type(answer.next_experiment.rivals[0].separation, float)
fitted = btr.fit("leg.toml", "monday.csv")
assert_type(fitted.stop_reason, Literal["converged", "effort", "stuck"])
assert_type(fitted.parameters[0].at_bound, bool)
assert_type(fitted.space[0].scale, Literal["linear", "log"])
assert_type(fitted.doubts[0].severity, Literal["fine", "doubtful", "bad"])
compared = btr.compare(fitted.model, "monday.csv")
assert_type(compared.channels[0].chi, float)
assert_type(compared.failures[0].hint, str)
checked = btr.check(fitted.model, "monday.csv")
assert_type(checked.logs[0].clock.rate_hz, float)
assert_type(checked.logs[0].joints[0].command_lag, documents.CommandLag | None)
assert_type(checked.logs[0].joints[0].dead_time_ci95_s, tuple[float, float] | None)
assert_type(btr.effects().effects[0].parameters[0].typical, float)
run = btr.coevolve("leg.toml", tell=lambda iteration: assert_type(iteration.phi, float | None))
assert_type(run.iterations[0], btr.Iteration)
assert_type(run.tests[0].verdict.failed, documents.Failed | None)
assert_type(run.log_scores[0].after.rmse, float)
assert_type(fitted.model.parameters[0].nominal, float | None)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Working folder of mypy, with a cache shared by the tests."""
    return tmp_path_factory.mktemp("mypy")


def run(folder: Path, *arguments: object) -> str:
    """The errors of mypy."""
    command = [sys.executable, "-m", *map(str, arguments)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else done.stdout + done.stderr


def test_the_stubs_are_those_of_the_compiled_half(folder: Path) -> None:
    assert run(folder, "mypy.stubtest", "btr._btr") == ""


def test_the_package_is_typed_strictly(folder: Path) -> None:
    assert run(folder, "mypy", "--strict", PACKAGE) == ""


def test_wrong_types_in_user_code_are_reported(folder: Path) -> None:
    (folder / "user.py").write_text(USER)
    assert run(folder, "mypy", "--strict", "user.py") == ""
    (folder / "user.py").write_text(USER + "answer.report(3)\n")
    assert 'Argument 1 to "report"' in run(folder, "mypy", "--strict", "user.py")


def test_results_are_typed_to_their_last_attribute(folder: Path) -> None:
    (folder / "results.py").write_text(RESULTS)
    assert run(folder, "mypy", "--strict", "results.py") == ""


@pytest.mark.parametrize("misspelt", ["answer.verdcit", "answer.effects[0].sites", "run.tests[0].verdict.why"])
def test_a_misspelt_attribute_is_reported(folder: Path, misspelt: str) -> None:
    (folder / "misspelt.py").write_text(f"{RESULTS}\nprint({misspelt})\n")
    assert "has no attribute" in run(folder, "mypy", "--strict", "misspelt.py")
