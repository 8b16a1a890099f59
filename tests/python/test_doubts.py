"""Warnings about bad logs and bad real tests, and no warnings about good ones."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import btr

ROBOTS = Path(__file__).parents[2] / "robots"
SMALL = {"coevolve.iterations": 1, "coevolve.controllers.generations": 1, "coevolve.simulators.generations": 2}
Columns = dict[str, Any]


@pytest.fixture(scope="module")
def pendulum() -> btr.Model:
    """A pendulum and its loop, whose model equals its robot."""
    return btr.load_model(ROBOTS / "disengage.toml", {**SMALL, "coevolve.simulators.refine": 0})


def run_with(
    experiment: btr.Model, folder: Path, change: Callable[[Columns], Columns]
) -> tuple[list[str], btr.CoevolveResult]:
    """The warnings and the result of a run whose robot is its model, with `change` applied to each log."""

    def robot(controller: btr.Controller) -> Columns:
        log = experiment.simulate(controller, seed=controller.number)
        return change({"t": log.clock_s, **log.to_dict()})

    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        found = btr.coevolve(experiment, robot, out=folder)
    return [str(warning.message) for warning in heard], found


def rows(log: Columns, which: slice) -> Columns:
    return {name: values[which] for name, values in log.items()}


def test_a_robot_that_follows_its_commands_has_no_doubts(pendulum: btr.Model, tmp_path: Path) -> None:
    for name, change in {
        "same": lambda log: log,
        "epoch": lambda log: log | {"t": log["t"] + 1.7e9},
        "word": lambda log: rows(log, slice(1, None)),
        "before": lambda log: {key: np.concatenate([np.full(30, x[0]), x]) for key, x in log.items()}
        | {"t": np.arange(-30, len(log["t"])) * 0.01},
        "rounded": lambda log: log | {"cmd_hinge": np.round(log["cmd_hinge"], 3)},
        "no commands": lambda log: {key: x for key, x in log.items() if key != "cmd_hinge"} | {"t": log["t"] + 5e8},
    }.items():
        heard, found = run_with(pendulum, tmp_path / name, change)
        assert heard == [] and found.doubts == [], (name, heard)


def test_shifted_commands_are_reported(pendulum: btr.Model, tmp_path: Path) -> None:
    def lost(log: Columns, count: int = 2) -> Columns:
        log = rows(log, slice(count, None))
        return log | {"t": log["t"] - log["t"][0]}

    heard, found = run_with(pendulum, tmp_path / "lost", lost)
    assert heard == [
        "real test 0: its commands come 20 ms before they were requested: did it lose rows at its beginning? "
        "It is compared as if it had not"
    ]
    assert found.doubts[0]["topic"] == "command_lag" and found.doubts[0]["severity"] == "bad"

    def waits(log: Columns) -> Columns:
        late = {name: np.concatenate([np.full(30, values[0]), values[:-30]]) for name, values in log.items()}
        return late | {"t": log["t"]}

    heard, _ = run_with(pendulum, tmp_path / "late", waits)
    assert any("its commands come 300 ms after they were requested" in line for line in heard), heard
    heard, _ = run_with(pendulum, tmp_path / "other", lambda log: log | {"cmd_hinge": -log["cmd_hinge"]})
    assert any("its cmd_hinge is not what was requested, at any shift in time" in line for line in heard), heard


def test_possible_times_of_a_log_are_kept(pendulum: btr.Model, tmp_path: Path) -> None:
    masses = {}
    for name, change in {
        "whole": lambda log: log,
        "word": lambda log: rows(log, slice(2, None)),
        "zeroed": lambda log: rows(log, slice(2, None)) | {"t": log["t"][:-2]},
    }.items():
        heard, found = run_with(pendulum, tmp_path / name, change)
        masses[name] = found.iterations[-1]["phi"]
        assert (heard == []) == (name == "whole"), (name, heard)
    assert masses["word"] < 2.0 * masses["whole"] < masses["zeroed"], masses


def test_a_test_with_another_initial_pose_is_reported(pendulum: btr.Model, tmp_path: Path) -> None:
    def robot(controller: btr.Controller) -> btr.Log:
        commands = controller.references.to_dict()
        start = {"q_hinge": np.full(len(controller.references), 0.9)}
        return pendulum.simulate(btr.Log(controller.references.clock_s, commands | start), seed=1)

    with pytest.warns(UserWarning) as heard:
        btr.coevolve(pendulum, robot, out=tmp_path)
    assert [str(warning.message) for warning in heard] == [
        "real test 0: q_hinge begins at 0.900 rad, but the test and its simulations begin at 0.000 rad"
    ]


def test_missing_data_of_a_log_is_reported(pendulum: btr.Model, tmp_path: Path) -> None:
    def frozen(log: Columns) -> Columns:
        log["q_hinge"][100:] = log["q_hinge"][100]
        return log

    for name, change, what in [
        ("half", lambda log: rows(log, slice(0, 150)), "its log ends at 1.49 s, but the test lasts 3 s"),
        (
            "few",
            lambda log: rows(log, slice(0, None, 8)),
            "its log has 38 samples, but the robot received 300 commands",
        ),
        ("none", lambda log: rows(log, slice(0, None, 20)), "16 samples in 3.00 s"),
        ("late", lambda log: rows(log, slice(20, None)), "its log begins 0.200 s into the test by its own clock"),
        ("frozen", frozen, "q_hinge stands still in every bit from 1.00 to 3.00 s, while its command changes by"),
        (
            "dead",
            lambda log: log | {"q_hinge": np.zeros(len(log["t"]))},
            "q_hinge never changes while its command does by",
        ),
    ]:
        heard, found = run_with(pendulum, tmp_path / name, change)
        assert any(line.startswith(f"real test 0: {what}") for line in heard), (name, heard)
        assert found.doubts, name


def test_joints_missing_in_a_log_are_reported(tmp_path: Path) -> None:
    ant = btr.load_model(ROBOTS / "ant-series.toml", {**SMALL, "coevolve.controllers.search.population": 4})
    heard, _ = run_with(
        ant, tmp_path / "some", lambda log: {k: x for k, x in log.items() if k not in ("q_L1_yaw", "q_R3_knee")}
    )
    assert heard == ["real test 0: q_L1_yaw, q_R3_knee are not in its log, and not compared"], heard
    heard, _ = run_with(ant, tmp_path / "all", lambda log: log)
    assert heard == [], heard


def test_a_run_stops_after_three_tests_without_data(pendulum: btr.Model, tmp_path: Path) -> None:
    many = btr.Model(pendulum.text.replace("count = 2", "count = 8"), pendulum.path)
    asked: list[int] = []

    def robot(controller: btr.Controller) -> btr.Log:
        asked.append(controller.number)
        raise btr.TestFailed("the gripper does not answer")

    with pytest.warns(UserWarning, match="real test 0: it gave no log: the gripper does not answer"):
        found = btr.coevolve(many, robot, out=tmp_path / "failed")
    assert asked == [0, 1, 2] and found.stop_reason == "no_real_data" and found.real_tests == 3
    assert "the gripper does not answer" in found.doubts[0]["sentence"]
    _, found = run_with(many, tmp_path / "empty", lambda log: log | {"q_hinge": np.full(len(log["t"]), np.nan)})
    assert found.stop_reason == "no_real_data" and found.real_tests == 3
    assert any("nothing that rmse could compare" in doubt["sentence"] for doubt in found.doubts)


@pytest.mark.parametrize("name", ["ant-series", "nao", "nao-kick", "disengage"])
def test_the_loop_simulates_the_controllers_that_it_requests(name: str, tmp_path: Path) -> None:
    # The Nao's run estimates a posterior and searches no simulators.
    small = {key: value for key, value in SMALL.items() if name != "nao" or "simulators" not in key}
    # An end between two references.
    experiment = btr.load_model(ROBOTS / f"{name}.toml", {**small, "simulation.duration_s": 0.79})
    names = [dim["name"] for dim in experiment.controllers]

    class Enough(Exception):
        pass

    def robot(controller: btr.Controller) -> btr.Log:
        (own,) = experiment.simulate_all(controllers={name: controller.parameters[name] for name in names})
        assert own is not None and controller.duration_s == 0.79
        assert (controller.base is None) == (name == "disengage")
        (many,) = experiment.simulate_all([list(experiment.values.values())], log=controller)
        for log in (experiment.simulate(controller), many):
            assert log is not None and np.array_equal(log.clock_s, own.clock_s)
            worst = max(np.abs(log[channel] - own[channel]).max() for channel in own.keys())
            assert worst < 1e-9, worst
        raise Enough

    with pytest.raises(Enough):
        btr.coevolve(experiment, robot, out=tmp_path)


def said(model: btr.Model, log: btr.Log) -> list[str]:
    findings = btr.check(model, log).document["logs"][0]["findings"]
    return [f"{finding['severity']}: {finding['sentence']}" for finding in findings]


def walks() -> list[tuple[btr.Model, btr.Log]]:
    """Logs of simulated robots with random parameters of their drives."""
    made, random = [], np.random.default_rng(0)
    for name in ["ant-series", "nao", "nao-kick"]:
        model = btr.load_model(ROBOTS / f"{name}.toml")
        points = [[random.uniform(dim["min"], dim["max"]) for dim in model.controllers] for _ in range(6)]
        made += [(model, log) for log in model.simulate_all(controllers=points) if log is not None]
    return made


def swings() -> list[tuple[btr.Model, btr.Log]]:
    """A pendulum below and beyond its resonance, with steps, and at its motor's limit."""
    free, t = btr.load_model(ROBOTS / "disengage.toml"), np.arange(0.0, 4.0, 0.01)
    weak = btr.Model(free.text.replace("kd = 0.4", "kd = 0.4\nmax_torque = 1.5"), free.path)
    steps = 0.8 * np.sign(np.sin(2.0 * t))
    return [
        (model, model.simulate(btr.Log(t, {"cmd_hinge": command}), seed=1))
        for model in (free, weak)
        for command in (
            steps,
            0.8 * np.sin(10 * t),
            0.5 * np.sin(14 * t),
            0.3 + 0.8 * np.sin(10 * t + 1),
            0.5 * np.sin(t),
        )
    ]


def test_loads_and_resonances_are_not_reported_as_reversed_joints() -> None:
    wrong = ("opposite to its command", "does not follow its command", "mixed up", "freeze", "encoder dead")
    for model, log in walks() + swings():
        assert [line for line in said(model, log) if any(word in line for word in wrong)] == [], model.name


def test_a_reversed_joint_is_reported() -> None:
    for model, log in swings():
        heard = said(
            model, btr.Log(log.clock_s, log.to_dict() | {"q_hinge": -log["q_hinge"], "dq_hinge": -log["dq_hinge"]})
        )
        assert any("bad: hinge moves opposite to its command" in line for line in heard), heard
    reported = 0
    for model, log in walks()[:6]:
        knees = [joint for joint in model.joints if joint.endswith("knee")]
        turned = {f"{kind}_{joint}": -log[f"{kind}_{joint}"] for joint in knees for kind in ("q", "dq")}
        heard = said(model, btr.Log(log.clock_s, log.to_dict() | turned))
        reported += sum("opposite to its command" in line for line in heard)
        assert not any("opposite to its command" in line and "knee" not in line for line in heard), heard
    assert reported >= 24, f"{reported} of 36"


def test_a_verdict_reports_noise_that_is_stated_too_low() -> None:
    model, t = btr.load_model(ROBOTS / "disengage.toml"), np.arange(0.0, 4.0, 0.01)
    rough = btr.Model(model.text.replace("[noise]\nposition_rad = 0.0005", "[noise]\nposition_rad = 0.003"), model.path)
    assert rough.text != model.text
    commands = [0.5 * np.sin(rate * t) + 0.3 * np.sin(2.3 * rate * t) for rate in (2.0, 2.6, 3.1)]
    logs = [rough.simulate(btr.Log(t, {"cmd_hinge": command}), seed=k) for k, command in enumerate(commands)]
    found = btr.diagnose(model, logs[:2], held_out=logs[2:])
    assert found.verdict == "unexplained", found
    (low,) = found.noise_stated_low
    # The noise of a log of 400 readings is known to about ten percent.
    assert low["channel"] == "q_hinge" and low["shown"] == pytest.approx(0.003, rel=0.2), low
    assert "is [noise] stated too low?" in repr(found), found
    assert btr.diagnose(rough, logs[:2], held_out=logs[2:]).noise_stated_low == []
    rubbing = rough.add("coulomb_friction@hinge").at({"coulomb_friction.torque@hinge": 0.5})
    other = [rubbing.simulate(btr.Log(t, {"cmd_hinge": command}), seed=k) for k, command in enumerate(commands)]
    assert btr.diagnose(rough, other[:2], held_out=other[2:]).noise_stated_low == []
