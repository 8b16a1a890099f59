"""The studio's suspects, doubts and notices: what is said of them."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

import numpy as np

import btr
from btr._studio import panels
from btr._studio.candidates import added, candidates, plain
from btr._studio.session import Session
from btr._studio.step import Step
from studio_sessions import FRICTION, ROBOTS, Diagnosed, arm, diagnosed

__all__ = ["arm", "diagnosed"]


def test_suspects_have_the_order_of_the_ladder() -> None:
    common = {"parameters": [], "alike": [], "probability": 0.9, "established": True, "rivals": []}
    effects = [{**common, "effect": effect, "site": "yaw"} for effect in ("backlash", "coulomb_friction")]
    estimate = {"name": "kp@yaw", "unit": "1", "value": 1.0, "ci95": None, "at_bound": False, "by_bounds": False}
    value = {**common, "value": "kp", "site": "yaw", "parameters": [{**estimate, "in_model": 2.0}]}
    steps = ("model as it stands", "+ kp@yaw", "+ asymmetric_friction@yaw", "+ backlash@yaw")
    steps = (*steps, "coulomb_friction@yaw for asymmetric_friction@yaw")
    ladder = [{"step": step, "train": 1.0, "held_out": None} for step in steps]
    document = {"verdict": "effect_missing", "effects": effects, "wrong_values": [value], "ranking": []}
    document["stand_ins"] = []
    found = candidates(btr.DiagnoseResult({**document, "error_ladder": ladder}, None, None, None))
    assert [each.title for each in found] == ["kp@yaw", "backlash@yaw", "coulomb_friction@yaw"]
    assert found[1].beside == ("kp@yaw",)


def test_cards_say_what_is_known_of_a_suspect(diagnosed: Diagnosed) -> None:
    first, *others = diagnosed.session.candidates
    assert first.names == (FRICTION,) and first.established and first.probability > 0.5
    assert "sign(dq)" in first.law and "square wave" in first.shows
    assert first.values[0].startswith("coulomb_friction.torque@yaw = 0.2")
    presliding = next(other for other in others if other.names == ("presliding_friction@yaw",))
    assert others and all(0.0 <= other.probability < 0.5 for other in others) and presliding.probability > 0.01
    share = f"{presliding.probability:.2f}"
    assert f"cannot tell it from presliding_friction@yaw (probability {share})" in panels.card(first)
    assert f"probability {share}, held-out error" in panels.card(presliding)
    assert any("probability &lt;0.01" in panels.card(other) for other in others)
    assert FRICTION not in [name for other in others for name in other.names]


def test_a_value_that_is_wrong_is_a_suspect() -> None:
    estimate = {"name": "mass@upper", "unit": "kg", "value": 0.5, "ci95": None, "at_bound": True, "by_bounds": False}
    rivals = [{"name": None, "probability": 0.07}, {"name": "payload@upper", "probability": 0.03}]
    value = {"value": "mass", "site": "upper", "alike": [], "probability": 0.9, "established": True, "rivals": rivals}
    report = {**value, "parameters": [{**estimate, "in_model": 0.7}]}
    other = {**report, "parameters": [{**estimate, "name": "mass@fore", "in_model": 0.6}]}
    document = {"verdict": "value_wrong", "effects": [], "wrong_values": [report, other], "ranking": []}
    document["stand_ins"] = [{"parameter": "kd@upper", "effects": ["viscous_friction@upper"]}]
    document["error_ladder"] = []
    card, second, stood_in = candidates(btr.DiagnoseResult(document, None, None, None))
    assert stood_in.names == ("viscous_friction@upper",) and not stood_in.established
    assert "explains these logs as well where kd@upper is frozen" in panels.card(stood_in)
    assert "found beside mass@upper: add that first, or all" in panels.card(second)
    assert "found beside" not in panels.card(card)
    assert card.names == ("mass@upper",)
    assert card.law == "mass@upper: 0.5 kg in the logs, 0.7 in the model"
    assert "the rest of the probability: the model without it 0.07, payload@upper 0.03" in panels.card(card)


def test_what_was_added_is_no_suspect(arm: Session) -> None:
    arm.diagnose()
    assert FRICTION in [name for suspect in arm.candidates for name in suspect.names] and arm.added == []
    arm.add([FRICTION])
    assert arm.candidates and FRICTION not in [name for suspect in arm.candidates for name in suspect.names]
    (added,) = arm.added
    assert added.names == (FRICTION,) and "sign(dq)" in added.law


def test_what_was_added_keeps_what_it_cannot_be_told_from(diagnosed: Diagnosed) -> None:
    found, other = diagnosed.session.diagnosis, "presliding_friction@yaw"
    ((likely,),) = [[rival for rival in found.effects[0].rivals if rival.name == other]]
    (card,) = added([FRICTION], [found])
    share = f"{likely.probability:.2f}"
    assert f"cannot tell it from {other} (probability {share})" in panels.card(card)
    (card,) = added([other], [found])
    assert card.names == (other,) and f"cannot tell it from {FRICTION} (probability" in panels.card(card)
    assert all(not card.alike for card in added([FRICTION, other], [found])), "no other one is left"
    assert added([FRICTION], []) == [plain(FRICTION)] and added(["backlash@yaw"], [found])[0].alike == ()


def test_doubts_are_those_of_the_logs_until_a_fit_explains_some(arm: Session, tmp_path: Path) -> None:
    arm.check()
    assert arm.doubts is not None and list(arm.doubts.findings) == [], "these logs are fine"
    log = btr.load_log(ROBOTS / "arm/learn_1.csv")
    late = np.concatenate([np.full(15, log["q_yaw"][0]), log["q_yaw"][:-15]])
    session = Session(arm.model, btr.Log(log.clock_s, {**log.to_dict(), "q_yaw": late}), folder=tmp_path)
    assert session.doubts is None
    session.check()
    checked = session.doubts.findings
    late_by = next(sentence for *_, sentence in checked if "yaw follows its command after" in sentence)
    assert ("doubtful", "log 1", late_by) in checked and all(severity != "fine" for severity, *_ in checked)
    told = panels.doubts(session.doubts)
    assert "doubtful, log 1:" in told and "late for a servo" in told and "before any fit" in told
    fit = session.fit().fit
    fit.doubts = [fit.doubts[0]]
    assert len(session.doubts.findings) == 1 and "Of the fit" in session.doubts.of
    session.set_values({"kp@yaw": 19.0})
    assert session.doubts.findings == checked


def test_what_was_done_is_told_with_the_change_of_the_error(
    diagnosed: Diagnosed, monkeypatch: pytest.MonkeyPatch
) -> None:
    notices = pytest.importorskip("btr._studio.notices", reason="the studio needs viser")
    model, before, after = diagnosed.session.model, (20.4, 21.3), (1.02, 0.999)
    fell = "from 20.4 to 1.02 noise floors (held out: from 21.3 to 1.00)"
    step = Step(f"+ {FRICTION}", model)
    assert notices.changed(step, before, after) == f"Added {FRICTION}: the error went {fell}."
    removed = notices.changed(replace(step, label="- a@b"), after, before)
    assert removed.startswith("Removed a@b: the error went from 1.02")
    assert notices.changed(replace(step, label="fitted"), before, after).startswith("Fitted: ")
    assert notices.previewed(["a@b"], before, after) == f"Preview of a@b: the error would go {fell}. Nothing is added."
    assert notices.diagnosed(diagnosed.session.diagnosis) == f"Diagnosis done: effect missing ({FRICTION})."
    stopped = btr.DiagnoseResult({"verdict": "unexplained", "cut_short": True}, None, None, None)
    monkeypatch.setattr(btr.DiagnoseResult, "names", [])
    assert notices.diagnosed(stopped) == "Diagnosis cut short, so far: unexplained."
    kept = replace(step, frozen=("kp@yaw",))
    assert notices.frozen("kp@yaw", kept, model).startswith("kp@yaw is frozen at 20: ")
    assert "at 20 (in the model as it stands: 19): " in notices.frozen("kp@yaw", kept, model.at({"kp@yaw": 19.0}))


def test_rivals_without_an_experiment_are_told() -> None:
    told = pytest.importorskip("btr._studio.cause", reason="the studio needs viser").told_next
    effect = SimpleNamespace(alike=["backlash@yaw", "tilt@base"])
    alone = SimpleNamespace(next_experiment=None, effects=[effect], wrong_values=[SimpleNamespace(alike=["tilt@base"])])
    sentence = "No motion in the range of these logs separates what was found from backlash@yaw, tilt@base."
    assert sentence in told(alone)
    effect.alike, alone.wrong_values = [], []
    assert told(alone) == ""
