"""Results are typed: every key of a verb's document is a declared attribute, with a value of the declared type."""

import copy
import pickle
from pathlib import Path
from typing import Any

import pytest

import btr
from btr import documents
from btr.documents._record import declared
from typed import mismatches, must_be_typed

ROBOTS = Path(__file__).parents[2] / "robots"
ARM = ROBOTS / "arm.toml"
LEARN = sorted((ROBOTS / "arm").glob("learn_*.csv"))[:1]
HELD_OUT = sorted((ROBOTS / "arm").glob("held_out_*.csv"))[:1]

@pytest.fixture(scope="module")
def arm() -> btr.Model:
    return btr.load_model(ARM)


def test_results_of_logs_are_typed(arm: btr.Model) -> None:
    must_be_typed(btr.check(arm, LEARN))
    must_be_typed(btr.compare(arm, LEARN))
    must_be_typed(btr.effects())
    fitted = btr.fit(arm, LEARN, held_out=HELD_OUT)
    must_be_typed(fitted)
    for dimension in [*fitted.space, *arm.parameters]:
        assert not list(mismatches(dimension, documents.Dimension, dimension.name))


def test_a_diagnosis_is_typed(arm: btr.Model) -> None:
    found = btr.diagnose(arm, LEARN, held_out=HELD_OUT)
    must_be_typed(found)
    assert (
        found.effects[0].site == found["effects"][0]["site"] == "yaw" and found.effects[0].parameters[0].unit == "N·m"
    )
    assert found.residual_law is None and found.left_over is None and "left_over" not in found.document
    assert found.noise_stated_low == [] and "residual_law" not in found.document


POSTERIOR = {"coevolve.distance": "whitened", "coevolve.posterior.resolution": 0.02}
MAP = {"coevolve.real_tests": 3, "coevolve.map.generations": 3}
OTHER_DISTANCE = '\n[[distances]]\nname = "dtw"\nchannels = ["q_*"]\n'


@pytest.mark.parametrize(
    ("experiment", "settings", "appended", "keys"),
    [
        ("pendulum.toml", POSTERIOR, "", ["iterations"]),
        ("pendulum.toml", {}, OTHER_DISTANCE, ["by_distance"]),
        ("ant-damaged.toml", MAP, "", ["map", "reality_gap"]),
    ],
)
def test_a_run_is_typed(
    experiment: str, settings: dict[str, Any], appended: str, keys: list[str], tmp_path: Path
) -> None:
    heard: list[btr.Iteration] = []
    model = btr.load_model(ROBOTS / experiment, settings)
    found = btr.coevolve(btr.Model(model.text + appended, model.path), out=tmp_path, tell=heard.append)
    must_be_typed(found)
    assert all(found[key] for key in keys) and heard == found.iterations
    assert {type(iteration) for iteration in [*heard, *found.iterations]} == {btr.Iteration}


def test_unknown_keys_of_later_versions_are_ignored(arm: btr.Model) -> None:
    found = btr.check(arm, LEARN)
    document = {**found.document, "new": [1], "logs": [{**log, "new": {"a": 1}} for log in found.document["logs"]]}
    later = btr.CheckResult(document)
    assert later.new == later["new"] == [1] and later.logs[0].new == {"a": 1} and later.document == document
    assert repr(later) == repr(found) and later != found and "new" in dir(later) and "new" in dir(later.logs[0])


def test_values_of_other_shapes_are_left_as_they_are() -> None:
    later = btr.CheckResult({"ok": True, "logs": "none", "parameters": [3], "rank": "two"})
    assert (later.logs, later.parameters, later.rank) == ("none", [3], "two")
    with pytest.raises(AttributeError, match="CheckResult has no rollouts"):
        later.rollouts
    with pytest.raises(KeyError, match="rollouts"):
        later["rollouts"]


def test_attributes_and_items_are_the_same() -> None:
    estimate = documents.Estimate(name="kp", ci95=[1.0, 2.0])
    estimate.value = 1.5
    estimate["unit"] = "N·m/rad"
    assert estimate == {"name": "kp", "ci95": [1.0, 2.0], "value": 1.5, "unit": "N·m/rad"}
    assert (estimate["value"], estimate.unit) == (1.5, "N·m/rad")
    assert pickle.loads(pickle.dumps(estimate)).ci95 == copy.deepcopy(estimate).ci95 == [1.0, 2.0]


def test_no_key_hides_behind_a_method() -> None:
    kinds = [kind for name in documents.__all__ if isinstance(kind := getattr(documents, name), type)]
    assert len(kinds) > 30
    for kind in kinds:
        assert not declared(kind).keys() & set(dir(dict)), kind
    results = (
        btr.CheckResult,
        btr.CompareResult,
        btr.DiagnoseResult,
        btr.EffectsResult,
        btr.FitResult,
        btr.CoevolveResult,
    )
    for result in results:
        assert not [key for key in declared(result) if hasattr(result, key)], result
