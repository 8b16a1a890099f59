"""Joints in MuJoCo whose transmission gives or has play: as btr's own simulation."""

import btr
import pytest

np = pytest.importorskip("numpy")
mujoco = pytest.importorskip("mujoco")

ELASTIC = {"effect": "joint_elasticity", "stiffness": 60.0, "damping": 0.02}
LOOSE = {"effect": "backlash", "gap": 0.05}
CONTROL_S, ROWS = 0.01, 300
JOINTS = ["shoulder", "elbow"]


def arm(joints=2, armature=0.02, integrator="RK4", step=0.0005, actuator="", joint=""):
    """An arm of one or two links, which hangs down."""
    names = JOINTS[:joints]
    of_joint = f'axis="0 1 0" armature="{armature}" {joint}'
    lower = f"""<body name="lower" pos="0 0 -0.3"><joint name="elbow" {of_joint}/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.25" mass="0.6"/></body>"""
    servos = "".join(f'<position joint="{name}" kp="30" kv="0.5" {actuator}/>' for name in names)
    return f"""<mujoco><option timestep="{step}" integrator="{integrator}"/><worldbody>
      <body name="upper"><joint name="shoulder" {of_joint}/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.3" mass="1.2"/>{lower if joints == 2 else ""}</body>
      </worldbody><actuator>{servos}</actuator></mujoco>"""


def commands(joints):
    t = np.arange(ROWS) * CONTROL_S
    waves = [0.4 * np.sin(3 * t + k) + 0.3 * np.sin(7.1 * t) + 0.2 * (np.floor(t) % 2) for k in range(joints)]
    together = np.stack(waves, axis=1)
    return t, together - together[0]


def in_btr(xml, effects, joints):
    """The arm with effects in its last joint, as a model of btr; and the motion of that joint."""
    model = mujoco.MjModel.from_xml_string(xml)
    step, (t, told) = model.opt.timestep, commands(joints)
    steps = round(CONTROL_S / step)
    clock = f"control_s = {CONTROL_S}\nsteps_per_control = {steps}\nsample_every = {steps}\n"
    placed = ""
    for effect in effects:
        placed += f'[[effects]]\nsite = "{JOINTS[joints - 1]}"\n'
        placed += "".join(f"{key} = {value!r}\n" for key, value in effect.items())
    text = btr.Model.from_mujoco(model).text
    text = text.replace(f"control_s = {step}\nsteps_per_control = 1\n", clock)
    fitted = btr.Model(text.replace("[parameters]", f"{placed}\n[parameters]"))
    names = JOINTS[:joints]
    columns = {f"cmd_{name}": told[:, k] for k, name in enumerate(names)} | {f"q_{name}": 0 * t for name in names}
    return fitted, fitted.simulate(btr.Log(t, columns))[f"q_{names[-1]}"]


def in_mujoco(xml, effects, joints=2):
    """The motion of the last joint with effects, which are those of an export or of this joint."""
    model = mujoco.MjModel.from_xml_string(xml)
    data, (_, told) = mujoco.MjData(model), commands(joints)
    given = effects if isinstance(effects, dict) else {"joints": {JOINTS[joints - 1]: effects}}
    stepper = btr.mujoco.EffectStepper(model, given)
    assert stepper.ignored == []
    positions = []
    for command in told:
        positions.append(data.qpos[-1])
        data.ctrl[:] = command
        for _ in range(round(CONTROL_S / model.opt.timestep)):
            stepper.step(data)
    return np.array(positions)


def apart(tmp_path, xml, effects, joints=2):
    """How far btr's model is from what is exported of it, with its effects and without, in mrad."""
    fitted, expected = in_btr(xml, effects, joints)
    (tmp_path / "arm.xml").write_text(xml)
    exported = fitted.export("mujoco", tmp_path / "arm.xml")
    found = [in_mujoco(exported.text, given, joints) for given in (exported.effects or [], [])]
    many = min(len(expected), *map(len, found))
    return [1e3 * np.sqrt(np.mean((motion[:many] - expected[:many]) ** 2)) for motion in found]


@pytest.mark.parametrize("joints", [1, 2])
@pytest.mark.parametrize("effect", [ELASTIC, LOOSE], ids=["elastic", "loose"])
@pytest.mark.parametrize("armature", [0, 0.005, 0.2], ids=["unknown", "light", "heavy"])
def test_a_transmission_is_that_of_btr(tmp_path, effect, joints, armature):
    # Rotors of less and of more inertia than their links, which would bounce from the latter.
    with_it, without = apart(tmp_path, arm(joints, armature), [effect], joints)
    assert with_it < 0.15, with_it
    assert without > 5.0, without


def test_two_transmissions_are_one_behind_the_other(tmp_path):
    with_them, without = apart(tmp_path, arm(armature=0.005), [LOOSE, ELASTIC])
    assert with_them < 0.3 and without > 5.0, (with_them, without)


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast"])
def test_other_integrators_are_about_as_far_off_as_without_effects(tmp_path, integrator):
    xml = arm(integrator=integrator, step=0.001)
    bare, _ = apart(tmp_path, xml, [])
    assert bare > 0.5
    for effect in (ELASTIC, LOOSE):
        assert apart(tmp_path, xml, [effect])[0] < 1.5 * bare


def test_actuators_keep_their_limits(tmp_path):
    free, bound = arm(), arm(actuator='forcerange="-1 1"')
    assert apart(tmp_path, bound, [ELASTIC])[0] < 0.3
    commanded = arm(actuator='ctrlrange="-0.3 0.3"')
    motions = [in_mujoco(xml, [ELASTIC]) for xml in (free, bound, commanded)]
    assert np.max(np.abs(motions[1] - motions[0])) > 0.01 and np.ptp(motions[2]) < 0.8 * np.ptp(motions[0])


def test_other_effects_of_the_joint_act_on_their_own_side(tmp_path):
    others = [
        {"effect": "cogging", "amplitude": 0.2, "order": 9.0, "phase": 0.3},
        {"effect": "command_delay", "delay": 0.02},
        {"effect": "command_deadband", "band": 0.02},
    ]
    with_them, without = apart(tmp_path, arm(), [*others, ELASTIC])
    assert with_them < 0.1 and without > 5.0, (with_them, without)


def test_stiff_transmissions_stay_calm_in_long_steps():
    for integrator in ("Euler", "RK4"):
        xml = arm(armature=0.001, integrator=integrator, step=0.002)
        stiff, rigid = in_mujoco(xml, [{**ELASTIC, "stiffness": 1e5}]), in_mujoco(xml, [])
        assert np.max(np.abs(stiff - rigid)) < 0.02


def test_a_step_leaves_the_model_and_tells_the_torque_of_the_motor():
    model = mujoco.MjModel.from_xml_string(arm(actuator='gear="2"'))
    names = ["dof_armature", "actuator_gainprm", "actuator_biasprm", "actuator_biastype"]
    before = [np.array(getattr(model, name)) for name in names]
    stepper, data = btr.mujoco.EffectStepper(model, {"joints": {"elbow": [ELASTIC]}}), mujoco.MjData(model)
    data.ctrl[:] = 1.0
    first = stepper.step(data) or data.qpos.copy()
    for _ in range(6000):
        stepper.step(data)
    assert all(np.array_equal(getattr(model, name), kept) for name, kept in zip(names, before, strict=True))
    assert np.all(data.qfrc_applied == 0.0) and np.all(data.ctrl == 1.0)
    # At rest the motor carries the link, and its own position is what the servo compares with the command.
    torque = data.qfrc_actuator[1]
    assert torque == pytest.approx(data.qfrc_bias[1], abs=1e-3) and abs(torque) > 0.1
    motor = data.qpos[1] + torque / ELASTIC["stiffness"]
    assert torque == pytest.approx(2 * 30 * (1.0 - 2 * motor), abs=1e-3)
    # It begins anew.
    stepper.reset()
    mujoco.mj_resetData(model, data)
    data.ctrl[:] = 1.0
    stepper.step(data)
    assert np.array_equal(data.qpos, first)


def test_a_joint_with_an_actuator_of_another_kind_is_left_as_it_is():
    muscle = arm().replace('<position joint="elbow" kp="30" kv="0.5" />', '<muscle joint="elbow" lengthrange="0 1"/>')
    assert "muscle" in muscle
    model = mujoco.MjModel.from_xml_string(muscle)
    with pytest.warns(UserWarning, match="elbow: joint_elasticity"):
        stepper = btr.mujoco.EffectStepper(model, {"joints": {"elbow": [ELASTIC], "shoulder": [LOOSE]}})
    assert stepper.ignored == ["elbow: joint_elasticity"]
