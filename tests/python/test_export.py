"""Models in the files of other simulators: what MuJoCo makes of them."""

import json
from pathlib import Path

import btr
import pytest
from btr.exported import Exported

np = pytest.importorskip("numpy")
mujoco = pytest.importorskip("mujoco")

ROBOTS = Path(__file__).parents[2] / "robots"
LOG = ROBOTS / "arm" / "learn_1.csv"
JOINTS = ["yaw", "shoulder", "elbow"]
GAINS = {"yaw": (20.0, 0.5), "shoulder": (25.0, 0.6), "elbow": (12.0, 0.25)}
STEP_S = 0.001
FOUND = {
    "viscous_friction.coefficient@shoulder": 0.21,
    "coulomb_friction.torque@elbow": 0.13,
    "end_payload.mass@forearm": 0.35,
    "armature.inertia@yaw": 0.02,
    "torque_limit.torque@shoulder": 7.5,
    "command_delay.delay@elbow": 0.0151,
    "command_rate_limit.rate@yaw": 1.0,
    "load_dependent_friction.ratio@shoulder": 0.1,
    "stribeck_friction.coulomb@yaw": 0.1,
    "stribeck_friction.static@yaw": 0.2,
    "stribeck_friction.velocity@yaw": 0.1,
    "cogging.amplitude@yaw": 0.08,
    "cogging.order@yaw": 12.0,
}


@pytest.fixture(scope="module")
def fitted():
    """The desk arm with effects of every kind that an export carries or leaves."""
    text = (ROBOTS / "arm.toml").read_text()
    values = "".join(f'"{name}" = {{ bounds = [0.0, 100.0], value = {value} }}\n' for name, value in FOUND.items())
    return btr.Model(text + values, ROBOTS / "fitted.toml")


@pytest.fixture
def robot(tmp_path):
    """The desk arm with its servos, as MuJoCo itself writes it."""
    spec = mujoco.MjSpec.from_file(str(ROBOTS / "arm.urdf"))
    for joint, (kp, kd) in GAINS.items():
        servo = spec.add_actuator(name=f"{joint}_servo", target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=kp, kv=kd)
    spec.option.timestep = STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.compile()
    (tmp_path / "robot.xml").write_text(spec.to_xml())
    return tmp_path / "robot.xml"


def replayed(path, effects, times):
    """The joints' positions at these times, told what the log says."""
    log = btr.load_log(LOG)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    stepper = btr.mujoco.EffectStepper(model, effects or {"joints": {}})
    assert stepper.ignored == []
    places = [model.joint(joint).qposadr[0] for joint in JOINTS]
    data.qpos[places] = [log[f"q_{joint}"][0] for joint in JOINTS]
    commands = np.stack([log[f"cmd_{joint}"] for joint in JOINTS], axis=1)
    clock = log.clock_s - log.clock_s[0]
    every = round((times[1] - times[0]) / STEP_S)
    positions = []
    for step in range(every * (len(times) - 1) + 1):
        if step % every == 0:
            positions.append(data.qpos[places].copy())
        data.ctrl[:] = commands[max(np.searchsorted(clock, step * STEP_S + 1e-9, side="right") - 1, 0)]
        stepper.step(data)
    return np.array(positions)


OF_CLASSES = """<mujoco>
  <default>
    <joint damping="0.2" stiffness="1"/>
    <default class="strong">
      <joint armature="0.01" frictionloss="0.1"/>
      <general biastype="affine" gainprm="500" biasprm="3 -200"/>
    </default>
  </default>
  <worldbody>
    <body name="a" childclass="strong"><joint name="one" axis="0 1 0"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3"/>
      <body name="b" pos="0 0 -0.3"><joint name="two" axis="0 1 0" stiffness="0" damping="0.123456789012345"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3"/>
        <body name="c" pos="0 0 -0.3"><joint name="three" axis="0 1 0"/>
          <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3"/></body></body></body>
  </worldbody>
  <actuator>
    <general class="strong" joint="one"/>
    <motor joint="two" gear="5" ctrlrange="-1 1"/>
    <position joint="three" kp="20" dampratio="1"/>
  </actuator>
</mujoco>"""


def test_an_imported_model_changes_nothing_in_its_own_file(tmp_path):
    (tmp_path / "robot.xml").write_text(OF_CLASSES)
    imported = btr.Model.from_mujoco(tmp_path / "robot.xml")
    exported = imported.export("mujoco", tmp_path / "robot.xml")
    # MuJoCo computes the damping of this servo: the file then has it as a number.
    assert all(line.startswith("three: kv ") for line in exported.carried), exported.carried
    before, after = mujoco.MjModel.from_xml_string(OF_CLASSES), mujoco.MjModel.from_xml_string(exported.text)
    assert exported.text.replace(f'kv="{-after.actuator_biasprm[2, 2]:.10g}"', 'dampratio="1"') == OF_CLASSES
    np.testing.assert_allclose(after.actuator_biasprm, before.actuator_biasprm, rtol=1e-9)
    # A stiffer servo keeps what its control means.
    stiffer = btr.Model(imported.text.replace("kp = 200.0", "kp = 300.0")).export("mujoco", tmp_path / "robot.xml")
    servo = mujoco.MjModel.from_xml_string(stiffer.text).actuator(0)
    assert list(servo.gainprm[:1]) == [750.0] and list(servo.biasprm[:3]) == [4.5, -300.0, 0.0]


def rms(x):
    return np.sqrt(np.mean(x**2, axis=0))


def test_mujoco_replays_the_model_with_the_effects_that_are_left(fitted, robot, tmp_path):
    exported = fitted.export("mujoco", robot)
    exported.save(tmp_path / "fitted.xml")
    simulated = fitted.simulate(LOG)
    expected = np.stack([simulated[f"q_{joint}"] for joint in JOINTS], axis=1)
    without = replayed(tmp_path / "fitted.xml", None, simulated.clock_s)
    with_them = replayed(tmp_path / "fitted.xml", tmp_path / "fitted.effects.json", simulated.clock_s)
    assert np.all(rms(without - expected) > 0.03)
    # Both integrate in their own way: the nominal models are 1.2 mrad apart.
    assert np.all(rms(with_them - expected) < 0.005), rms(with_them - expected)


def test_a_log_is_replayed_with_the_error_of_each_joint(fitted, robot, tmp_path):
    fitted.export("mujoco", robot).save(tmp_path / "fitted.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "fitted.xml"))
    before = model.opt.timestep, model.opt.integrator
    said = fitted.simulate(LOG)
    told = btr.load_log(LOG)
    # On the clock of the log, whose rounded times must not make commands late.
    clock = told.clock_s.astype(np.float32).astype(np.float64)
    at = np.searchsorted(said.clock_s, told.clock_s - 1e-6)
    positions = {f"q_{joint}": said[f"q_{joint}"][at] for joint in JOINTS}
    log = btr.Log(clock, {**{f"cmd_{joint}": told[f"cmd_{joint}"] for joint in JOINTS}, **positions})
    replayed = btr.mujoco.replay(model, log, tmp_path / "fitted.effects.json")
    assert set(replayed.rmse) == set(JOINTS) and max(replayed.rmse.values()) < 0.003, replayed.rmse
    assert str(replayed).count("rms") == len(JOINTS)
    assert all(len(q) == len(clock) for q in replayed.positions.values())
    assert min(btr.mujoco.replay(model, log).rmse.values()) > 0.02
    assert (model.opt.timestep, model.opt.integrator) == before
    with pytest.raises(btr.BtrError, match="command for no joint"):
        btr.mujoco.replay(model, btr.Log(clock, {f"q_{joint}": log[f"q_{joint}"] for joint in JOINTS}))


def test_the_file_has_the_numbers(fitted, robot, tmp_path):
    exported = fitted.export("mujoco", robot)
    assert isinstance(exported, Exported)
    exported.save(tmp_path / "fitted.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "fitted.xml"))
    dof = {joint: model.joint(joint).dofadr[0] for joint in JOINTS}
    assert model.dof_armature[dof["yaw"]] == pytest.approx(0.02)
    assert model.dof_damping[dof["shoulder"]] == pytest.approx(0.21)
    assert model.dof_frictionloss[dof["elbow"]] == pytest.approx(0.13)
    assert model.dof_frictionloss[dof["yaw"]] == pytest.approx(0.1)
    assert list(model.actuator("shoulder_servo").forcerange) == [-7.5, 7.5]
    before = mujoco.MjModel.from_xml_path(str(robot)).body_subtreemass[0]
    assert model.body_subtreemass[0] - before == pytest.approx(0.35)


FRICTION = {"yaw": 0.5, "shoulder": 0.6, "elbow": 0.2}
NOISE_FLOOR = 0.00071


def beside_mujoco(robot, effects, integrator="RK4"):
    """How far MuJoCo's motion is from the model's, in noise floors of the arm's encoders, and what was exported."""
    robot.write_text(robot.read_text().replace("implicitfast", integrator))
    text = (ROBOTS / "arm.toml").read_text()
    values = "".join(f'"{name}" = {{ bounds = [0.0, 100.0], value = {value} }}\n' for name, value in effects.items())
    model = btr.Model(text + values, ROBOTS / "fitted.toml")
    exported = model.export("mujoco", robot)
    exported.save(robot.with_name("fitted.xml"))
    simulated = model.simulate(LOG)
    expected = np.stack([simulated[f"q_{joint}"] for joint in JOINTS], axis=1)
    moved = replayed(robot.with_name("fitted.xml"), exported.effects, simulated.clock_s)
    return rms(moved - expected) / NOISE_FLOOR, exported


@pytest.mark.parametrize("creep", [(0.05, 0.01), (0.2, 0.02), (0.3, 0.002)])
def test_dry_friction_creeps_as_in_the_model(robot, creep):
    effects = {f"coulomb_friction.torque@{joint}": torque for joint, torque in FRICTION.items()}
    effects |= {f"friction_creep.creep@{joint}": creep[0] for joint in JOINTS}
    effects |= {f"friction_creep.time_constant@{joint}": creep[1] for joint in JOINTS}
    apart, exported = beside_mujoco(robot, effects)
    # MuJoCo's own softness is 0.4, 4.8 and 3.8 off, friction that holds 3.7, 7.6 and 2.1.
    assert np.all(apart < 0.2), apart
    assert exported.effects is None and not any("friction_creep" in line for line in exported.left)


def test_friction_that_bends_first_stays_as_dry_friction(robot):
    effects = {f"presliding_friction.torque@{joint}": torque for joint, torque in FRICTION.items()}
    effects |= {f"presliding_friction.stiffness@{joint}": 50.0 for joint in JOINTS}
    exported = btr.Model(
        (ROBOTS / "arm.toml").read_text()
        + "".join(f'"{name}" = {{ bounds = [0.0, 1e4], value = {value} }}\n' for name, value in effects.items()),
        ROBOTS / "fitted.toml",
    ).export("mujoco", robot)
    model = mujoco.MjModel.from_xml_string(exported.text)
    assert [model.dof_frictionloss[model.joint(joint).dofadr[0]] for joint in JOINTS] == list(FRICTION.values())
    told = [line for line in exported.advice if "stand for presliding_friction, without the bending" in line]
    assert len(told) == 3 and any(line.startswith("yaw: presliding_friction") for line in exported.left)


def test_a_diagonal_inertia_stays_one(tmp_path):
    (tmp_path / "rod.xml").write_text(
        """<mujoco><worldbody><body name="rod"><joint name="hinge" axis="0 1 0"/>
<inertial pos="0 0 -0.1" mass="1" diaginertia="0.01 0.02 0.015"/></body></worldbody></mujoco>"""
    )
    imported = btr.Model.from_mujoco(tmp_path / "rod.xml")
    for extra, kept, gone in (
        ("[[effects]]\neffect = 'payload'\nsite = 'rod'\nmass = 0.5\n", "diaginertia", "fullinertia"),
        (
            "[links.rod]\nmass_kg = 1.0\ncom_m = [0, 0, -0.1]\ninertia_kg_m2 = [0.01, 0.02, 0.015, 0.001, 0, 0]\n",
            "fullinertia",
            "diaginertia",
        ),
    ):
        exported = btr.Model(imported.text + "\n" + extra).export("mujoco", tmp_path / "rod.xml")
        inertial = exported.text.split("<inertial")[1].split("/>")[0]
        assert kept in inertial and gone not in inertial, inertial
        mujoco.MjModel.from_xml_string(exported.text)


def test_an_effect_on_a_joint_that_the_model_lacks_is_refused(robot):
    model = mujoco.MjModel.from_xml_path(str(robot))
    with pytest.raises(btr.BtrError, match="no joint `wrist`"):
        btr.mujoco.EffectStepper(model, {"joints": {"wrist": [{"effect": "cogging", "amplitude": 1.0}]}})


def test_effects_that_the_stepper_does_not_know_are_named(robot):
    model = mujoco.MjModel.from_xml_path(str(robot))
    unknown = {"effect": "presliding_friction", "torque": 0.1}
    effects = {"joints": {"yaw": [unknown]}, "robot": [{"effect": "voltage_sag", "sag": 1}]}
    with pytest.warns(UserWarning, match="does not apply robot: voltage_sag, yaw: presliding_friction"):
        stepper = btr.mujoco.EffectStepper(model, effects)
    assert stepper.ignored == ["robot: voltage_sag", "yaw: presliding_friction"]


def test_a_rotor_that_a_file_cannot_state_turns_with_the_joint(robot):
    stated, model = (mujoco.MjModel.from_xml_path(str(robot)) for _ in range(2))
    place = model.joint("elbow").dofadr[0]
    stated.dof_armature[place] = 0.03
    steppers = [
        btr.mujoco.EffectStepper(stated, {"joints": {}}),
        btr.mujoco.EffectStepper(model, {"joints": {"elbow": [{"effect": "armature", "inertia": 0.03}]}}),
    ]
    data = [mujoco.MjData(stated), mujoco.MjData(model)]
    for _ in range(500):
        for moved, stepper in zip(data, steppers, strict=True):
            moved.ctrl[:] = 0.5
            stepper.step(moved)
    assert np.array_equal(data[0].qpos, data[1].qpos) and abs(data[0].qpos[0]) > 0.1
    assert model.dof_armature[place] == 0.0


def test_a_step_leaves_the_model_as_it_was(robot):
    model = mujoco.MjModel.from_xml_path(str(robot))
    model.dof_frictionloss[:], model.dof_damping[:] = 0.1, 0.2
    slides = {"effect": "asymmetric_friction", "coulomb_forward": 0.3, "coulomb_backward": 0.3}
    slides |= {"viscous_forward": 0.1, "viscous_backward": 0.1}
    stepper = btr.mujoco.EffectStepper(model, {"joints": {"yaw": [slides]}})
    data = mujoco.MjData(model)
    data.ctrl[:] = 0.5
    free = [stepper.step(data) or float(data.qpos[0]) for _ in range(50)]
    assert np.all(model.dof_frictionloss == 0.1) and np.all(model.dof_damping == 0.2)
    # So a second stepper of the same model does the same.
    again, data = btr.mujoco.EffectStepper(model, {"joints": {"yaw": [slides]}}), mujoco.MjData(model)
    data.ctrl[:] = 0.5
    assert [again.step(data) or float(data.qpos[0]) for _ in range(50)] == free


def test_readings_are_late_and_off(robot):
    model = mujoco.MjModel.from_xml_path(str(robot))
    data = mujoco.MjData(model)
    late = {"effect": "encoder_delay", "delay": 0.0105}
    stepper = btr.mujoco.EffectStepper(model, {"joints": {"yaw": [late, {"effect": "encoder_offset", "offset": 0.2}]}})
    positions = []
    for step in range(50):
        data.ctrl[:] = 0.01 * step
        stepper.step(data)
        positions.append(data.qpos[model.joint("yaw").qposadr[0]])
    assert stepper.readings(data)["yaw"] == pytest.approx(0.5 * (positions[-11] + positions[-12]) + 0.2)
    stepper.reset()
    assert stepper.readings(data)["yaw"] == pytest.approx(positions[-1] + 0.2)


def test_isaac_lab_and_ros_files_are_valid(fitted):
    actuators = fitted.export("isaac-lab").text
    compile(actuators, "actuators.py", "exec")
    limits = fitted.export("ros2").text
    assert limits.startswith("# From ") and "max_effort: 7.5" in limits


@pytest.mark.parametrize(("to", "robot"), [("gazebo", None), ("mujoco", None), ("mujoco", "nowhere.xml")])
def test_what_cannot_be_exported_is_refused(fitted, to, robot):
    with pytest.raises(btr.BtrError):
        fitted.export(to, robot)


def test_saving_leaves_no_other_file(fitted, tmp_path):
    fitted.export("ros2").save(tmp_path / "limits.yaml")
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["limits.effects.json", "limits.yaml"]
    json.loads((tmp_path / "limits.effects.json").read_text())
