"""Logs of positions alone, of a swinging arm: their initial state is estimated with the model and counts as no
error."""

import numpy as np
import pytest

import btr

MODEL = """name = "two"
[robot]
urdf = "two.urdf"
base = "fixed"
[actuators."*"]
kind = "position"
kp = 20.0
kd = 0.5
[noise]
position_rad = 0.0005
[parameters]
"mass@upper" = { relative = [0.75, 1.33] }
"mass@forearm" = { relative = [0.75, 1.33] }
"kp@*" = { relative = [0.85, 1.18] }
"""


def link(name: str, mass: float, length: float) -> str:
    inertia = mass * length**2 / 12
    return (
        f'<link name="{name}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="{mass}"/>'
        f'<inertia ixx="{mass * 1e-4}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def joint(name: str, parent: str, child: str, along: float) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{along} 0 0"/><axis xyz="0 1 0"/>'
        '<limit lower="-2.5" upper="2.5" effort="30" velocity="20"/></joint>'
    )


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> btr.Model:
    folder = tmp_path_factory.mktemp("two")
    parts = ['<link name="base"/>', joint("j1", "base", "upper", 0), link("upper", 0.8, 0.3)]
    parts += [joint("j2", "upper", "forearm", 0.3), link("forearm", 0.5, 0.25)]
    (folder / "two.urdf").write_text(f'<robot name="two">{"".join(parts)}</robot>')
    return btr.Model(MODEL, folder / "two.toml")


def recorded(robot: btr.Model, seed: int, hold_s: float, cut_s: float) -> btr.Log:
    """Five seconds of swinging from a held pose; the recording starts at `cut_s`."""
    random, clock_s = np.random.default_rng(seed), np.arange(0, 5 + hold_s, 0.01)
    since_s = np.maximum(clock_s - hold_s, 0)

    def waves() -> np.ndarray:
        parts = zip(random.uniform(0.1, 0.3, 3), random.uniform(1, 8, 3), random.uniform(0, 3.1, 3))
        return np.minimum(since_s, 1) * sum(a * np.sin(w * since_s + p) for a, w, p in parts)

    response = robot.simulate(btr.Log(clock_s, {"cmd_j1": waves(), "cmd_j2": waves()}), seed=seed)
    # A simulation logs each of its steps; the robot's log has a row for each command.
    rows = np.arange(0, len(response), round(0.01 / response.clock_s[1]))
    rows = rows[response.clock_s[rows] >= cut_s - 1e-9]
    return btr.Log(
        response.clock_s[rows], {name: response[name][rows] for name in ("cmd_j1", "cmd_j2", "q_j1", "q_j2")}
    )


@pytest.mark.parametrize(("hold_s", "cut_s"), [(0.0, 0.0), (0.0, 1.0), (1.5, 1.0)])
def test_a_true_model_has_no_error_from_the_initial_state(two: btr.Model, hold_s: float, cut_s: float) -> None:
    real = two.at({"mass@forearm": 0.6})
    for seed in range(200, 204):
        logs = [recorded(real, 3 * seed + k, hold_s, cut_s) for k in range(3)]
        assert max(channel["chi"] for channel in btr.compare(real, logs).channels) < 1.15
        fitted = btr.fit(two, logs[:2], held_out=logs[2])
        assert fitted.train < 1.05 and fitted.held_out < 1.1
        assert btr.diagnose(two, logs[:2], held_out=logs[2]).verdict == "nothing_missing"


def test_a_missing_effect_is_still_named(two: btr.Model) -> None:
    loaded = two.add("payload@forearm")
    real = loaded.at({"mass@forearm": 0.6, "payload.mass@forearm": 0.3})
    logs = [recorded(real, seed, 0.0, 1.0) for seed in (606, 607, 608)]
    found = btr.diagnose(two, logs[:2], held_out=logs[2])
    assert (found.verdict, found.names) == ("effect_missing", ["payload@forearm"])
    fitted = btr.fit(loaded, logs[:2], held_out=logs[2])
    assert fitted.values["payload.mass@forearm"] == pytest.approx(0.3, abs=0.02) and fitted.held_out < 1.1
    # An error that no initial state compensates for is still visible.
    assert max(channel["chi"] for channel in btr.compare(two, logs).channels) > 10


def test_bad_logs_are_reported(two: btr.Model) -> None:
    log = recorded(two, 1, 0.0, 0.0)
    degrees = {name: log[name] * (180 / np.pi if name.startswith("q_") else 1.0) for name in log.keys()}
    with pytest.warns(UserWarning, match="is it in degrees"):
        btr.fit(two, btr.Log(log.clock_s, degrees))
