"""The verbs from Python, on the bundled arm: from a model and logs to a smaller error."""

import json
import pickle
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import btr
from typed import must_be_typed

ROBOTS = Path(__file__).parents[2] / "robots"
ARM = ROBOTS / "arm.toml"
LEARN = sorted((ROBOTS / "arm").glob("learn_*.csv"))
HELD_OUT = sorted((ROBOTS / "arm").glob("held_out_*.csv"))


@pytest.fixture(scope="module")
def arm() -> btr.Model:
    return btr.load_model(ARM)


@pytest.fixture(scope="module")
def answer(arm: btr.Model) -> tuple[btr.DiagnoseResult, list]:
    heard: list = []
    found = btr.diagnose(arm, LEARN, held_out=HELD_OUT, tell=lambda *step: heard.append(step))
    return found, heard


def test_the_missing_effect_is_named_and_the_error_falls(arm: btr.Model, answer: tuple, tmp_path: Path) -> None:
    found, heard = answer
    assert (found.verdict, found.names) == ("effect_missing", ["coulomb_friction@yaw"])
    assert [step for step, *_ in heard] == [step["step"] for step in found.error_ladder]
    assert "missing: coulomb_friction@yaw" in repr(found) and "The model lacks coulomb_friction" in found._repr_html_()
    fitted = btr.fit(arm, LEARN, held_out=HELD_OUT, add=found.names)
    must_be_typed(found)
    must_be_typed(fitted)
    assert fitted.held_out < 1.1 and fitted.values["coulomb_friction.torque@yaw"] > 0.1
    assert fitted.success and fitted.nfev > 0 and list(fitted.x) == list(fitted.values.values())
    before, after = btr.compare(arm, HELD_OUT), btr.compare(fitted.model, HELD_OUT)
    worst = [max(channel["chi"] for channel in compared.channels) for compared in (before, after)]
    assert worst[0] > 10 and worst[1] < 1.2, worst
    fitted.model.save(tmp_path / "fitted.toml")
    saved = btr.load_model(tmp_path / "fitted.toml")
    assert "coulomb_friction.torque@yaw" in saved.text and saved.joints == arm.joints


def test_what_a_diagnosis_found_is_in_its_model(arm: btr.Model, answer: tuple) -> None:
    found, _ = answer
    assert found.cut_short is False
    assert "coulomb_friction.torque@yaw" in [dim["name"] for dim in found.model.parameters]
    before, after = btr.compare(arm, HELD_OUT), btr.compare(found.model, HELD_OUT)
    worst = [max(channel["chi"] for channel in compared.channels) for compared in (before, after)]
    assert worst[0] > 10 and worst[1] < 1.2, worst
    early = btr.diagnose(arm, LEARN, held_out=HELD_OUT, max_time_s=1e-6)
    assert early.cut_short and early.names == [] and "cut short; so far: " in repr(early)


def test_a_fit_begins_at_what_a_diagnosis_found(arm: btr.Model, answer: tuple, tmp_path: Path) -> None:
    found, _ = answer
    fitted = btr.fit(arm, LEARN, held_out=HELD_OUT, start=found.model)
    assert fitted.error_ladder[1]["step"] == "at the other model's values"
    assert fitted.train <= 1.001 * found.error_ladder[-1]["train"]
    assert "coulomb_friction.torque@yaw" in fitted.model.text
    found.model.save(tmp_path / "found.toml")
    again = btr.fit(arm, LEARN, held_out=HELD_OUT, start=tmp_path / "found.toml")
    assert again.values == fitted.values
    with pytest.raises(btr.BtrError, match="another robot"):
        btr.fit(arm, LEARN, start=ROBOTS / "nao.toml")


def test_fitted_numbers_as_a_frame_have_the_ends_of_their_intervals(arm: btr.Model) -> None:
    pytest.importorskip("pandas", reason="frames need pandas")
    fitted = btr.fit(arm, LEARN, held_out=HELD_OUT, add="coulomb_friction@yaw")
    friction = fitted.to_dataframe().set_index("parameter").loc["coulomb_friction.torque@yaw"]
    assert friction["low"] < friction["value"] < friction["high"] and not friction["at_bound"]


def test_what_is_added_can_be_removed(arm: btr.Model, answer: tuple) -> None:
    effect, delay = "coulomb_friction@yaw", "command_delay@*"
    assert arm.add(effect, delay).remove(delay, effect).text == arm.text
    assert arm.add("armature").remove("armature").text == arm.text
    # As well at a value that was fitted, where the model states it.
    found, _ = answer
    bare = found.model.remove(effect)
    assert {dim.name for dim in bare.parameters} == {dim.name for dim in arm.parameters}
    with pytest.raises(btr.BtrError, match="the model has no `coulomb_friction@elbow`") as raised:
        found.model.remove("coulomb_friction@elbow")
    assert "it has: coulomb_friction@yaw" in str(raised.value)
    with pytest.raises(btr.BtrError, match="no effect to remove"):
        arm.remove()


def test_frozen_parameters_keep_their_values(arm: btr.Model) -> None:
    fitted = btr.fit(arm, LEARN[:1], freeze="mass@*")
    must_be_typed(fitted)
    assert fitted.frozen == [name for name in arm.values if name.startswith("mass@")] != []
    free = [name for name in arm.values if name not in fitted.frozen]
    assert list(fitted.values) == [dim.name for dim in fitted.space] == free
    assert all(fitted.model.values[name] == arm.values[name] for name in fitted.frozen)
    assert btr.diagnose(arm, LEARN[:1], freeze=["*"], max_rollouts=1).frozen == list(arm.values)
    with pytest.raises(btr.BtrError, match="matches no free parameter"):
        btr.fit(arm, LEARN[:1], freeze=["mas@*"])


def test_damaged_logs_are_left_out_with_a_warning(arm: btr.Model, tmp_path: Path) -> None:
    empty = tmp_path / "empty.csv"
    empty.write_text("")
    logs = [LEARN[0], empty]
    for verb in (btr.check, btr.compare, btr.fit, lambda *of, **options: btr.diagnose(*of, max_rollouts=1, **options)):
        with pytest.warns(UserWarning, match="left out: .*empty.csv: the file is empty"):
            found = verb(arm, logs)
        must_be_typed(found)
        assert [log.log for log in found.left_out] == [str(empty)] and "is empty" in found.left_out[0].reason
        with pytest.raises(btr.BtrError, match="the file is empty"):
            verb(arm, logs, strict=True)
        with pytest.raises(btr.BtrError, match="No such file"):
            verb(arm, [LEARN[0], tmp_path / "none.csv"])
    assert btr.check(arm, LEARN[:1]).left_out == []


def test_a_fitted_model_keeps_what_its_logs_left(arm: btr.Model) -> None:
    first = btr.fit(arm, LEARN[:1], add="coulomb_friction@yaw", freeze="mass@*")
    assert first.with_prior == [] and "sd = " in first.model.text
    after = btr.fit(first.model, LEARN[1:2], freeze="mass@*")
    must_be_typed(after)
    assert after.with_prior and set(after.with_prior) <= set(after.values)
    # A value that is set by hand is not known that well.
    sds = first.model.text.count("sd = ")
    assert first.model.at({"kp@yaw": 18.0}).text.count("sd = ") == sds - 1


ONE_LINK = """<robot name="lever"><link name="base"/><link name="lever"><inertial>
<origin xyz="0.2 0 0"/><mass value="2"/>
<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="lever"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="99" velocity="9"/></joint></robot>"""
LEVER = """name = "lever"
[robot]
urdf = "lever.urdf"
base = "fixed"
[actuators.hinge]
kind = "prescribed"
"""


def test_base_parameters_of_a_lever_are_found_and_written(tmp_path: Path) -> None:
    (tmp_path / "lever.urdf").write_text(ONE_LINK)
    (tmp_path / "lever.toml").write_text(LEVER)
    rng, t = np.random.default_rng(1), np.arange(0, 12, 0.004)
    swings = [(0.6, 1.3), (0.3, 2.9), (0.15, 3.7)]
    q = sum(a * np.sin(w * t) for a, w in swings)
    dq = sum(a * w * np.cos(w * t) for a, w in swings)
    ddq = -sum(a * w**2 * np.sin(w * t) for a, w in swings)
    # The lever is a tenth heavier than the model, and has viscous friction.
    tau = 1.1 * (0.1 * ddq - 9.81 * 0.4 * np.cos(q)) + 0.5 * dq + 0.05 * rng.standard_normal(len(t))
    log = {"t": t, "q_hinge": q + 1e-5 * rng.standard_normal(len(t)), "tau_hinge": tau}
    lever = btr.load_model(tmp_path / "lever.toml")
    fitted = btr.fit(lever, log, base_parameters=True)
    must_be_typed(fitted)
    base = fitted.base_parameters
    assert base is not None and base.possible is not None and base.possible.membership == "as_estimated"
    (moment,) = (c for c in base.combinations if c.parts[0].parameter == "mass*com_x@lever")
    assert moment.sd is not None and abs(moment.value - 0.44) < 4 * moment.sd and "[links.lever]" in fitted.model.text
    with pytest.raises(btr.BtrError, match="is simulated"):
        btr.fit(ARM, LEARN[:1], base_parameters=True)


def test_settings_need_no_quotes_but_names_that_are_names(arm: btr.Model) -> None:
    known = btr.load_model(ARM, {"parameters.mass@upper.relative": (0.5, 2.0)})
    (mass,) = (dim for dim in known.parameters if dim["name"] == "mass@upper")
    assert (mass["min"], mass["max"]) == pytest.approx([factor * mass["nominal"] for factor in (0.5, 2.0)])
    assert known.joints == arm.joints
    with pytest.raises(btr.BtrError, match=r"`parameters\.\.relative` is no name of a value"):
        btr.load_model(ARM, {"parameters..relative": 1.0})


def said(*arguments: object) -> dict:
    """The result of the command line, without its duration."""
    command = [sys.executable, "-m", "btr", *map(str, arguments), "--json", "-q"]
    document = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    return {key: value for key, value in document.items() if key != "seconds"}


def test_python_and_the_command_line_give_the_same_answer(arm: btr.Model, answer: tuple) -> None:
    found = {key: value for key, value in answer[0].document.items() if key != "seconds"}
    assert found == said("diagnose", ARM, *LEARN, "--held-out", *HELD_OUT)
    assert btr.compare(arm, LEARN).document == said("compare", ARM, *LEARN)
    assert btr.check(arm, LEARN).document == said("check", ARM, *LEARN)


def test_logs_are_arrays_frames_and_files(arm: btr.Model, tmp_path: Path) -> None:
    read = btr.load_log(LEARN[0])
    again = btr.Log(read.clock_s, read.to_dict(), "again")
    assert again == read and len(read) == len(read["q_yaw"]) and "q_yaw" in read
    again.write(tmp_path / "log.mcap")
    assert btr.load_log(tmp_path / "log.mcap").keys() == read.keys()
    assert pickle.loads(pickle.dumps(read)) == read
    by_path, by_log = btr.compare(arm, LEARN[0]), btr.compare(arm, read)
    assert by_path.channels == by_log.channels
    for library in ("pandas", "polars"):
        frame = pytest.importorskip(library).DataFrame({"t": read.clock_s, **read.to_dict()})
        assert btr.load_log(frame) == read
    degrees = btr.Log([0.0, 0.1], {"q_knee_deg": [0, 180]})
    np.testing.assert_allclose(degrees["q_knee"], [0, np.pi])
    assert degrees.unit("q_knee") == "rad"


def test_a_model_has_the_urdf_of_its_robot(arm: btr.Model) -> None:
    text = (ROBOTS / "arm.urdf").read_text()
    assert arm.urdf == text
    inside = arm.text.replace('urdf = "arm.urdf"', f"urdf_text = '''{text}'''")
    assert btr.Model(inside, "arm.toml").urdf == text
    nao = btr.load_model(ROBOTS / "nao.toml")
    written = {joint.get("name") for joint in ElementTree.fromstring(nao.urdf).iter("joint")}
    assert written.issuperset(nao.joints), "a built-in robot has no file"


def test_a_urdf_that_is_gone_is_named(tmp_path: Path) -> None:
    for name in ("arm.toml", "arm.urdf"):
        (tmp_path / name).write_text((ROBOTS / name).read_text())
    model = btr.load_model(tmp_path / "arm.toml")
    (tmp_path / "arm.urdf").unlink()
    with pytest.raises(btr.BtrError, match=re.escape(str(tmp_path / "arm.urdf"))):
        _ = model.urdf


def test_a_model_is_a_text(arm: btr.Model) -> None:
    assert pickle.loads(pickle.dumps(arm)) == arm and "yaw" in arm.joints
    one, other = arm.simulate(LEARN[0], seed=1), arm.simulate(LEARN[0], seed=1)
    assert one == other and one != arm.simulate(LEARN[0])
    more = arm.add("backlash@yaw")
    assert "backlash.gap@yaw" in more.text and "backlash" not in arm.text


def test_a_population_equals_its_single_rollouts(arm: btr.Model) -> None:
    assert [p["name"] for p in arm.parameters][:2] == ["mass@turret", "mass@upper"] and arm.controllers == []
    low, high = (np.array([p[end] for p in arm.parameters]) for end in ("min", "max"))
    points = low + (high - low) * np.random.default_rng(5).random((11, len(low)))
    together = arm.simulate_all(points, log=LEARN[0])
    assert len(together) == 11 and together == [arm.simulate_all([point], log=LEARN[0])[0] for point in points]
    nominal = [p["nominal"] for p in arm.parameters]
    assert arm.simulate_all([nominal], log=LEARN[0]) == [arm.simulate(LEARN[0])] and together[0] != together[1]


def test_free_parameters_have_names(arm: btr.Model) -> None:
    other = arm.at({"mass@upper": 0.5})
    assert other.values == {**arm.values, "mass@upper": 0.5} and other.parameters[0] == arm.parameters[0]
    assert arm.at(list(other.values.values())).values == other.values == arm.at(other.values).values
    assert other.at(arm.values).values == arm.values and arm.at({}) == arm
    assert all("mass@upper" in line for line in other.text.splitlines() if line not in arm.text)
    tried = arm.simulate_all({"mass@upper": [arm.values["mass@upper"], 0.5], "mass@turret": arm.values["mass@turret"]})
    assert tried == [arm.simulate(), other.simulate()] and tried[0] != tried[1]
    frame = pytest.importorskip("pandas").DataFrame({"mass@upper": [0.5]})
    assert arm.simulate_all(frame) == [other.simulate()]


def test_names_may_be_patterns(arm: btr.Model, tmp_path: Path) -> None:
    assert btr.compare(arm, f"{ROBOTS}/arm/learn_*.csv").document == btr.compare(arm, LEARN).document
    odd = tmp_path / "[1].csv"
    odd.write_bytes(Path(LEARN[0]).read_bytes())
    assert btr.compare(arm, odd).channels == btr.compare(arm, LEARN[0]).channels
    deeper = tmp_path / "a" / "b"
    deeper.mkdir(parents=True)
    (deeper / "deep.csv").write_bytes(odd.read_bytes())
    once = btr.check(arm, [odd, f"{tmp_path}/**/deep.csv", f"{tmp_path}/a/*/d*.csv"])
    assert [Path(log["log"]).name for log in once.logs] == ["[1].csv", "deep.csv"]
    with pytest.raises(btr.BtrError, match=r"monday_\*.csv: no file matches"):
        btr.compare(arm, "monday_*.csv")


def pendulum_with(effect: str) -> tuple[btr.Model, btr.Log]:
    """A pendulum, and a log of one with an additional effect."""
    pendulum = btr.load_model(ROBOTS / "disengage.toml")
    clock_s = np.arange(0, 3, 0.01)
    commands = btr.Log(clock_s, {"cmd_hinge": 0.3 * np.sin(5 * clock_s), "q_hinge": np.zeros(len(clock_s))})
    response = btr.Model(f"{pendulum.text}\n[[effects]]\n{effect}\n", pendulum.path).simulate(commands, seed=3)
    return pendulum, btr.Log(response.clock_s, {name: response[name] for name in ("cmd_hinge", "q_hinge")})


def test_a_next_experiment_separates_indistinguishable_effects() -> None:
    pendulum, log = pendulum_with('effect = "command_delay"\nsite = "hinge"\ndelay = 0.004')
    found = btr.diagnose(pendulum, log)
    assert found.names == ["command_delay@hinge"] and "motor_lag@hinge" in found.effects[0]["alike"]
    assert found.next_experiment is not None and found.next_experiment.separation > 1
    assert found.next_commands is not None and found.next_commands.keys() == ["cmd_hinge"]
    must_be_typed(found)
    again = pickle.loads(pickle.dumps(found))
    assert again.next_commands == found.next_commands and again == found


def test_an_unexplained_error_is_described_by_a_law(arm: btr.Model) -> None:
    truth = arm.add_law("-0.5*q*q*dq", site="elbow")
    learn, held_out = ([truth.simulate(log, seed=k) for k, log in enumerate(logs)] for logs in (LEARN, HELD_OUT))
    found = btr.diagnose(arm, learn, held_out=held_out)
    law = found.residual_law
    assert (
        found.verdict == "unexplained" and law is not None and law["site"] == "elbow" and found.next_experiment is None
    )
    must_be_typed(found)
    better = arm.add_law(law["law"], site=law["site"], on=law["on"])
    assert btr.fit(better, learn, held_out=held_out).held_out < 0.5 * found.error_ladder[-1]["held_out"]


def test_measurements_are_not_overwritten(tmp_path: Path) -> None:
    log = btr.load_log(LEARN[0])
    for path in (tmp_path / "log.csv", tmp_path / "log.mcap"):
        log.write(path)
        with pytest.raises(btr.BtrError, match="contains more than commands, which would be lost"):
            log.write(path)
        log.write(path, overwrite=True)
    commands = btr.Log(log.clock_s, {"cmd_yaw": log["cmd_yaw"]})
    commands.write(tmp_path / "commands.csv")
    commands.write(tmp_path / "commands.csv")


def test_a_bound_is_within_itself() -> None:
    model = btr.load_model(ARM, {'parameters."mass@turret".relative': [0.7, 1.0 / 0.7]})
    low = 0.7 * model.values["mass@turret"]
    for number in (low, round(low, 12), model.parameters[0]["max"]):
        assert model.at({"mass@turret": number}).values["mass@turret"] == number


def test_effects_are_listed() -> None:
    effects = btr.effects()
    assert len(effects.effects) > 30 and "coulomb_friction" in repr(effects)
    assert "Stribeck" not in repr(effects) and "Armstrong" in repr(btr.effects("stribeck_friction"))
    with pytest.raises(btr.BtrError, match="did you mean `stribeck_friction`"):
        btr.effects("stribek_friction")


@pytest.mark.parametrize(
    ("wrong", "error", "message"),
    [
        (lambda arm: arm.at({"mass@uper": 1.0}), btr.BtrError, "did you mean `mass@upper`"),
        (lambda arm: arm.at({"mass@upper": -1.0}), btr.BtrError, "lies outside its bounds"),
        (lambda arm: arm.at([1.0]), ValueError, r"shape \(1,\), but \(9,\)"),
        (
            lambda arm: arm.simulate_all({"kp@yaww": [20.0]}),
            btr.BtrError,
            "none of the model's parameters is called `kp@yaww`",
        ),
        (lambda arm: arm.simulate_all(controllers={"gain": [1.0]}), btr.BtrError, "there are no controllers"),
        (lambda arm: arm.simulate_all({}), ValueError, "or columns by name"),
        (lambda arm: arm.simulate_all(controllers=[[]], log=LEARN[0]), ValueError, "controllers would have no effect"),
        (lambda arm: arm.simulate_all({"mass@upper": [0.5], "mass@turret": [1.0, 2.0]}), ValueError, r"shape \(1,\)"),
        (lambda arm: arm.simulate_all(), ValueError, "needs parameters, controllers, or both"),
        (lambda arm: arm.simulate_all([[1.0, 2.0]]), ValueError, r"shape \(1, 2\), but \(1, 9\)"),
        (lambda arm: arm.simulate_all([1.0] * 9), ValueError, "shape"),
        (lambda arm: arm.simulate_all([[np.nan] * 9]), btr.BtrError, "mass@turret. = NaN lies outside"),
        (lambda arm: arm.simulate_all([[1e9] * 9]), btr.BtrError, "lies outside its bounds"),
        (lambda arm: arm.simulate_all(controllers=[[1.0]]), ValueError, r"controllers has shape \(1, 1\)"),
    ],
)
def test_invalid_points_are_reported(arm: btr.Model, wrong, error: type, message: str) -> None:
    with pytest.raises(error, match=message):
        wrong(arm)


def test_check_rates_logs(arm: btr.Model) -> None:
    checked = btr.check(arm, LEARN)
    with pytest.raises(AttributeError, match="CheckResult has no report: compare, diagnose and fit have one"):
        checked.report("check.html")
    assert len(checked.logs) == len(LEARN) and checked.rank > 0 and "fine" in repr(checked)


def without_positions() -> btr.Log:
    log = btr.load_log(LEARN[0])
    return btr.Log(log.clock_s, {name: log[name] for name in log.keys() if name.startswith("cmd_")})


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (lambda arm: btr.load_model("nowhere.toml"), "help: give the path of a model"),
        (lambda arm: btr.Model('name = "x"\n[robot]\nbuiltin = "cat"'), "cat"),
        (lambda arm: arm.add("coulomb_frictoin@yaw"), "coulomb_friction"),
        (lambda arm: arm.add("coulomb_friction@elbows"), "it can act on"),
        (lambda arm: btr.Log([0.0, 0.0], {}), "does not increase"),
        (lambda arm: btr.Log([0.0, 1.0], {"q_yaw": [1.0]}), "1 values, but the clock has 2"),
        (lambda arm: btr.diagnose(arm, "nowhere.csv"), "nowhere.csv"),
        (lambda arm: btr.compare(arm, without_positions()), "has no channel `q_yaw`"),
        (lambda arm: btr.diagnose(arm, btr.Log([0.0, 0.01], {"a": [0, 1]})), "cmd_"),
    ],
)
def test_invalid_values_are_reported_with_help(arm: btr.Model, mistake, message: str) -> None:
    with pytest.raises(btr.BtrError, match=message):
        mistake(arm)


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (lambda arm: btr.compare(arm, [3]), "a log is a path"),
        (lambda arm: btr.compare(arm, 3), "a log is a path, .*, not 3"),
        (lambda arm: btr.compare(3, LEARN), "a model is a Model or the path of its file, not 3"),
        (lambda arm: btr.diagnose(arm, LEARN, tell=3), "tell is a function that is called with every step, not 3"),
        (lambda arm: btr.diagnose(arm, LEARN, max_effects=1.5), "max_effects is a whole number, not 1.5"),
        (lambda arm: btr.diagnose(arm, LEARN, max_time_s="a"), "max_time_s is a number, not 'a'"),
        (lambda arm: arm.simulate(seed="a"), "seed is a whole number, not 'a'"),
        (lambda arm: arm.at({"mass@upper": "heavy"}), "mass@upper is a number, not str"),
        (lambda arm: btr.load_model(3), "a model is the path of a file, not 3"),
        (lambda arm: btr.load_model(ARM, ["name=x"]), "settings are values by dotted keys"),
        (lambda arm: btr.load_model(ARM, laws=[len]), "laws are functions by name"),
        (lambda arm: btr.Log([0.0, 1.0], {"q_yaw": ["x", "y"]}), "channel q_yaw is an array of numbers"),
        (lambda arm: btr.Log([0.0, 1.0], {"q_yaw": np.zeros((2, 2))}), "channel q_yaw is an array of numbers"),
    ],
)
def test_wrong_types_name_the_expected_one(arm: btr.Model, mistake, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        mistake(arm)


def test_none_means_no_argument(arm: btr.Model) -> None:
    fitted = btr.fit(arm, LEARN[:1], held_out=None, add=None, tell=None)
    assert {**fitted.document, "seconds": 0} == {**btr.fit(arm, LEARN[:1]).document, "seconds": 0}


def test_messages_speak_of_python(arm: btr.Model, tmp_path: Path) -> None:
    def said(mistake) -> str:
        with pytest.raises(btr.BtrError) as raised:
            mistake()
        return str(raised.value)

    log = btr.load_log(LEARN[0])
    log.write(tmp_path / "log.csv")
    assert said(lambda: log.write(tmp_path / "log.csv")).endswith("or write with overwrite=True what may be lost")
    assert "setting parameters..x=1.0: `parameters..x` is no name" in said(
        lambda: btr.load_model(ARM, {"parameters..x": 1.0})
    )
    messages = [
        said(mistake)
        for mistake in (
            lambda: btr.load_log("robots/arm.toml"),
            lambda: arm.add("coulomb"),
            lambda: arm.add("nothing_like_it_at_all"),
            lambda: btr.Model(
                f'{arm.text}\n[[effects]]\neffect = "formula"\nsite = "yaw"\non = "torque"\nlaw = "q +"\n', arm.path
            ),
            lambda: btr.fit(arm, btr.Log(np.arange(0, 1, 0.01), {name: np.zeros(100) for name in log.keys()})),
        )
    ]
    assert (
        'btr.effects("formula")' in messages[3]
        and "`btr.check` tells" in messages[4]
        and "for load_model" in messages[0]
    )
    assert not [line for line in messages if "--" in line or "`btr " in line], messages


def test_wrong_kinds_are_type_errors(arm: btr.Model) -> None:
    with pytest.raises(KeyError, match="no channel q_nose"):
        btr.load_log(LEARN[0])["q_nose"]


def test_an_exception_of_a_callback_ends_the_work_and_is_raised(arm: btr.Model) -> None:
    def tell(step: str, *errors: float) -> None:
        raise KeyboardInterrupt(step)

    with pytest.raises(KeyboardInterrupt, match="model as it stands"):
        btr.diagnose(arm, LEARN[:1], tell=tell)
    assert btr.fit(arm, LEARN[:1]).ok


def test_a_mapping_of_arrays_is_a_log(arm: btr.Model) -> None:
    log = btr.load_log(LEARN[0], model=arm)
    columns = {"t": log.clock_s, **log.to_dict()}
    assert btr.load_log(columns)["q_yaw"].tobytes() == log["q_yaw"].tobytes()
    assert btr.compare(arm, columns).channels == btr.compare(arm, btr.load_log(columns)).channels
    with pytest.raises(TypeError, match=r"needs a column `t`.*\nhelp: .*\[channels\]"):
        btr.load_log({"q_yaw": log["q_yaw"]})
    with pytest.raises(btr.BtrError, match="no training log\nhelp: "):
        btr.compare(arm, [])


def test_the_file_of_a_model_is_only_replaced_on_request(tmp_path: Path) -> None:
    # A line about a schema that is not there would not be kept.
    own, text = tmp_path / "arm.toml", (ROBOTS / "arm.toml").read_text().split("\n", 1)[1]
    own.write_text(text)
    (tmp_path / "arm.urdf").write_text((ROBOTS / "arm.urdf").read_text())
    arm = btr.load_model(own)
    arm.save(own)
    assert own.read_text() == text
    changed = arm.at({"kp@elbow": 12.5})
    with pytest.raises(btr.BtrError, match=r"arm\.toml: this model was made from it; .* overwrite=True"):
        changed.save(own)
    assert own.read_text() == text
    changed.save(tmp_path / "other.toml")
    arm.at({"kp@elbow": 11.5}).save(tmp_path / "other.toml")
    assert btr.load_model(tmp_path / "other.toml").values["kp@elbow"] == 11.5
    changed.save(own, overwrite=True)
    assert btr.load_model(own).values["kp@elbow"] == 12.5 and "kp = 12.5" in own.read_text()


@pytest.mark.parametrize("name", ["arm.urdf", "scene.xml", "arm.urdf.xacro"])
def test_a_robots_file_is_no_model_and_the_message_says_how_to_make_one(name: str, tmp_path: Path) -> None:
    xacro = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="arm"><xacro:property name="x" value="1"/></robot>'
    texts = {"arm.urdf": (ROBOTS / "arm.urdf").read_text(), "scene.xml": "<mujoco/>", "arm.urdf.xacro": xacro}
    path = tmp_path / name
    path.write_text(texts[name])
    with pytest.raises(btr.BtrError, match=rf"not a model file.*\nhelp: .*new {re.escape(str(path))} -o model\.toml"):
        btr.load_model(path)
