"""A user's own effect: a law as an expression and as a function, in a small model whose parameters are known."""

import json
import math
import os
import pickle
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context, parent_process
from pathlib import Path

import numpy as np
import pytest

import btr

HERE = Path(__file__).parent

MODEL = """name = "swing"
[robot]
builtin = "pendulum"
length_m = 0.3
[actuators.hinge]
kind = "position"
kp = 10.0
kd = 0.2
[simulation]
control_s = 0.01
steps_per_control = 5
sample_every = 5
duration_s = 2.0
[noise]
position_rad = 0.001
[parameters]
"kp@hinge" = { relative = [0.8, 1.25] }
[drive]
kind = "sine"
omega_rad_s = 6.0
set = { "amplitude@hinge" = 0.6, "phase@hinge" = 0.0 }
"""
EXPRESSION = "-a*dq*abs(dq)"


def drag(q: float, dq: float, ddq: float, cmd: float, tau: float, t: float, a: float) -> float:
    return -a * dq * abs(dq)


def brittle(q: float, dq: float, ddq: float, cmd: float, tau: float, t: float) -> float:
    if t > 0.5:
        raise ZeroDivisionError(f"at {t}")
    return 0.0


def brittle_in_workers(q: float, dq: float, ddq: float, cmd: float, tau: float, t: float) -> float:
    if parent_process() is not None:
        raise ZeroDivisionError("not at home")
    return 0.0


# Workers cannot import functions of an interactive session.
NOTEBOOK = """
import btr, sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

def pull(q, dq, ddq, cmd, tau, t, a):
    return -a * q

swing = btr.Model(sys.argv[1])
log = swing.add_law(pull, site="hinge", a=0.3).simulate(seed=1)
pulled = swing.add_law(pull, site="hinge", a=(0.0, 1.0))
with ProcessPoolExecutor(1, get_context("spawn")) as pool:
    print("the same" if btr.fit(pulled, log, executor=pool).values == btr.fit(pulled, log).values else "another")
"""


@pytest.fixture(scope="module")
def swing() -> btr.Model:
    return btr.Model(MODEL)


@pytest.fixture(scope="module")
def logs(swing: btr.Model) -> list[btr.Log]:
    """Logs of the robot with a drag that is defined by a function."""
    planted = swing.add_law(drag, site="hinge", a=0.07)
    return [planted.simulate(seed=seed) for seed in (1, 2)]


@pytest.fixture(scope="module")
def with_drag(swing: btr.Model) -> btr.Model:
    return swing.add_law(drag, site="hinge", a=(0.0, 0.5))


def without_time(result: btr.FitResult) -> dict:
    return {key: value for key, value in result.document.items() if key != "seconds"}


def test_the_text_contains_an_expression_and_its_parameters(swing: btr.Model) -> None:
    model = swing.add_law("-a*tanh(dq/b)", site="hinge", on="torque", a=(0.0, 2.0), b=0.1)
    section = 'effect = "formula"\nsite = "hinge"\non = "torque"\nlaw = "-a*tanh(dq/b)"\na = 1.0\nb = 0.1\n'
    assert section in model.text and '"formula.a@hinge" = { bounds = [0.0, 2.0] }' in model.text
    assert "formula.b@hinge" not in model.text and "formula" not in swing.text
    assert pickle.loads(pickle.dumps(model)) == model
    further = model.add_law("c*sin(9*q)", site="hinge", on="command", c=(0.01, 1.0))
    assert further.text.count("[[effects]]") == 2 and "c = 0.1\n" in further.text
    inline = btr.Model("effects = []\n" + MODEL).add_law("-a*q", site="hinge", a=0.5)
    assert 'effects = [{ effect = "formula", site = "hinge", on = "torque", law = "-a*q", a = 0.5 }]' in inline.text


@pytest.mark.parametrize(
    ("on", "text", "law"),
    [
        ("torque", EXPRESSION, drag),
        ("command", "cmd + a*q", lambda q, dq, ddq, cmd, tau, t, a: cmd + a * q),
        ("reading", "q + a*t", lambda q, dq, ddq, cmd, tau, t, a: q + a * t),
    ],
)
def test_a_function_does_what_the_same_expression_does(swing: btr.Model, on: str, text: str, law) -> None:
    by_expression, called = (swing.add_law(which, site="hinge", on=on, a=0.3).simulate(seed=1) for which in (text, law))
    assert by_expression == called and by_expression != swing.simulate(seed=1)


def test_fit_recovers_what_a_function_planted(with_drag: btr.Model, logs: list) -> None:
    fitted = btr.fit(with_drag, logs[0], held_out=logs[1])
    [number] = [p for p in fitted.parameters if p["name"] == "formula.a@hinge"]
    assert number["ci95"][0] < 0.07 < number["ci95"][1] and abs(number["value"] - 0.07) < 0.005, number
    assert fitted.train < 1.1 and fitted.held_out < 1.1 and fitted.error_ladder[0]["train"] > 5
    [position] = [channel for channel in btr.compare(fitted.model, logs).channels if channel["name"] == "q_hinge"]
    assert position["chi"] < 1.2, position
    assert btr.diagnose(fitted.model, logs[0], held_out=logs[1]).verdict == "nothing_missing"


def test_diagnose_finds_a_further_missing_effect(swing: btr.Model, with_drag: btr.Model) -> None:
    rubbing = swing.add("coulomb_friction@hinge").text.replace("value = 0.0", "value = 0.1")
    logs = [btr.Model(rubbing).add_law(drag, site="hinge", a=0.07).simulate(seed=seed) for seed in (1, 2)]
    assert btr.diagnose(with_drag, logs[0], held_out=logs[1]).names == ["coulomb_friction@hinge"]


def test_one_thread_or_many_and_a_function_or_text_give_the_same_fit(
    swing: btr.Model, with_drag: btr.Model, logs: list
) -> None:
    # Expressions are simulated on all cores, functions on one.
    by_expression = btr.fit(swing.add_law(EXPRESSION, site="hinge", a=(0.0, 0.5)), logs[0])
    with ThreadPoolExecutor(3) as others:
        called = list(others.map(lambda _: btr.fit(with_drag, logs[0]), range(3)))
    assert [without_time(fitted) for fitted in called] == 3 * [without_time(by_expression)]


def test_functions_are_called_in_workers(swing: btr.Model, with_drag: btr.Model, logs: list) -> None:
    here = without_time(btr.fit(with_drag, logs[0]))
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        assert without_time(btr.fit(with_drag, logs[0], executor=pool)) == here
        with pytest.raises(ZeroDivisionError, match="not at home"):
            btr.fit(swing.add_law(brittle_in_workers, site="hinge"), logs[0], executor=pool)
    with ThreadPoolExecutor(2) as others:
        assert without_time(btr.fit(with_drag, logs[0], executor=others)) == here


def test_a_function_of_a_notebook_goes_by_value() -> None:
    pytest.importorskip("cloudpickle")
    ran = subprocess.run([sys.executable, "-c", NOTEBOOK, MODEL], capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0 and ran.stdout == "the same\n", ran.stderr


def test_exceptions_of_a_function_are_raised_and_leave_no_state(swing: btr.Model, logs: list) -> None:
    model = swing.add_law(brittle, site="hinge")
    verbs = (
        model.simulate,
        lambda: btr.compare(model, logs),
        lambda: btr.check(model, logs),
        lambda: btr.fit(model, logs[0]),
    )
    for verb in verbs:
        with pytest.raises(ZeroDivisionError, match="at 0.5") as raised:
            verb()
        assert raised.traceback[-1].name == "brittle"
    with pytest.raises(ZeroDivisionError):
        btr.diagnose(model, logs[0])
    assert swing.simulate() == swing.simulate()


@pytest.mark.parametrize(
    ("answer", "kind", "message"),
    [
        (math.nan, btr.BtrError, "gave NaN at q=.*\nhelp: a law must give a finite number"),
        (math.inf, btr.BtrError, "gave inf at q="),
        (None, TypeError, "gave None, not a number"),
    ],
)
def test_invalid_results_of_a_function_are_reported(swing: btr.Model, answer, kind: type, message: str) -> None:
    for on in ("torque", "command", "reading"):
        model = swing.add_law(lambda *scene: answer, site="hinge", on=on)
        with pytest.raises(kind, match=message):
            model.simulate()


@pytest.mark.parametrize(
    ("law", "on", "gave"),
    [
        ("a/(t - t)", "torque", "inf"),
        ("a*sqrt(0.5 - t)", "command", "NaN"),
        ("q + a*log(0.5 - t)", "reading", "(-inf|NaN)"),
    ],
)
def test_an_expression_that_gives_no_number_is_named(
    swing: btr.Model, logs: list, law: str, on: str, gave: str
) -> None:
    model = swing.add_law(law, site="hinge", on=on, a=(1.0, 4.0))
    gives = rf"the law `{re.escape(law)}` on the {on} of `hinge` gave {gave} at q=.*, t=.* with a=2"
    message = rf"{gives}\nhelp: a law must give a finite"
    for verb in (model.simulate, lambda: btr.compare(model, logs), lambda: btr.fit(model, logs[0])):
        with pytest.raises(btr.BtrError, match=message):
            verb()


def test_exceptions_of_a_function_in_a_report_are_raised(swing: btr.Model, logs: list, tmp_path: Path) -> None:
    tired = False

    def fickle(*scene: float) -> float:
        if tired:
            raise RuntimeError("no more")
        return 0.0

    compared = btr.diagnose(swing.add_law(fickle, site="hinge"), logs[0], max_effects=1)
    tired = True
    with pytest.raises(RuntimeError, match="no more"):
        compared.report(tmp_path / "why.html")


def test_numbers_of_numpy_are_numbers(swing: btr.Model) -> None:
    law = lambda q, dq, ddq, cmd, tau, t, a: np.float64(-a * dq * abs(dq))  # noqa: E731
    assert swing.add_law(law, site="hinge", a=0.3).simulate() == swing.add_law(drag, site="hinge", a=0.3).simulate()


def test_control_c_ends_the_work(swing: btr.Model) -> None:
    calls = 0

    def slow(*scene: float) -> float:
        nonlocal calls
        calls += 1
        if calls == 10:
            signal.raise_signal(signal.SIGINT)
        if calls > 10:
            time.sleep(0.01)
        return 0.0

    with pytest.raises(KeyboardInterrupt):
        swing.add_law(slow, site="hinge").simulate()
    assert calls < 3000, "a whole simulation asks three times in each of a thousand steps"


def test_a_function_may_simulate_itself(swing: btr.Model) -> None:
    inner = swing.add_law(drag, site="hinge", a=0.3)
    steps = iter(range(10**6))
    law = lambda *scene: 0.0 if next(steps) else len(inner.simulate()) * 0.0  # noqa: E731
    assert len(swing.add_law(law, site="hinge").simulate()) == len(swing.simulate())


def test_pickles_hold_functions(swing: btr.Model, with_drag: btr.Model, logs: list, tmp_path: Path) -> None:
    again = pickle.loads(pickle.dumps(with_drag))
    assert again == with_drag and again.laws == {"drag": drag}
    (tmp_path / "model.pickle").write_bytes(pickle.dumps((with_drag, logs[0])))
    script = (
        "import pickle, sys\n"
        "model, log = pickle.load(open(sys.argv[1], 'rb'))\n"
        "print(model.simulate(log)['q_hinge'].tobytes().hex())"
    )
    command = [sys.executable, "-c", script, tmp_path / "model.pickle"]
    run = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(HERE)})
    by_expression = swing.add_law(EXPRESSION, site="hinge", a=(0.0, 0.5)).simulate(logs[0])
    assert run.stdout.strip() == by_expression["q_hinge"].tobytes().hex(), run.stderr


def test_pickles_hold_functions_without_a_module_by_their_code(swing: btr.Model, monkeypatch) -> None:
    factor = 2.0
    model = swing.add_law(lambda q, dq, ddq, cmd, tau, t: -factor * dq, site="hinge")
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "cloudpickle", None)
        patch.setitem(sys.modules, "ray.cloudpickle", None)
        with pytest.raises(pickle.PicklingError, match="install cloudpickle"):
            pickle.dumps(model)
    pytest.importorskip("cloudpickle", reason="cloudpickle is optional")
    assert pickle.loads(pickle.dumps(model)).simulate() == model.simulate()


def test_a_saved_text_names_its_function(with_drag: btr.Model, tmp_path: Path) -> None:
    saved = tmp_path / "saved.toml"
    with_drag.save(saved)
    with pytest.raises(btr.BtrError, match=r"saved.toml:\d+:\d+: the law `python:drag` is a function.*\n.*laws="):
        btr.load_model(saved)
    assert btr.load_model(saved, laws={"drag": drag}).simulate() == with_drag.simulate()
    with pytest.raises(
        TypeError, match=r"the law drag is called with \(q, dq, ddq, cmd, tau, t, a\), but this one has"
    ):
        btr.load_model(saved, laws={"drag": without_a})
    command = [sys.executable, "-m", "btr", "simulate", saved, "-q", "-o", tmp_path / "log.csv"]
    refused = subprocess.run(command, capture_output=True, text=True)
    assert refused.returncode == 2 and "the law `python:drag` is a function" in refused.stderr


def test_the_command_line_understands_an_expression(swing: btr.Model, logs: list, tmp_path: Path) -> None:
    model, log = swing.add_law(EXPRESSION, site="hinge", a=(0.0, 0.5)), tmp_path / "log.csv"
    model.save(tmp_path / "model.toml")
    logs[0].write(log)
    command = [
        sys.executable,
        "-m",
        "btr",
        "fit",
        tmp_path / "model.toml",
        log,
        "-o",
        tmp_path / "fitted.toml",
        "--json",
        "-q",
    ]
    document = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    values = {parameter["name"]: parameter["value"] for parameter in document["parameters"]}
    assert values == btr.fit(model, log).values


def without_a(q: float, dq: float, ddq: float, cmd: float, tau: float, t: float) -> float:
    return 0.0


@pytest.mark.parametrize(
    ("law", "asked", "kind", "message"),
    [
        ("-a*(q", {"a": 0.1}, btr.BtrError, "model.toml:.*the law cannot be read"),
        ("-a*q", {}, btr.BtrError, "the law contains the unknown name `a`; known names: q, dq"),
        ("-a*q", {"a": 0.1, "b": 0.1}, btr.BtrError, "`b` does not occur in the law"),
        ("-dq*q", {"dq": 0.1}, btr.BtrError, "`dq` is a reserved name"),
        ("-law*q", {"law": 0.1}, btr.BtrError, "a law's parameter cannot be called `law`"),
        ("-a*q", {"a": (2.0, 0.0)}, btr.BtrError, "formula.a@hinge"),
        ("-a*q", {"a": (0.0, math.nan)}, btr.BtrError, "a@hinge.bounds.1 = NaN must be a finite number"),
        ("-a*q", {"a": 0.1, "site": "knee"}, btr.BtrError, "knee"),
        ("-a*q", {"a": 0.1, "on": "speed"}, btr.BtrError, "speed"),
        ("-a*q", {"a": "much"}, TypeError, r"a is a number or \(least, most\), not 'much'"),
        ("-a*q", {"a": (1, 2, 3)}, TypeError, r"a is a number or \(least, most\)"),
        (3, {}, TypeError, "a law is an expression or a function, not int"),
        (without_a, {"a": 0.1}, TypeError, "unexpected keyword argument 'a'"),
        (drag, {}, TypeError, "missing a required argument: 'a'"),
    ],
)
def test_invalid_laws_are_reported(swing: btr.Model, law, asked: dict, kind: type, message: str) -> None:
    with pytest.raises(kind, match=message):
        swing.add_law(law, **{"site": "hinge", **asked})


def test_an_expression_means_what_it_means_in_python(swing: btr.Model) -> None:
    text = "-a*q**2 + 1e-2*-dq - 2**-1*a*-q/3"
    by_expression, called = (
        swing.add_law(law, site="hinge", a=0.3).simulate(seed=1)
        for law in (text, eval("lambda q, dq, ddq, cmd, tau, t, a: " + text))
    )
    assert by_expression == called


def test_names_that_are_taken_are_refused(with_drag: btr.Model) -> None:
    with pytest.raises(btr.BtrError, match="another formula at `hinge` has one"):
        with_drag.add_law("-a*q", site="hinge", a=0.1)
    other = lambda *scene: 0.0  # noqa: E731
    other.__name__ = "drag"
    with pytest.raises(btr.BtrError, match="another law called drag"):
        with_drag.add_law(other, site="hinge")
    assert len(with_drag.add_law("-b*q", site="hinge", b=0.1).laws) == 1
    with pytest.raises(TypeError, match="the law drag must be a function"):
        btr.Model(with_drag.text, laws={"drag": "drag"})


def test_models_may_have_different_functions_of_one_name(swing: btr.Model) -> None:
    def made(factor: float):
        def law(*scene: float) -> float:
            return -factor * scene[1]

        return law

    one, other = (swing.add_law(made(factor), site="hinge") for factor in (0.1, 0.9))
    assert one.text == other.text and one != other and one.simulate() != other.simulate()
