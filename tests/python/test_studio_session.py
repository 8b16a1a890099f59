"""The studio without its page: what was done to a model, and what can be undone."""

import math
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

import numpy as np

import btr
from btr._studio import panels
from btr._studio.replay import Errors
from btr._studio.session import PART_TAKES_S, Session
from btr._studio.work import Cancelled, Latest
from studio_sessions import FRICTION, ROBOTS, Diagnosed, arm, diagnosed

__all__ = ["arm", "diagnosed"]


def test_errors_are_those_of_compare(arm: Session) -> None:
    channels = btr.compare(arm.model, [ROBOTS / "arm/learn_1.csv"]).channels
    chi = math.sqrt(sum(channel.chi**2 for channel in channels) / len(channels))
    assert arm.errors()[0] == pytest.approx(chi, rel=1e-3)
    assert chi > 10.0


def test_the_error_waits_for_the_noise_floors() -> None:
    session = Session(ROBOTS / "arm.toml", [ROBOTS / "arm/learn_1.csv"])
    assert session.errors() == (None, None)
    session.compare()
    assert None not in session.errors()


def test_the_end_of_each_log_is_held_out_where_no_log_is() -> None:
    logs = [ROBOTS / "arm/learn_1.csv", ROBOTS / "arm/learn_2.csv"]
    session = Session(ROBOTS / "arm.toml", logs)
    session.compare()
    found = btr.fit(session.model, logs)
    assert session.holds_out_tails
    as_it_stands, (learn, held_out) = found.error_ladder[0], session.errors()
    # A fit estimates where the end begins; the studio shows each log as a whole.
    assert learn == pytest.approx(as_it_stands.train, rel=0.02)
    assert held_out == pytest.approx(as_it_stands.held_out, rel=0.1)
    told = panels.head("arm", "model as it stands", *session.errors(), tails=True)
    assert "first 70 %" in told and "the last 30 % of each log are held out." in told
    assert "70 %" not in panels.head("arm", "model as it stands", 1.0, 1.0)


def test_the_ladder_grows_while_the_cause_is_searched_for(diagnosed: Diagnosed) -> None:
    assert [length for length, _ in diagnosed.heard] == list(range(1, len(diagnosed.session.ladder) + 1))
    assert all(batches for _, batches in diagnosed.heard), "simulations are counted"
    assert diagnosed.session.batches is None, "nothing runs any more"


def test_a_ladder_has_the_steps_that_were_not_told(arm: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    steps = [("model as it stands", 9.0), ("+ a@yaw", 1.1), ("b@yaw for a@yaw", 1.0)]
    ladder = [SimpleNamespace(step=name, train=error, held_out=None) for name, error in steps]

    def found(*_: object, tell: btr.verbs.Tell, **__: object) -> SimpleNamespace:
        for name, error in steps[:2]:
            tell(name, error, None)
        return SimpleNamespace(verdict="nothing_missing", error_ladder=ladder)

    monkeypatch.setattr("btr._studio.session.diagnose", found)
    arm.diagnose()
    assert arm.ladder == [(name, error, None) for name, error in steps]


def test_a_fit_tells_what_ended_at_a_bound(arm: Session) -> None:
    assert panels.at_bounds(arm.at_bounds) == ""
    arm.fit()
    told = panels.at_bounds(arm.at_bounds)
    assert "kd@yaw ended at its upper bound, 0.59 N·m·s/rad; the best value may lie beyond it" in told
    arm.set_values({"kp@yaw": 19.0})
    assert panels.at_bounds(arm.at_bounds) == "", "this is no longer the model of the fit"
    known = {"name": "backlash.gap@yaw", "unit": "rad", "min": 0.0, "max": 0.1, "scale": "linear", "nominal": 0.0}
    told = panels.at_bounds([(btr.documents.Dimension(known), 0.0)])
    assert "backlash.gap@yaw ended at its lower bound, 0 rad<" in told


def test_what_is_added_can_be_removed_and_undone(arm: Session) -> None:
    before = arm.errors()[1]
    added = arm.add([FRICTION])
    assert added.added == (FRICTION,) and added.fit is not None
    assert arm.errors()[1] < 1.2
    arm.remove([FRICTION])
    assert arm.step.added == () and arm.errors()[1] > 5.0
    assert arm.undo() is added
    arm.undo()
    assert arm.errors()[1] == before
    assert arm.undo() is arm.history[0], "the first step stays"


def test_the_errors_are_of_the_replays_whatever_was_asked(arm: Session) -> None:
    def of_replays() -> Errors:
        return arm.errors_of(arm.replays_of(arm.shown.model))

    before, during = arm.errors(), []
    with pytest.raises(Cancelled):
        arm.diagnose(arm.cancel)
    assert arm.errors() == before == of_replays()
    arm.diagnose(lambda: during.append(arm.errors()))
    assert set(during) == {before} == {arm.errors()}
    for change in (arm.add, arm.preview):
        assert change([FRICTION]).fit is not None
        assert arm.errors() == of_replays() == pytest.approx(arm.ladder[-1][1:], rel=0.02)
        arm.undo()
    assert arm.errors() == before
    arm.add([FRICTION])
    arm.set_values({"kp@yaw": 17.0})
    assert arm.errors() == of_replays() and arm.errors()[0] > arm.step.fit.train


def test_the_page_says_what_each_error_is_of(diagnosed: Diagnosed) -> None:
    assert "error of replays from the first readings" in panels.head("arm", "", *diagnosed.session.errors())
    assert "those at the top are always of replays" in panels.ladder(diagnosed.session.ladder, "")
    assert "those at the top" not in panels.ladder([], "fitting")


def test_a_preview_changes_nothing_and_is_no_work_twice(arm: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    before, replay = arm.errors(), arm.replay(0)
    previewed = arm.preview([FRICTION])
    assert arm.shown is previewed and previewed.label == f"preview: + {FRICTION}"
    assert arm.errors()[1] < 1.2 and arm.replay(0) is not replay
    assert arm.compare() is previewed.comparison
    assert len(arm.history) == 1 and arm.step.added == () and FRICTION not in arm.model.text
    arm.show_step()
    assert arm.errors() == before and arm.replay(0) is replay
    monkeypatch.setattr("btr._studio.session.fit", None)
    arm.preview([FRICTION])
    added = arm.add([FRICTION])
    assert arm.previewed is None and arm.shown is added and arm.model.values == previewed.model.values


def test_a_change_ends_a_preview(arm: Session) -> None:
    for change in (lambda: arm.set_values({"kp@yaw": 19.0}), arm.undo):
        arm.preview([FRICTION])
        change()
        assert arm.shown is arm.step
    with pytest.raises(Cancelled):
        arm.preview(["backlash@yaw"], arm.cancel)
    assert arm.previewed is None


def test_a_diagnosis_belongs_to_its_model(arm: Session) -> None:
    first = arm.diagnose()
    missing, ladder = arm.diagnosis, arm.ladder
    assert arm.is_diagnosed and missing.verdict == "effect_missing" and len(ladder) > 1
    arm.add([FRICTION])
    assert arm.diagnosis is missing and not arm.is_diagnosed and arm.ladder is not ladder
    assert arm.diagnose() == [] and arm.is_diagnosed
    nothing = arm.diagnosis
    assert nothing.verdict == "nothing_missing" and nothing.ranking, "what was tried is no suspect"
    arm.remove([FRICTION])
    assert arm.diagnosis is missing and not arm.is_diagnosed, "that of the model to which the same was added"
    assert arm.candidates == first
    assert arm.undo().diagnosis is nothing and arm.diagnosis is nothing and arm.is_diagnosed
    arm.undo()
    assert arm.diagnosis is missing and arm.is_diagnosed and arm.ladder is ladder and arm.candidates == first


def test_a_diagnosis_keeps_the_values_set_by_hand(arm: Session) -> None:
    arm.set_values({"kp@yaw": 19.0})
    arm.diagnose(lambda: arm.set_values({"kp@yaw": 18.5}))
    assert arm.model.values["kp@yaw"] == 18.5 and arm.diagnosis is not None and not arm.is_diagnosed
    arm.undo()
    assert arm.model.values["kp@yaw"] == 19.0 and arm.is_diagnosed
    arm.set_values({"kp@yaw": 18.0})
    assert not arm.is_diagnosed
    assert arm.undo().diagnosis is arm.diagnosis and arm.is_diagnosed


def test_the_page_tells_no_call_of_the_library(diagnosed: Diagnosed) -> None:
    found = diagnosed.session.diagnosis
    assert "btr.fit" in found._headline() and "btr." not in found._finding()
    assert found._finding().startswith(f"missing: {FRICTION}")


def test_the_motion_of_the_next_experiment_is_shown() -> None:
    pendulum = btr.load_model(ROBOTS / "disengage.toml")
    delayed = '\n[[effects]]\neffect = "command_delay"\nsite = "hinge"\ndelay = 0.004\n'
    clock_s = np.arange(0, 3, 0.01)
    commands = btr.Log(clock_s, {"cmd_hinge": 0.3 * np.sin(5 * clock_s), "q_hinge": np.zeros(len(clock_s))})
    response = btr.Model(pendulum.text + delayed, pendulum.path).simulate(commands, seed=3)
    session = Session(pendulum, btr.Log(clock_s, {name: response[name] for name in ("cmd_hinge", "q_hinge")}))
    with pytest.raises(btr.BtrError, match="there is no next experiment"):
        session.show_motion()
    session.diagnose()
    motion = session.show_motion()
    assert session.motion is motion and motion.failed is None
    assert motion.run.log.keys() == ["cmd_hinge"] and np.ptp(motion.simulated["q_hinge"]) > 0.1
    told = panels.next_experiment(session.diagnosis.next_experiment)
    assert all(rival.effect in told for rival in session.diagnosis.next_experiment.rivals)
    assert "noise floors apart" in told
    session.show_step()
    assert session.motion is None


def test_what_was_not_added_cannot_be_removed(arm: Session) -> None:
    with pytest.raises(btr.BtrError, match="was not added"):
        arm.remove(["backlash@yaw"])
    assert len(arm.history) == 1


def test_what_was_undone_can_be_done_again_until_something_else_is(arm: Session) -> None:
    arm.set_values({"kp@yaw": 19.0})
    arm.set_values({"kd@yaw": 0.45})
    both, before = arm.step, arm.errors()
    arm.undo()
    arm.undo()
    assert arm.can_redo and arm.redo().by_hand == {"kp@yaw": 19.0}
    assert arm.redo() is both and arm.errors() == before
    assert not arm.can_redo and arm.redo() is both, "nothing is left"
    arm.undo()
    arm.set_values({"kp@yaw": 18.0})
    assert not arm.can_redo, "the step would be one of another model"


def test_a_frozen_parameter_keeps_its_value_in_fits_and_diagnoses(arm: Session) -> None:
    arm.add([FRICTION])
    arm.set_values({"kp@yaw": 18.2})
    by_hand = arm.errors()
    arm.freeze("kp@yaw")
    assert arm.errors() == by_hand and arm.step.title == f"+ {FRICTION} (kp@yaw frozen) set by hand"
    assert arm.fit().frozen == ("kp@yaw",) and arm.model.values["kp@yaw"] == 18.2
    arm.set_values({"kp@yaw": 18.4})
    arm.fit()
    assert arm.model.values["kp@yaw"] == 18.4, "it is frozen where its slider is"
    arm.free("kp@yaw")
    assert arm.fit().frozen == () and arm.model.values["kp@yaw"] not in (18.2, 18.4)
    with pytest.raises(btr.BtrError, match="cannot be frozen"):
        arm.freeze("coulomb_friction.torque@yaw")


def test_a_diagnosis_is_of_what_was_frozen(arm: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def found(*_: object, freeze: list[str], **__: object) -> SimpleNamespace:
        asked.append(freeze)
        return SimpleNamespace(verdict="nothing_missing", error_ladder=[])

    monkeypatch.setattr("btr._studio.session.diagnose", found)
    arm.diagnose()
    assert arm.is_diagnosed
    arm.freeze("kp@yaw")
    assert not arm.is_diagnosed and arm.diagnosis is not None, "it is one of the model with that parameter free"
    arm.diagnose()
    assert arm.is_diagnosed and asked == [[], ["kp@yaw"]]
    arm.undo()
    assert arm.is_diagnosed, "the first diagnosis counts again"


def test_all_can_be_removed_where_all_is_frozen(arm: Session) -> None:
    arm.set_values({"kp@yaw": 18.2})
    arm.freeze("kp@yaw")
    arm.add([FRICTION])
    for name in arm.history[0].model.values:
        arm.freeze(name)
    arm.remove([FRICTION])
    assert arm.step.added == () and arm.step.fit is None and set(arm.step.frozen) == set(arm.model.values)
    assert arm.model.values["kp@yaw"] == 18.2
    arm.free("kp@yaw")
    journey = arm.journey
    assert journey.first.at(journey.by_hand).values == arm.model.values, "scripts come to the same"


def test_freezing_and_freeing_is_no_step_where_nothing_changes(arm: Session) -> None:
    for name in ("kp@yaw", "kd@yaw"):
        arm.freeze(name)
    both, steps = arm.step.frozen, len(arm.history)
    assert arm.freeze("kd@yaw") is arm.step and arm.free("mass@upper") is arm.step and len(arm.history) == steps
    arm.free("kp@yaw")
    assert arm.freeze("kp@yaw").frozen == both, "in the order of the model"


def test_a_ladder_of_a_fit_is_not_of_values_that_were_set_since(arm: Session) -> None:
    arm.fit()
    assert arm.freeze("kp@yaw").ladder and arm.step.title == "fitted (kp@yaw frozen)"
    arm.set_values({"kd@yaw": 0.45})
    assert not arm.freeze("kd@yaw").ladder


def test_a_parameter_without_a_value_of_its_own_cannot_be_frozen(tmp_path: Path) -> None:
    lines = (ROBOTS / "arm.toml").read_text().splitlines()
    own = "\n".join(line for line in lines if not line.startswith('"kp@'))
    assert own.count('"arm.urdf"') == own.count("[parameters]") == 1
    shared = own.replace("[parameters]", '[parameters]\n"kp@*" = { bounds = [10.0, 30.0], shared = true }')
    model = tmp_path / "arm.toml"
    model.write_text(shared.replace('"arm.urdf"', f'"{ROBOTS}/arm.urdf"'))
    session = Session(model, [ROBOTS / "arm/learn_1.csv"])
    assert "kp@*" in session.model.values and "kp@*" not in session.freezable
    with pytest.raises(btr.BtrError, match="cannot be frozen"):
        session.freeze("kp@*")


def test_a_series_of_values_of_one_parameter_is_one_step(arm: Session) -> None:
    for kp in (19.0, 18.0, 17.5):
        arm.set_values({"kp@yaw": kp})
    for kd in (0.47, 0.45):
        arm.set_values({"kd@yaw": kd})
    arm.set_values({"kp@yaw": 18.5})
    assert [step.by_hand for step in arm.history[1:]] == [
        {"kp@yaw": 17.5},
        {"kp@yaw": 17.5, "kd@yaw": 0.45},
        {"kd@yaw": 0.45, "kp@yaw": 18.5},
    ]
    arm.undo()
    assert arm.model.values["kp@yaw"] == 17.5 and arm.model.values["kd@yaw"] == 0.45
    arm.undo()
    arm.undo()
    assert arm.model.values["kp@yaw"] == 20.0


def test_steps_far_back_hold_no_simulations(arm: Session) -> None:
    arm.compare()
    arm.errors()
    for value in (0.43, 0.44, 0.45, 0.46):
        for name in ("kp@yaw", "kd@yaw"):
            arm.set_values({name: 40 * value if name == "kp@yaw" else value})
            arm.errors()
    assert len(arm.history) == 9
    assert [bool(step.replays) for step in arm.history] == [True, *[False] * 6, True, True]
    arm.undo()
    arm.undo()
    assert arm.errors()[0] > 0.0


def test_a_long_replay_is_shown_in_parts(arm: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    end_s = float(arm.runs[0].clock_s[-1])
    arm.replay(0)
    arm.set_values({"kp@yaw": 19.0})
    # As if the whole had taken eight times as long as a part may.
    monkeypatch.setattr(arm, "_took_s", {0: 8 * PART_TAKES_S})
    part = arm.part(0, 0.0)
    assert arm.part(0, 0.8 * end_s) is None, "nearly the whole"
    assert np.isfinite(arm.part(0, 0.3 * end_s).simulated["q_yaw"][arm.runs[0].clock_s <= 0.3 * end_s]).all()
    whole = arm.replay(0)
    known = np.isfinite(part.simulated["q_yaw"])
    assert arm.runs[0].clock_s[known][-1] == pytest.approx(1.0, abs=0.02), "a second from the shown time on"
    for channel, values in part.simulated.items():
        assert len(values) == len(whole.simulated[channel])
        assert values[known] == pytest.approx(whole.simulated[channel][known], abs=1e-12), channel
    monkeypatch.setattr(arm, "_took_s", {0: 8 * PART_TAKES_S})
    assert arm.part(0, 0.0) is None, "the whole is known"
    arm.set_values({"kp@yaw": 19.5})
    monkeypatch.setattr(arm, "_took_s", {0: PART_TAKES_S})
    assert arm.part(0, 0.0) is None, "the whole takes no longer"


def test_a_value_outside_its_bounds_changes_nothing(arm: Session) -> None:
    with pytest.raises(btr.BtrError):
        arm.set_values({"kp@yaw": 1000.0})
    assert len(arm.history) == 1


def test_the_way_to_a_fit_begins_without_the_effect(arm: Session) -> None:
    first = arm.step
    arm.add([FRICTION])
    way = [model.values for model in arm.between(first, 4)]
    torque = arm.model.values["coulomb_friction.torque@yaw"]
    torques = [values["coulomb_friction.torque@yaw"] for values in way]
    assert torques == pytest.approx([torque * k / 4 for k in (1, 2, 3, 4)])
    assert way[-1] == arm.model.values


def test_cancelled_work_leaves_everything_as_it_was(arm: Session) -> None:
    with pytest.raises(Cancelled):
        arm.diagnose(arm.cancel)
    assert arm.diagnosis is None and len(arm.history) == 1 and arm.batches is None
    assert [step for step, _, _ in arm.stopped] == ["model as it stands"] and arm.ladder == []
    told = panels.stopped(arm.stopped)
    assert "model as it stands" in told and "stopped: best so far; the model is as it was" in told
    assert "stopped: nothing so far" in panels.stopped([])
    with pytest.raises(Cancelled):
        arm.add([FRICTION], arm.cancel)
    assert len(arm.history) == 1
    arm.add([FRICTION])


def test_one_thing_runs_at_a_time(arm: Session) -> None:
    refused = []

    def second() -> None:
        try:
            arm.fit()
        except btr.BtrError as error:
            refused.append(str(error))
        arm.cancel()

    with pytest.raises(Cancelled):
        arm.diagnose(second)
    assert "something else is running" in refused[0]


def test_a_simulation_that_diverges_has_no_channels(arm: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    def diverges(self: btr.Model, log: btr.Log) -> btr.Log:
        raise btr.BtrError("the simulation diverged")

    monkeypatch.setattr(btr.Model, "simulate", diverges)
    assert arm.replay(0).failed == "the simulation diverged"
    assert arm.replay(0).residual("q_yaw") is None
    assert arm.errors()[0] == math.inf


def test_a_damaged_log_is_left_out_and_told(tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.csv"
    damaged.write_text("t,q_yaw\n0,zero\n")
    with pytest.warns(UserWarning, match="left out"):
        session = Session(ROBOTS / "arm.toml", [damaged, ROBOTS / "arm/learn_1.csv"])
    assert len(session.runs) == 1
    with pytest.raises(btr.BtrError, match=r"no log is left to learn from: .*damaged\.csv"):
        Session(ROBOTS / "arm.toml", [damaged])
    with pytest.raises(btr.BtrError):
        Session(ROBOTS / "arm.toml", [tmp_path / "missing.csv"])


def test_a_log_that_cannot_be_replayed_is_no_part_of_the_errors(tmp_path: Path) -> None:
    whole = ROBOTS / "arm/learn_1.csv"
    log, lacking = btr.load_log(whole), tmp_path / "lacking.csv"
    btr.Log(log.clock_s, {name: log[name] for name in log.keys() if name != "cmd_yaw"}).write(lacking)
    with pytest.warns(UserWarning, match="left out: .*lacking.csv.*cmd_yaw"):
        session = Session(ROBOTS / "arm.toml", [whole, lacking])
    session.compare()
    assert math.isfinite(session.errors()[0]) and [run.name for run in session.runs] == [str(whole)]
    assert [reason for reason in session.left_out if "lacking.csv" in reason and "cmd_yaw" in reason]
    with pytest.raises(btr.BtrError, match="no log is left .*cmd_yaw"):
        Session(ROBOTS / "arm.toml", [lacking])


def test_the_title_of_a_model_names_all_that_was_added(arm: Session) -> None:
    assert arm.step.title == arm.step.label
    arm.add([FRICTION])
    arm.add(["viscous_friction@elbow"])
    assert arm.step.title == f"+ {FRICTION} + viscous_friction@elbow"
    arm.set_values({"kp@yaw": 18.0})
    assert arm.step.title == f"+ {FRICTION} + viscous_friction@elbow set by hand"


def test_only_the_latest_redraw_counts() -> None:
    drawn, begun, go_on = [], threading.Event(), threading.Event()

    def draw(is_stale) -> None:
        begun.set()
        go_on.wait(5.0)
        drawn.append(is_stale())

    latest = Latest(draw)
    latest.ask()
    assert begun.wait(5.0)
    for _ in range(10):
        latest.ask()
    go_on.set()
    latest.end()
    assert drawn[0] is True and len(drawn) <= 2
