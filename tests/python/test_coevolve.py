"""The loop from Python with a function as its robot; interrupted runs can be resumed."""

import base64
import copy
import json
import os
import pickle
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import btr
from typed import must_be_typed

ROBOTS = Path(__file__).parents[2] / "robots"
SMALL = {"coevolve.iterations": 3, "coevolve.controllers.generations": 2, "coevolve.simulators.generations": 3}


@pytest.fixture(scope="module")
def experiment() -> btr.Model:
    """A pendulum and its loop; its `[reality]` is not used here."""
    return btr.load_model(ROBOTS / "disengage.toml", SMALL)


class Twin:
    """A pendulum of another mass as the robot, simulated by btr."""

    def __init__(self, experiment: btr.Model) -> None:
        text = experiment.text.replace("mass_kg = 1.0", "mass_kg = 1.2")
        self.model, self.asked = btr.Model(text, experiment.path), []

    def __call__(self, controller: btr.Controller) -> btr.Log:
        self.asked.append(controller)
        references = controller.references
        start = {"q_hinge": np.full(len(references), controller.start["hinge"])}
        return self.model.simulate(btr.Log(references.clock_s, references.to_dict() | start), seed=controller.number)


def finished(experiment: btr.Model, folder: Path, reality, **options) -> dict:
    document = btr.coevolve(experiment, reality, out=folder, **options).document
    return {key: value for key, value in document.items() if key != "files"}


@pytest.fixture(scope="module")
def undisturbed(experiment: btr.Model, tmp_path_factory: pytest.TempPathFactory) -> dict:
    return finished(experiment, tmp_path_factory.mktemp("undisturbed"), Twin(experiment))


def test_a_function_is_a_robot(experiment: btr.Model, undisturbed: dict, tmp_path: Path) -> None:
    robot, heard = Twin(experiment), []
    found = btr.coevolve(experiment, robot, out=tmp_path, tell=heard.append)
    assert found.real_tests == len(robot.asked) == len(found.logs) == 6
    first = robot.asked[0]
    assert first.number == 0 and first.iteration == 1 and set(first.parameters) == {"amplitude@hinge", "phase@hinge"}
    assert len(first.references) == 301 and first.references.keys() == ["cmd_hinge"]
    assert heard == found.iterations and abs(found.iterations[-1]["parameters"]["mass@bob"] - 1.2) < 0.1
    assert "6 real tests" in repr(found) and "<table>" in found._repr_html_()
    assert "mass@bob" in btr.load_model(found.adapted).text
    assert {key: value for key, value in found.document.items() if key != "files"} == undisturbed


@pytest.fixture(scope="module")
def disengaged(tmp_path_factory: pytest.TempPathFactory) -> btr.CoevolveResult:
    """A run whose robot has friction."""
    return btr.coevolve(ROBOTS / "disengage.toml", out=tmp_path_factory.mktemp("run"))


def test_the_missing_effect_is_named(disengaged: btr.CoevolveResult) -> None:
    must_be_typed(disengaged)
    assert disengaged.stop_reason == "disengaged" and disengaged.missing == ["coulomb_friction@hinge"]
    assert repr(disengaged).split("\n\n")[0].endswith("\nmissing: coulomb_friction@hinge")
    for key, value in [("stop_reason", "iterations_done"), ("diagnosis", None)]:
        other = btr.CoevolveResult({**disengaged.document, key: value}, disengaged.folder)
        assert other.missing == [] and "missing" not in repr(other)
    unexplained = copy.deepcopy(disengaged)
    unexplained.diagnosis["verdict"] = "unexplained"
    assert unexplained.missing == []


def test_a_notebook_shows_the_figures_that_there_are(disengaged: btr.CoevolveResult, tmp_path: Path) -> None:
    shown = disengaged._repr_html_()
    figures = [base64.b64decode(data) for data in re.findall(r'src="data:image/svg\+xml;base64,([^"]*)"', shown)]
    assert figures == [(disengaged.folder / name).read_bytes() for name in ("progress.svg", "following.svg")]
    assert all(figure.startswith(b"<svg ") for figure in figures)
    assert "stopped: disengaged" in shown and shown.count("<tr>") == 1 + len(disengaged.iterations)
    (tmp_path / "following.svg").write_bytes(figures[1])
    html = btr.CoevolveResult(disengaged.document, tmp_path)._repr_html_()
    assert html.count("<img") == 1 and "before and after" in html
    assert "<img" not in btr.CoevolveResult(disengaged.document, tmp_path / "gone")._repr_html_()
    assert pickle.loads(pickle.dumps(disengaged))._repr_html_() == shown


def test_a_run_draws_itself(disengaged: btr.CoevolveResult) -> None:
    matplotlib = pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    run = copy.deepcopy(disengaged)
    run.iterations[1]["fitness_real"] = None
    run.document["augmentations"] = [
        {"after_iteration": 1, "real_tests": 2, "parameters": ["coulomb_friction.torque@hinge"]}
    ]
    phi, fitness = run.plot().axes
    found, predicted, grown = phi.lines
    assert list(found.get_ydata()) == [iteration["phi"] for iteration in run.iterations] and phi.get_yscale() == "log"
    assert list(predicted.get_ydata()) == [iteration["phi_predicted"] for iteration in run.iterations]
    assert list(grown.get_xdata()) == [1.5, 1.5] and grown.get_label() == "+ coulomb_friction.torque@hinge"
    predicted, real, _ = fitness.lines
    assert list(predicted.get_xdata()) == list(range(1, len(run.iterations) + 1))
    assert list(predicted.get_ydata()) == [iteration["fitness_sim"] for iteration in run.iterations]
    assert np.isnan(real.get_ydata()[1]) and np.isfinite(real.get_ydata()[0])
    assert [text.get_text() for text in fitness.get_legend().get_texts()][:2] == ["predicted", "real"]
    figure, pair = pyplot.subplots(1, 2)
    assert disengaged.plot(ax=pair) is figure
    for iteration in run.iterations:
        iteration["fitness_sim"] = iteration["fitness_real"] = None
    assert len(run.plot().axes) == 1
    pyplot.close("all")


def test_a_failed_test_counts(experiment: btr.Model, tmp_path: Path) -> None:
    twin = Twin(experiment)

    def robot(controller: btr.Controller) -> btr.Log:
        if controller.number == 1:
            raise btr.TestFailed("fell off the table")
        return twin(controller)

    found = btr.coevolve(experiment, robot, out=tmp_path)
    assert found.real_tests == 6 and len(found.logs) == 5
    assert found.tests[1]["verdict"] == {"failed": {"why": "fell off the table"}} and "fell off the table" in repr(
        found
    )


def test_a_test_that_was_recorded_badly_is_warned_about(experiment: btr.Model, tmp_path: Path) -> None:
    twin = Twin(experiment)

    def robot(controller: btr.Controller) -> dict:
        log = twin(controller)
        return {"t": log.clock_s, **log.to_dict(), "q_hinge": np.full(len(log), np.nan)}

    with pytest.warns(UserWarning) as heard:
        found = btr.coevolve(experiment, robot, out=tmp_path)
    warned = [str(warning.message) for warning in heard]
    assert "real test 0: its log has nothing that rmse could compare with a simulation" in warned, warned
    assert {warning.filename for warning in heard} == {__file__}
    assert len(warned) == len(set(warned)) and not any("real test 1" in line for line in warned), warned
    assert found.doubts[0]["test"] == 0 and "bad: real test 0: its log has nothing" in repr(found)


FOREIGN = """
[channels.channels]
q_hinge = { column = "encoder", factor = 2.0 }
"cmd_{joint}" = { column = "cmd_{joint}", factor = 1.0 }
"dq_{joint}" = { column = "dq_{joint}", factor = 0.5 }
"""


@pytest.mark.parametrize("kind", ["mapping", "frame", "Log", "path"])
def test_a_robot_may_use_foreign_channel_names(
    experiment: btr.Model, undisturbed: dict, tmp_path: Path, kind: str
) -> None:
    twin, foreign = Twin(experiment), btr.Model(f"{experiment.text}{FOREIGN}", experiment.path)

    def robot(controller: btr.Controller) -> object:
        log = twin(controller)
        columns = {name: values for name, values in log.items() if name != "q_hinge"}
        columns["encoder"] = 0.5 * log["q_hinge"]
        if kind == "Log":
            return btr.Log(log.clock_s, columns)
        columns["dq_hinge"] = 2.0 * log["dq_hinge"]
        if kind == "path":
            btr.Log(log.clock_s, columns).write(tmp_path / f"{controller.number}.csv")
            return tmp_path / f"{controller.number}.csv"
        columns = {"t": log.clock_s, **columns}
        return columns if kind == "mapping" else pytest.importorskip("pandas").DataFrame(columns)

    found = btr.coevolve(foreign, robot, out=tmp_path / "run")
    assert [iteration["phi"] for iteration in found.iterations] == [
        iteration["phi"] for iteration in undisturbed["iterations"]
    ]
    assert found.iterations[-1]["parameters"] == undisturbed["iterations"][-1]["parameters"]
    again = btr.coevolve(foreign, robot, out=tmp_path / "run", resume=True)
    assert again.iterations == found.iterations


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"reality": 5}, "reality is a function of a Controller that gives back a log, not 5"),
        ({"tell": 3}, "tell is a function that is called with every iteration, not 3"),
        ({"seed": "a"}, "seed is a whole number, not 'a'"),
        ({"experiment": 3}, "a model is a Model or the path of its file, not 3"),
    ],
)
def test_wrong_types_are_reported(experiment: btr.Model, tmp_path: Path, wrong: dict, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        btr.coevolve(**{"experiment": experiment, "out": tmp_path, **wrong})


class Unplugged(Exception):
    """An exception of the robot's function."""


def broken_at(number: int, twin: Twin, how) -> object:
    return lambda controller: how(controller) if controller.number == number else twin(controller)


def unplugged(controller: btr.Controller) -> btr.Log:
    raise Unplugged("no answer")


@pytest.mark.parametrize(
    ("how", "error", "message"),
    [
        (unplugged, Unplugged, "no answer"),
        (lambda c: 3, TypeError, "a log is a path"),
        (lambda c: btr.Log([0.0, 0.0], {"q_hinge": [0, 0]}), btr.BtrError, "does not increase"),
        (lambda c: btr.Log([0.0, 1.0], {"q_hinge": [0]}), btr.BtrError, "1 values, but the clock has 2"),
        (lambda c: btr.Log([0.0], {"q_hinge": [0]}), btr.BtrError, "at least two samples"),
        (lambda c: btr.Log([0.0, 0.1], {"q_hinge": [np.nan] * 2}), btr.BtrError, "contains no channel of this robot"),
        (
            lambda c: btr.Log([0.0, 0.1], {"q_foo": [0, 1]}),
            btr.BtrError,
            "contains no channel of this robot: it has q_foo",
        ),
        (lambda c: btr.Log([0.0, 10.0, 20.0], {"q_hinge": [0, 1, 2]}), btr.BtrError, "is its time in milliseconds"),
        (lambda c: "nowhere.csv", btr.BtrError, "nowhere.csv"),
    ],
)
def test_a_run_can_be_resumed_after_any_failure_of_the_robot(
    experiment: btr.Model, undisturbed: dict, tmp_path: Path, how, error: type, message: str
) -> None:
    with pytest.raises(error, match=message):
        btr.coevolve(experiment, broken_at(3, Twin(experiment), how), out=tmp_path)
    assert len(list(tmp_path.glob("transfers/*/log.*"))) == 3
    with pytest.raises(btr.BtrError, match="already contains a run\nhelp: go on with resume=True"):
        btr.coevolve(experiment, Twin(experiment), out=tmp_path)
    with pytest.raises(btr.BtrError, match="differs from the one that"):
        btr.coevolve(experiment, out=tmp_path, resume=True)
    robot = Twin(experiment)
    assert finished(experiment, tmp_path, robot, resume=True) == undisturbed
    assert [controller.number for controller in robot.asked] == [3, 4, 5]


def test_a_callback_may_end_the_run(experiment: btr.Model, undisturbed: dict, tmp_path: Path) -> None:
    def tell(iteration: dict) -> None:
        if iteration["i"] == 2:
            raise Unplugged("enough")

    with pytest.raises(Unplugged, match="enough"):
        btr.coevolve(experiment, Twin(experiment), out=tmp_path, tell=tell)
    assert finished(experiment, tmp_path, Twin(experiment), resume=True) == undisturbed


def test_a_run_can_be_resumed_after_ctrl_c(tmp_path: Path) -> None:
    long = {"coevolve.iterations": 500, "coevolve.simulators.generations": 200, "coevolve.disengagement.patience": 500}
    script = (
        "import btr, sys\n"
        f"experiment = btr.load_model({str(ROBOTS / 'disengage.toml')!r}, {long!r})\n"
        f"btr.coevolve(experiment, out={str(tmp_path)!r}, tell=lambda it: print(it['i'], flush=True))\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        assert run.stdout is not None and run.stdout.readline() == "1\n"
        run.send_signal(signal.SIGINT)
        _, errors = run.communicate(timeout=120)
    assert "KeyboardInterrupt: go on with btr.coevolve(..., out=" in errors and "resume=True" in errors
    assert (tmp_path / "checkpoint.bin").exists()
    heard: list = []

    def enough(iteration: dict) -> None:
        heard.append(iteration["i"])
        raise Unplugged("enough")

    with pytest.raises(Unplugged):
        btr.coevolve(btr.load_model(ROBOTS / "disengage.toml", long), out=tmp_path, resume=True, tell=enough)
    assert heard[0] >= 2


def test_ctrl_c_ends_a_diagnosis_within_a_round() -> None:
    learn = [str(path) for path in sorted((ROBOTS / "arm").glob("learn_*.csv"))]
    arm = btr.load_model(ROBOTS / "arm.toml")
    steps: list[str] = []

    def tell(step: str, *errors: object) -> None:
        steps.append(step)
        if len(steps) == 2:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        btr.diagnose(arm, learn, tell=tell)
    # It ended within the following round, which would have reported an effect.
    assert steps == ["model as it stands", "its parameters fitted"]


def test_the_book_says_what_an_experiment_needs(tmp_path: Path) -> None:
    page = (ROBOTS.parent / "docs" / "howto" / "coevolve.md").read_text()
    block = next(block for block in re.findall(r"```toml[^\n]*\n(.*?)```", page, re.DOTALL) if "[drive]" in block)
    robot = 'name = "leg"\n[robot]\nbuiltin = "pendulum"\n[actuators."*"]\nkind = "position"\nkp = 10.0\nkd = 0.4\n'
    experiment = btr.Model(f'{robot}[parameters]\n"mass@bob" = {{ relative = [0.5, 1.5] }}\n{block}')
    reality = experiment.at({"mass@bob": 1.3})
    names = [dim["name"] for dim in experiment.controllers]
    asked: list[btr.Controller] = []

    def leg(controller: btr.Controller) -> btr.Log:
        asked.append(controller)
        (log,) = reality.simulate_all(controllers={name: controller.parameters[name] for name in names})
        assert log is not None
        return log

    found = btr.coevolve(experiment, leg, out=tmp_path)
    assert (len(asked), found.real_tests, len(found.iterations)) == (6, 6, 3)
    assert btr.load_model(found.adapted).values["mass@bob"] == pytest.approx(1.3, rel=1e-3)


LIFT = """<robot name="lift"><link name="frame"/>
<joint name="slide" type="prismatic"><parent link="frame"/><child link="carriage"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1000" velocity="10"/></joint>
<link name="carriage"><inertial><mass value="5"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


def test_commands_of_a_slide_are_in_metres(experiment: btr.Model, tmp_path: Path) -> None:
    (tmp_path / "lift.urdf").write_text(LIFT)
    head, loop = (
        'name = "lift"\n[robot]\nurdf = "lift.urdf"\nbase = "fixed"\n'
        '[actuators."*"]\nkind = "position"\nkp = 500.0\nkd = 50.0\n',
        experiment.text[experiment.text.index("[drive]") : experiment.text.index("[reality]")],
    )
    search = experiment.text[experiment.text.index("[coevolve]") :]
    parameters = '[parameters]\n"mass@carriage" = { relative = [0.5, 1.5] }\n[simulation]\nduration_s = 1.0\n'
    lift = btr.Model(head + parameters + loop + search, tmp_path / "lift.toml")
    assert {dim["name"]: dim["unit"] for dim in lift.controllers}["amplitude@slide"] == "m"

    def robot(controller: btr.Controller) -> btr.Log:
        raise Unplugged(controller.references.unit("cmd_slide"))

    with pytest.raises(Unplugged, match="^m$"):
        btr.coevolve(lift, robot, out=tmp_path / "run")


def test_ctrl_c_ends_a_population() -> None:
    nao = btr.load_model(ROBOTS / "nao.toml")
    rows = [list(nao.values.values())] * 4000
    interrupt = threading.Timer(1.0, lambda: os.kill(os.getpid(), signal.SIGINT))
    interrupt.start()
    with pytest.raises(KeyboardInterrupt) as raised:
        nao.simulate_all(rows)
    assert raised.traceback[-1].name == "simulate_all"


def test_an_iteration_prints_in_a_line(undisturbed: dict) -> None:
    first = undisturbed["iterations"][0]
    line = (
        r"iteration 1: 2 real tests; phi [\d.e-]+, [\d.e-]+ for the one before on fresh tests; "
        r"fitness [\d.]+ promised, [\d.]+ real"
    )
    assert re.fullmatch(line, str(btr.Iteration(first))), str(btr.Iteration(first))
    nothing = dict.fromkeys(["phi_predicted", "fitness_sim", "fitness_real"])
    assert str(btr.Iteration(first | nothing | {"phi": 0.25})) == "iteration 1: 2 real tests; phi 0.25"


def test_a_waiting_run_says_for_what_it_waits(tmp_path: Path, experiment: btr.Model) -> None:
    text = experiment.text.replace('kind = "twin"', 'kind = "manual"')
    text = "\n".join(
        line for line in text.splitlines() if not line.startswith(("parameters = ", "effects = ", "noise = "))
    )
    found = btr.coevolve(btr.Model(text, experiment.path), out=tmp_path)
    assert (
        found.stop_reason is None
        and "references.csv" in found.waiting_for
        and "resume=True" in found.waiting_for
        and "waiting for a real test" in repr(found)
    )
    assert found.missing == [] and "<img" not in found._repr_html_()
    assert json.loads((tmp_path / "history.json").read_text())["real_tests"] == 0
