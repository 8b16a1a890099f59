"""Draws from what a fit leaves uncertain."""

from pathlib import Path

import btr
import pytest

np = pytest.importorskip("numpy")

ARM = Path(__file__).parents[2] / "robots" / "arm.toml"
LEARN = sorted((ARM.parent / "arm").glob("learn_*.csv"))


@pytest.fixture(scope="module")
def fitted():
    return btr.fit(ARM, LEARN[:1], freeze=["mass@*", "kd@*"], add=["coulomb_friction@elbow"])


def test_draws_are_as_wide_as_the_posterior_and_within_the_bounds(fitted):
    drawn = fitted.draws(500)
    assert list(drawn) == [parameter.name for parameter in fitted.parameters]
    for marginal in fitted.posterior.parameters:
        values = drawn[marginal.name]
        assert values.shape == (500,)
        of = {"linear": values, "log": np.log(values), "inverse": 1 / np.maximum(values, 1e-300)}[marginal.coordinate]
        assert of.min() >= marginal.min - 1e-9 and of.max() <= marginal.max + 1e-9
        assert 0 < of.std() < 1.2 * marginal.sd
    assert not np.array_equal(drawn["kp@elbow"], fitted.draws(500, seed=1)["kp@elbow"])
    assert np.array_equal(drawn["kp@elbow"], fitted.draws(500)["kp@elbow"])


def test_the_models_at_draws_can_be_simulated_and_exported(fitted):
    drawn = fitted.draws(4)
    logs = fitted.model.simulate_all(drawn, log=LEARN[0])
    assert len({log["q_elbow"][100] for log in logs}) == 4
    model = fitted.model.at({name: values[3] for name, values in drawn.items()})
    assert model.values["kp@elbow"] == drawn["kp@elbow"][3]
    assert "EVENTS" in fitted.model.export("isaac-lab", randomize=fitted.posterior).text
    with pytest.raises(btr.BtrError, match="has no ranges"):
        fitted.model.export("urdf", randomize=fitted.posterior)


def test_a_residual_with_structure_is_told(fitted):
    assert fitted.withheld and fitted.posterior.has_structure
    with pytest.raises(btr.BtrError, match="whole number"):
        fitted.draws(-1)
