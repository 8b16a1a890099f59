"""Models that are imported from MuJoCo: equal accelerations and motions, and a list of what is lost."""

import json
import math
import pickle
import subprocess
import sys

import pytest

import btr

mujoco = pytest.importorskip("mujoco")
np = pytest.importorskip("numpy")

# Relative to the largest acceleration of the state.
AGREE = 1e-10

ARM = """
<mujoco model="arm">
  <option timestep="0.001"/>
  <default><joint damping="0.3" armature="0.02"/></default>
  <worldbody>
    <geom type="plane" size="1 1 1" contype="0" conaffinity="0"/>
    <body name="turret" pos="0.1 0.2 0.5" euler="20 90 30">
      <joint name="yaw" axis="0 0 1" ref="0.4" range="-90 120"/>
      <joint name="roll" axis="1 2 0" pos="0.05 0 0.02" stiffness="3" springref="10"/>
      <geom type="box" size="0.1 0.05 0.04" pos="0.02 0.03 0" euler="10 20 30"/>
      <body name="mount" pos="0 0 0.2" euler="0 45 0">
        <geom type="sphere" size="0.03" mass="0.4"/>
        <body name="slider" pos="0.1 0 0" euler="0 0 90">
          <joint name="slide" type="slide" axis="1 0 1" ref="0.05" range="-0.1 0.3" frictionloss="0.7"/>
          <geom type="capsule" size="0.02" fromto="0 0 0 0.2 0.1 0.1"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""
WALKER = """
<mujoco model="walker">
  <worldbody>
    <geom type="plane" size="5 5 1" friction="0.9"/>
    <body name="trunk" pos="0 0 0.6">
      <freejoint/>
      <geom type="box" size="0.2 0.1 0.05" friction="0.7"/>
      <body name="leg" pos="0.1 0.1 -0.05">
        <joint name="hip_x" axis="1 0 0" armature="0.01"/>
        <joint name="hip_y" axis="0 1 0" damping="0.2"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0 0.05 -0.3" friction="0.5"/>
      </body>
    </body>
    <body name="cube" pos="1 0 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body>
  </worldbody>
</mujoco>"""


def pendulum(joint="", actuator="", more=""):
    """A pendulum of 1 kg at 0.3 m, with further attributes and elements."""
    return f"""
<mujoco model="pendulum">
  <option timestep="0.0005" integrator="RK4"/>
  <worldbody>
    <body name="bob"><joint name="hinge" axis="0 1 0" {joint}/><geom type="sphere" size="0.05" pos="0 0 -0.3" mass="1"/>
      <site name="tip" pos="0 0 -0.3"/></body>
    {more}
  </worldbody>
  <actuator>{actuator}</actuator>
</mujoco>"""


def compiled(xml):
    return mujoco.MjModel.from_xml_string(xml)


def free(model):
    """The model without constraints, which MuJoCo softens."""
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return model


@pytest.mark.parametrize("xml", [ARM, WALKER], ids=["arm", "walker"])
def test_accelerations_are_those_of_mujoco(xml):
    mj = free(compiled(xml))
    model, data, rng = btr.Model.from_mujoco(mj), mujoco.MjData(mj), np.random.default_rng(3)
    joints = [mj.joint(name).id for name in model.joints]
    floats, dofs = mj.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE, mj.jnt_dofadr[joints]
    for _ in range(50):
        mujoco.mj_resetData(mj, data)
        q, dq, torques = (rng.normal(0, 1, len(joints)) for _ in range(3))
        data.qpos[mj.jnt_qposadr[joints]], data.qvel[dofs], data.qfrc_applied[dofs] = q, dq, torques
        base, expected = None, []
        if floats:
            turn = rng.normal(size=4)
            turn /= np.linalg.norm(turn)
            rotation = np.empty(9)
            mujoco.mju_quat2Mat(rotation, turn)
            rotation = rotation.reshape(3, 3)
            velocity, angular = rng.normal(size=3), rng.normal(size=3)
            data.qpos[:7], data.qvel[:6] = [0.1, 0.2, 0.3, *turn], [*velocity, *(rotation.T @ angular)]
            base = ([0.1, 0.2, 0.3, *turn], [*velocity, *angular])
        mujoco.mj_forward(mj, data)
        if floats:
            expected = [*(rotation @ data.qacc[3:6]), *data.qacc[:3]]
        expected = np.array([*expected, *data.qacc[dofs]])
        found = model.accelerations(q, dq, torques, base=base)
        assert np.max(np.abs(found - expected)) <= AGREE * np.max(np.abs(expected))


def test_accelerations_follow_newton_and_check_shapes():
    # 1 kg at 0.3 m, and a sphere's own inertia.
    model, inertia = btr.Model.from_mujoco(compiled(pendulum())), 0.09 + 0.4 * 0.05**2
    (found,) = model.accelerations([0.5], [0.0], [0.2])
    assert found == pytest.approx((0.2 - 9.81 * 0.3 * np.sin(0.5)) / inertia, rel=1e-9)
    with pytest.raises(ValueError, match=r"q has shape \(2,\), but \(1,\)"):
        model.accelerations([0.5, 0.1], [0.0], [0.0])


ACTUATORS = {
    "position": ('<position name="a" joint="hinge" kp="40" kv="2"/>', 1, 0),
    "geared": ('<position name="a" joint="hinge" kp="4" kv="0.2" gear="3"/>', 1 / 3, 0),
    "general": ('<general name="a" joint="hinge" gainprm="8" biastype="affine" biasprm="1 -30 -1"/>', 8 / 30, 1 / 30),
    "motor": ('<motor name="a" joint="hinge" gear="5"/>', 5, 0),
    "limited": ('<motor name="a" joint="hinge" gear="5" forcerange="-0.1 0.1"/>', 5, 0),
    "velocity": ('<velocity name="a" joint="hinge" kv="3" gear="2"/>', 1, 0),
    "dc motor": ('<dcmotor name="a" joint="hinge" motorconst="0.4" resistance="0.5"/>', 1, 0),
    "rotor": ('<motor name="a" joint="hinge" gear="10" armature="0.001" damping="0.01"/>', 10, 0),
    "filtered": ('<position name="a" joint="hinge" kp="40" kv="2" timeconst="0.1"/>', 1, 0),
}


@pytest.mark.parametrize("kind", ACTUATORS)
def test_actuators_move_their_joints_as_in_mujoco(kind):
    actuator, factor, offset = ACTUATORS[kind]
    mj = compiled(pendulum(actuator=actuator, joint='damping="0.1"'))
    model, data = btr.Model.from_mujoco(mj), mujoco.MjData(mj)
    clock_s = np.arange(0, 1.0, 0.01)
    controls, rows = 0.3 * np.sin(4 * clock_s) + 0.1, []
    for control in controls:
        rows.append(data.qpos[0])
        data.ctrl[0] = control
        for _ in range(20):
            mujoco.mj_step(mj, data)
    log = btr.Log(clock_s, {"cmd_hinge": factor * controls + offset, "q_hinge": rows, "dq_hinge": np.zeros(100)})
    found = np.interp(clock_s, *(lambda run: (run.clock_s, run["q_hinge"]))(model.simulate(log)))
    # The filter of the lag begins at its first command in btr, and at 0 in MuJoCo.
    begins = 50 if kind == "filtered" else 0
    tolerance = 0.05 if kind == "filtered" else 1e-3
    assert np.max(np.abs(found - rows)[begins:]) < tolerance * np.ptp(rows)
    assert model.not_represented == ["contacts: a robot with a fixed base touches nothing in btr"]


def test_a_delay_becomes_an_effect():
    mj = compiled(pendulum(actuator='<motor name="a" joint="hinge" delay="0.02" nsample="50"/>'))
    assert 'effect = "command_delay"\nsite = "hinge"\ndelay = 0.02' in btr.Model.from_mujoco(mj).text


def test_an_equality_of_joints_becomes_a_mimic():
    xml = pendulum(more='<body pos="1 0 0"><joint name="other"/><geom size="0.1"/></body>').replace(
        "<actuator>", '<equality><joint joint1="other" joint2="hinge" polycoef="0.1 -2 0 0 0"/></equality><actuator>'
    )
    run = btr.Model.from_mujoco(compiled(xml)).simulate(
        btr.Log([0.0, 0.1, 0.2], {"cmd_hinge": np.zeros(3), "q_hinge": [0.3, 0.3, 0.3]})
    )
    assert np.allclose(run["q_other"], 0.1 - 2 * run["q_hinge"], atol=1e-9)


def test_an_actuator_of_a_follower_is_listed():
    xml = pendulum(more='<body pos="1 0 0"><joint name="other"/><geom size="0.1"/></body>').replace(
        "<actuator>",
        '<equality><joint joint1="other" joint2="hinge"/></equality><actuator><motor name="m" joint="other"/>',
    )
    lost = btr.Model.from_mujoco(compiled(xml)).not_represented
    assert "the actuator `m`, whose joint follows another one, which drives it" in lost
    assert "the softness of equalities (solref, solimp): what follows a joint follows it exactly" in lost


def test_a_scene_is_read_as_its_robot(tmp_path):
    model = btr.Model.from_mujoco(compiled(WALKER))
    assert model.joints == ["hip_x", "hip_y"] and model.name == "walker"
    assert 'base = "floating"\nheight_m = 0.6' in model.text and "ground_friction = 0.9" in model.text
    assert "bodies that move freely beside the robot: cube" in model.not_represented
    assert any("hard" in what for what in model.not_represented)
    for other in (pickle.loads(pickle.dumps(model)), model.at({"mass@trunk": model.values["mass@trunk"]})):
        assert other.not_represented == model.not_represented
    model.save(tmp_path / "walker.toml")
    assert btr.load_model(tmp_path / "walker.toml").not_represented == model.not_represented


def test_values_of_the_robot_are_in_the_model():
    model = btr.Model.from_mujoco(mujoco.MjSpec.from_string(ARM))
    assert model.values["damping@yaw"] == 0.3 and model.values["friction@slide"] == 0.7
    assert model.text.count('effect = "armature"') == 3 and 'effect = "parallel_spring"\nsite = "roll"' in model.text
    assert f"rest = {math.radians(10)!r}" in model.text and "control_s = 0.001" in model.text


LOST = {
    "the tendon `cord`, with its stiffness": pendulum().replace(
        "<actuator>",
        '<tendon><fixed name="cord" stiffness="3"><joint joint="hinge" coef="1"/></fixed></tendon><actuator>',
    ),
    "the actuator `m`: btr has no muscles; its joint is passive here": pendulum(
        actuator='<muscle name="m" joint="hinge" lengthrange="0.1 1"/>'
    ),
    "the actuator `m`: btr has no integrating actuators; its joint is passive here": pendulum(
        actuator='<intvelocity name="m" joint="hinge" kp="3" actrange="-1 1"/>'
    ),
    "the actuator `m`, which acts on a site": pendulum(actuator='<general name="m" site="tip"/>'),
    "the actuators `p`, `v`: one joint, `hinge`, has one motor; it is passive here": pendulum(
        actuator='<position name="p" joint="hinge"/><velocity name="v" joint="hinge"/>'
    ),
    "the clamping of controls to their range (ctrlrange): `p` [-1, 1]": pendulum(
        actuator='<position name="p" joint="hinge" ctrlrange="-1 1"/>'
    ),
    "the limits -1 and 2 of the force of `p`: btr's are the same on both sides": pendulum(
        actuator='<motor name="p" joint="hinge" forcerange="-1 2"/>'
    ),
    "the fluid (density, viscosity, wind)": pendulum().replace('RK4"', 'RK4" density="1.2"'),
    "gravity compensation (gravcomp) of the links bob": pendulum().replace('name="bob"', 'name="bob" gravcomp="1"'),
    "the name of the joint `hinge@1`: it is `hinge_1` here": pendulum().replace('"hinge"', '"hinge@1"'),
    "the equality `e`: joints follow others linearly in btr, not by a polynomial": pendulum(
        more='<body pos="1 0 0"><joint name="o"/><geom size="0.1"/></body>'
    ).replace(
        "<actuator>",
        '<equality><joint name="e" joint1="o" joint2="hinge" polycoef="0 1 1 0 0"/></equality><actuator>',
    ),
}


@pytest.mark.parametrize("what", LOST)
def test_what_is_not_represented_is_listed(what):
    assert what in btr.Model.from_mujoco(compiled(LOST[what])).not_represented


LOOP = '<equality><connect name="loop" body1="bob" body2="world" anchor="0 0 -0.3"/></equality><actuator>'
FLEX = (
    '<flexcomp type="grid" count="3 3 1" spacing=".1 .1 .1" name="cloth" dim="2" mass="1" pos="0 0 1">'
    '<edge equality="true"/></flexcomp>'
)
WELD = '<equality><weld name="weld" body1="bob"/></equality><actuator>'
COMPOSITE = (
    '<body pos="0 1 1"><composite type="cable" prefix="rope" count="5 1 1" curve="s" size="1"><joint kind="main"/>'
    '<geom type="capsule" size="0.01"/></composite></body>'
)
FALSE = {
    "the equality `loop` (connect) closes a loop between `bob` and `world`": pendulum().replace("<actuator>", LOOP),
    "the model has flexes": pendulum(more=FLEX),
    "btr has no ball joints: hinge": pendulum(joint='type="ball"'),
    "the model has several robots: `trunk`, `bob`": WALKER.replace(
        '<body name="cube"', '<body name="bob"><joint/><geom size="0.1"/></body><body name="cube"'
    ),
    "gravity does not point along z": pendulum().replace('RK4"', 'RK4" gravity="1 0 -9.81"'),
    "the model has no joint that moves": "<mujoco><worldbody><geom size='0.1'/></worldbody></mujoco>",
}


@pytest.mark.parametrize("message", FALSE)
def test_what_would_make_the_model_false_is_refused(message):
    with pytest.raises(btr.BtrError) as raised:
        btr.Model.from_mujoco(compiled(FALSE[message]))
    assert message in str(raised.value) and "\nhelp: " in str(raised.value)


def test_one_of_several_robots_is_chosen_by_its_root():
    model = compiled(FALSE["the model has several robots: `trunk`, `bob`"])
    assert btr.Model.from_mujoco(model, root="bob").joints == ["joint3"]
    assert btr.Model.from_mujoco(model, root="trunk").joints == ["hip_x", "hip_y"]
    with pytest.raises(btr.BtrError, match="there is no body `bobb`"):
        btr.Model.from_mujoco(model, root="bobb")


def test_files_that_do_not_compile_are_refused_with_the_reason(tmp_path):
    file = tmp_path / "robot.xml"
    with pytest.raises(btr.BtrError, match="there is no such file"):
        btr.Model.from_mujoco(file)
    file.write_text(pendulum().replace("<joint ", "<jiont "))
    with pytest.raises(btr.BtrError, match=r"robot.xml: MuJoCo does not compile it: .*jiont"):
        btr.Model.from_mujoco(file)
    file.write_text('<mujoco><asset><mesh name="m" file="gone.stl"/></asset><worldbody/></mujoco>')
    with pytest.raises(btr.BtrError, match=r"does not compile it: .*gone.stl"):
        btr.Model.from_mujoco(str(file))
    file.write_text(pendulum())
    assert btr.Model.from_mujoco(file).name == "robot"
    with pytest.raises(TypeError, match="not int"):
        btr.Model.from_mujoco(3)


def command(folder, *words):
    """The exit code of the command `btr` in a folder, and what it says."""
    run = subprocess.run([sys.executable, "-m", "btr", *words], cwd=folder, capture_output=True, text=True, check=False)
    return run.returncode, run.stdout, run.stderr


def test_the_command_new_makes_a_model_of_an_mjcf_file(tmp_path):
    (tmp_path / "walker.xml").write_text(WALKER)
    code, told, _ = command(tmp_path, "new", "walker.xml", "-o", "walker.toml")
    assert code == 0 and "walker.toml: a model of 2 joints" in told
    assert "not represented: bodies that move freely beside the robot: cube" in told
    model = btr.load_model(tmp_path / "walker.toml")
    assert model.not_represented == btr.Model.from_mujoco(tmp_path / "walker.xml").not_represented
    assert 'urdf = "walker.urdf"' in model.text and (tmp_path / "walker.urdf").is_file()
    code, _, told = command(tmp_path, "new", "walker.xml", "-o", "walker.toml")
    assert code == 2 and told == "error: walker.toml exists\nhelp: give another name, or --overwrite\n"
    code, told, _ = command(tmp_path, "new", "walker.xml", "-o", "again.toml", "--json")
    assert json.loads(told)["not_represented"] == model.not_represented


@pytest.mark.parametrize(
    ("xml", "message"),
    [
        (FALSE["the model has flexes"], "the model has flexes, which btr does not simulate"),
        (FALSE["btr has no ball joints: hinge"], "btr has no ball joints: hinge"),
        (pendulum().replace("<actuator>", LOOP), "the equality `loop` (connect) closes a loop between `bob`"),
        (pendulum().replace("<joint ", "<jiont "), "MuJoCo does not compile it: "),
        ('<mujoco><asset><mesh name="m" file="gone.stl"/></asset></mujoco>', "gone.stl"),
        (FALSE["the model has several robots: `trunk`, `bob`"], "the model has several robots: `trunk`, `bob`"),
        (pendulum().replace("<actuator>", WELD), "the equality `weld` (weld) closes a loop between `bob` and `world`"),
        (pendulum(more=COMPOSITE), "unrecognized element Element 'composite', line"),
        ("<mujoco><worldbody><body>", "MuJoCo does not compile it: "),
    ],
)
def test_the_command_new_has_a_clear_word_for_each_bad_model(tmp_path, xml, message):
    (tmp_path / "robot.xml").write_text(xml)
    code, told, error = command(tmp_path, "new", "robot.xml", "-o", "robot.toml")
    assert code == 2 and not told and message in error and "\nhelp: " in error and "Traceback" not in error
    assert not (tmp_path / "robot.toml").exists()


def test_the_command_new_says_what_is_wrong_with_a_compiled_model(tmp_path):
    (tmp_path / "robot.mjb").write_bytes(b"no model" * 100)
    code, told, error = command(tmp_path, "new", "robot.mjb", "-o", "robot.toml")
    assert code == 2 and not told and "Traceback" not in error and not (tmp_path / "robot.toml").exists()
    assert error.startswith("error: robot.mjb: MuJoCo does not compile it: ")
    assert error.endswith("loads it: save it again, or give the MJCF file\n")


def test_the_command_new_shows_no_traceback_of_python(tmp_path):
    (tmp_path / "robot.xml").write_text(pendulum())
    failing = "import btr._mujoco.trees as t, sys; t.tree_of = lambda *_: 1 / 0; "
    code = f"{failing}import btr._mujoco as m; m.tree_of = t.tree_of; from btr._mujoco.__main__ import main; main()"
    run = subprocess.run(
        [sys.executable, "-c", code, "robot.xml"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    message = json.loads(run.stdout)["error"]["message"]
    assert message == "robot.xml: it cannot be read as a MuJoCo model: ZeroDivisionError: division by zero"
    assert not run.stderr


XACRO = """
<robot name="lever" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="m" value="2"/>
  <link name="world"/>
  <link name="lever"><inertial><origin xyz="0 0 0.2"/><mass value="${m}"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="hinge" type="continuous"><parent link="world"/><child link="lever"/><axis xyz="0 1 0"/></joint>
</robot>"""


def test_the_command_new_expands_xacro(tmp_path):
    pytest.importorskip("xacro", reason="xacro files need the package xacro")
    (tmp_path / "lever.urdf.xacro").write_text(XACRO)
    code, _, told = command(tmp_path, "new", "lever.urdf.xacro", "-o", "lever.toml")
    assert code == 0, told
    assert btr.load_model(tmp_path / "lever.toml").values["mass@lever"] == 2.0
    (tmp_path / "bad.xacro").write_text(XACRO.replace("${m}", "${n}"))
    code, _, told = command(tmp_path, "new", "bad.xacro", "-o", "bad.toml")
    assert code == 2 and "bad.xacro: xacro cannot expand it: error: name 'n' is not defined" in told
    assert "\nhelp: expand it where its packages are known" in told and not (tmp_path / "bad.toml").exists()
    (tmp_path / "found.xacro").write_text(XACRO.replace("<link name=\"world\"/>", '<link name="$(find arm)"/>'))
    code, _, told = command(tmp_path, "new", "found.xacro", "-o", "found.toml")
    assert code == 2 and "found.xacro: xacro cannot expand it: " in told and "Traceback" not in told
