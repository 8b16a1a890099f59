"""What the studio saves: the model, its report, and scripts that come to the same."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import btr
from btr._studio.saved import Saved
from btr._studio.session import Session
from studio_sessions import FRICTION, ROBOTS, arm

__all__ = ["arm"]


def test_what_is_saved_in_a_preview_is_the_present_model(arm: Session, tmp_path: Path) -> None:
    arm.preview([FRICTION])
    saved = arm.save()
    assert btr.load_model(saved.model).values == arm.history[0].model.values
    assert "coulomb_friction" not in saved.report.read_text()
    assert arm.previewed is None, "what is shown is what was saved"


def test_what_is_saved_comes_to_the_same(arm: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arm.add([FRICTION])
    saved, again = arm.save(), arm.save()
    assert saved.model.name == "arm-studio.toml" and again.model.name == "arm-studio-2.toml"
    assert btr.load_model(saved.model).values == arm.model.values
    assert "<html" in saved.report.read_text()
    assert_scripts_come_to(saved, tmp_path)


def test_values_set_by_hand_are_in_the_scripts(arm: Session, tmp_path: Path) -> None:
    arm.set_values({"kp@yaw": 18.0, "mass@upper": 0.6123456789})
    saved = arm.save()
    assert btr.load_model(saved.model).values["kp@yaw"] == 18.0 and "btr fit" not in saved.shell.read_text()
    assert_scripts_come_to(saved, tmp_path)
    arm.add([FRICTION])
    arm.set_values({"kp@yaw": 18.5, "coulomb_friction.torque@yaw": 0.31})
    assert_scripts_come_to(arm.save(), tmp_path)


def test_frozen_parameters_are_in_the_scripts(arm: Session, tmp_path: Path) -> None:
    arm.freeze("kd@yaw")
    arm.set_values({"kp@yaw": 18.2})
    arm.freeze("kp@yaw")
    arm.add([FRICTION])
    saved = arm.save()
    values = btr.load_model(saved.model).values
    assert values["kp@yaw"] == 18.2 and values["kd@yaw"] == arm.history[0].model.values["kd@yaw"]
    assert "frozen: kp@yaw = 18.2, kd@yaw = " in saved.model.read_text().replace("\n# ", " ")
    assert_scripts_come_to(saved, tmp_path)
    arm.set_values({"kp@yaw": 18.3})
    arm.freeze("mass@upper")
    assert_scripts_come_to(arm.save(), tmp_path)


def test_scripts_run_in_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROBOTS)
    session = Session("arm.toml", ["arm/learn_1.csv"], held_out=["arm/held_out_1.csv"], folder=tmp_path)
    session.set_values({"kp@yaw": 18.0})
    saved = session.save()
    assert os.access(saved.shell, os.X_OK)
    assert_scripts_come_to(saved, tmp_path)


def test_a_model_that_was_not_changed_is_not_fitted_by_the_scripts(arm: Session, tmp_path: Path) -> None:
    assert_scripts_come_to(arm.save(), tmp_path)


def test_the_saved_model_says_that_older_comments_may_no_longer_hold(arm: Session, tmp_path: Path) -> None:
    assert "Saved by" not in arm.save().model.read_text(), "nothing was done"
    arm.add([FRICTION])
    arm.set_values({"kp@yaw": 18.5, "mass@upper": 0.6123456789})
    saved = arm.save()
    begin = saved.model.read_text().partition("# Nominal model")[0].splitlines()
    assert begin[0].startswith("#:schema") and begin[1].startswith("# Written by btr")
    done = "coulomb_friction@yaw added; fitted; set by hand: kp@yaw = 18.5, mass@upper = 0.6123."
    comment = " ".join(line.removeprefix("# ") for line in begin[2:])
    older = "The comments below are older: what they say may no longer hold."
    assert comment == f"Saved by btr studio from arm.toml: {done} {older}"
    again = Session(saved.model, [ROBOTS / "arm/learn_1.csv"], folder=tmp_path)
    again.set_values({"kp@yaw": 19.0})
    text = again.save().model.read_text()
    assert text.count("Saved by btr studio") == text.count("no longer hold") == 1 and "from arm-studio-2.toml" in text
    assert text.partition("# Nominal model")[2] == again.model.text.partition("# Nominal model")[2]


def assert_scripts_come_to(saved: Saved, folder: Path) -> None:
    """Runs both scripts without their diagnosis, and compares the models that they write with the saved one."""
    wanted = btr.load_model(saved.model)
    (folder / "bin").mkdir(exist_ok=True)
    program = folder / "bin/btr"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m btr "$@"\n')
    program.chmod(0o755)
    paths = {"PATH": f"{program.parent}:{os.environ['PATH']}", "BTR_PYTHON": sys.executable}
    for interpreter, script in (("sh", saved.shell), (sys.executable, saved.python)):
        place = folder / saved.model.stem / script.suffix
        place.mkdir(parents=True)
        lines = [line for line in script.read_text().splitlines() if "diagnose" not in line]
        (place / "script").write_text("\n".join(lines))
        environment = {**os.environ, **paths}
        subprocess.run([interpreter, "script"], cwd=place, env=environment, check=True, timeout=300)
        assert btr.load_model(place / "result.toml").values == wanted.values, script
        assert (place / "result.html").read_text().count("<html") == 1


def test_logs_in_memory_have_no_scripts(tmp_path: Path) -> None:
    model = btr.load_model(ROBOTS / "arm.toml")
    columns = btr.load_log(ROBOTS / "arm/learn_1.csv").to_dict() | {"t": [0.01 * k for k in range(401)]}
    session = Session(model, columns, folder=tmp_path)
    assert session.runs[0].name == "log 1"
    saved = session.save()
    assert saved.shell is None and saved.python is None and saved.model.exists()
    assert json.dumps(sorted(path.suffix for path in tmp_path.iterdir())) == '[".html", ".toml"]'
    changed = Session(model.at({"kp@yaw": 19.0}), ROBOTS / "arm/learn_1.csv", folder=tmp_path).save()
    assert changed.shell is None and changed.python is None, "the file has another value"
