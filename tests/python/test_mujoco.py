"""btr's forward dynamics compared with MuJoCo's, in random states."""

import json
import subprocess
from pathlib import Path

import pytest

mujoco = pytest.importorskip("mujoco")
np = pytest.importorskip("numpy")

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "target" / "release" / "examples"
"""Built by `cargo test --release`."""
STATES = 200
# Relative to the largest acceleration of the state.
AGREE = 1e-11


def model_of(name, folder):
    """The robot in MuJoCo, without contacts, friction or actuators."""
    if name.endswith(".urdf"):
        model = mujoco.MjModel.from_xml_path(str(ROOT / "robots" / name))
    else:
        subprocess.run([EXAMPLES / "export_mjcf", name, "auto", "0.001", "0.01", folder], check=True)
        model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
    model.opt.gravity = [0, 0, -9.81]
    model.dof_damping[:] = 0
    return model


class Pair:
    """One robot in both simulators."""

    def __init__(self, name, folder):
        self.name, self.model = name, model_of(name, folder)
        self.data = mujoco.MjData(self.model)
        self.floats = self.model.njnt > 0 and self.model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
        self.hinges = [j for j in range(self.model.njnt) if self.model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE]
        self.joints = [self.model.joint(j).name for j in self.hinges]

    def state(self, rng):
        """A random state in btr's format, and MuJoCo's accelerations there in btr's order and axes."""
        model, data, many = self.model, self.data, len(self.joints)
        q, dq, torques = rng.uniform(-1.5, 1.5, many), rng.normal(0, 3, many), rng.normal(0, 2, many)
        turn = rng.normal(size=4)
        turn /= np.linalg.norm(turn)
        base, velocity, angular = rng.normal(size=3), rng.normal(size=3), rng.normal(0, 3, 3)
        mujoco.mj_resetData(model, data)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, turn)
        rotation = rotation.reshape(3, 3)
        if self.floats:
            data.qpos[:7] = [*base, *turn]
            data.qvel[:6] = [*velocity, *(rotation.T @ angular)]
        data.qpos[model.jnt_qposadr[self.hinges]] = q
        dofs = model.jnt_dofadr[self.hinges]
        data.qvel[dofs] = dq
        data.qfrc_applied[dofs] = torques
        mujoco.mj_forward(model, data)
        root = [*(rotation @ data.qacc[3:6]), *data.qacc[:3]] if self.floats else []
        state = {"base": base, "turn": turn, "velocity": velocity, "angular": angular}
        state = {key: list(value) for key, value in state.items()}
        return state, dict(zip(self.joints, zip(q, dq, torques))), np.array([*root, *data.qacc[dofs]])

    def line(self, state, joints, names):
        columns = zip(*(joints[name] for name in names))
        return json.dumps(state | {key: list(map(float, c)) for key, c in zip(("q", "dq", "torques"), columns)})

    def btr(self, states, names):
        robot = str(ROOT / "robots" / self.name) if self.name.endswith(".urdf") else self.name
        lines = "\n".join(self.line(state, joints, names) for state, joints, _ in states)
        run = subprocess.run(
            [EXAMPLES / "accelerations", robot], input=lines, capture_output=True, text=True, check=True
        )
        first, *rest = map(json.loads, run.stdout.splitlines())
        return first, [np.array(line) for line in rest]


@pytest.mark.parametrize("name", ["ant", "nao", "arm5.urdf"])
def test_accelerations_are_those_of_mujoco(name, tmp_path):
    pair, rng = Pair(name, tmp_path), np.random.default_rng(7)
    states = [pair.state(rng) for _ in range(STATES)]
    names, _ = pair.btr([], pair.joints)
    assert sorted(names) == sorted(pair.joints)
    _, answers = pair.btr(states, names)
    root = 6 if pair.floats else 0
    order = [*range(root), *(root + names.index(joint) for joint in pair.joints)]
    for (_, _, expected), answer in zip(states, answers, strict=True):
        assert np.max(np.abs(answer[order] - expected)) <= AGREE * np.max(np.abs(expected))
