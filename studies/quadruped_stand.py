#!/usr/bin/env python3
"""A quadruped that hangs from a stand: are the values of all twelve drives recovered, with their intervals?

    cargo build --release && maturin develop --release && python3 studies/quadruped_stand.py [--seeds 1..5]

Needs btr, NumPy and MuJoCo (`pip install 'btr[mujoco]'`). The robot is written as MJCF: a base that is held, four legs
of three joints, position servos. Reality is the same robot in MuJoCo with, at each joint, a rotor, damping, dynamic and
static friction and an offset of its encoder that the model does not know, and one dead time of the bus: 61 values. It
follows chirps of all joints for a minute; positions are read at 400 Hz with 0.2 mrad of noise. btr imports the MJCF,
adds the effects and fits all values at once; the model is exported and replays a log that was held out in MuJoCo.

A line per seed: values within their 95 % intervals, the largest relative error of each kind, the error in noise floors
(learnt, held out), that of the exported file in MuJoCo, simulated logs and seconds. Stribeck's speed is known: it is
that of the plant.
"""

import argparse
import tempfile
from pathlib import Path

import btr
import mujoco
import numpy as np

LEGS = ["LF", "RF", "LH", "RH"]
JOINTS = [f"{leg}_{part}" for leg in LEGS for part in ("HAA", "HFE", "KFE")]
RATE_HZ, NOISE_RAD = 400, 0.0002
# Of the file, and of the plant that stands for reality.
STEP_S, PLANT_STEP_S = 0.00125, 0.0003125
STRIBECK_RAD_S = 0.1
# Ranges of the values, uniform.
RANGES = {
    "armature.inertia": (0.02, 0.08),
    "viscous_friction.coefficient": (0.1, 0.8),
    "stribeck_friction.coulomb": (0.2, 0.8),
    "encoder_offset.offset": (-0.06, 0.06),
}
DELAY_S = (0.004, 0.012)


def mjcf():
    """The robot, 30 kg; each joint is a servo that the user knows."""
    legs = []
    for leg in LEGS:
        x, y = (0.3 if leg[1] == "F" else -0.3), (0.12 if leg[0] == "L" else -0.12)
        side = np.sign(y)
        legs.append(f"""
      <body name="{leg}_hip" pos="{x} {y} 0">
        <joint name="{leg}_HAA" axis="1 0 0" range="-0.9 0.9"/>
        <inertial pos="0.03 {0.02 * side} 0" mass="1.9" diaginertia="0.003 0.004 0.004"/>
        <body name="{leg}_thigh" pos="0 {0.1 * side} 0">
          <joint name="{leg}_HFE" axis="0 1 0" range="-2 2"/>
          <inertial pos="0 {0.02 * side} -0.08" mass="2.2" diaginertia="0.014 0.014 0.004"/>
          <body name="{leg}_shank" pos="0 0 -0.28">
            <joint name="{leg}_KFE" axis="0 1 0" range="-2.6 2.6"/>
            <inertial pos="0.01 0 -0.12" mass="0.6" diaginertia="0.004 0.004 0.0004"/>
          </body>
        </body>
      </body>""")
    servos = "\n".join(f'    <position name="{j}" joint="{j}" kp="80" kv="2"/>' for j in JOINTS)
    return f"""<mujoco model="quadruped">
  <compiler angle="radian"/>
  <option timestep="{STEP_S}" integrator="RK4"/>
  <default>
    <!-- Dry friction holds: MuJoCo's default lets it creep. -->
    <joint solimpfriction="0.9999 0.9999 0.001" solreffriction="0.0005 1"/>
  </default>
  <worldbody>
    <body name="base" pos="0 0 1">
      <inertial pos="0 0 0" mass="12" diaginertia="0.2 0.5 0.5"/>{"".join(legs)}
    </body>
  </worldbody>
  <actuator>
{servos}
  </actuator>
</mujoco>
"""


def planted(rng):
    """Values by their names in btr."""
    values = {f"{name}@{joint}": rng.uniform(*bounds) for joint in JOINTS for name, bounds in RANGES.items()}
    for joint in JOINTS:
        coulomb = values[f"stribeck_friction.coulomb@{joint}"]
        values[f"stribeck_friction.static@{joint}"] = coulomb * rng.uniform(1.1, 1.8)
    return {**values, "command_delay.delay@*": rng.uniform(*DELAY_S)}


def real(text, values):
    """The robot in MuJoCo with the values, and the effects beside it."""
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep = PLANT_STEP_S
    joints = {}
    for joint in JOINTS:
        of = {name.partition(".")[2]: values[f"{name}@{joint}"] for name in [*RANGES, "stribeck_friction.static"]}
        dof = model.joint(joint).dofadr[0]
        model.dof_armature[dof], model.dof_damping[dof] = of["inertia"], of["coefficient"]
        model.dof_frictionloss[dof] = of["coulomb"]
        friction = {"coulomb": of["coulomb"], "static": of["static"], "velocity": STRIBECK_RAD_S}
        joints[joint] = [
            {"effect": "command_delay", "delay": values["command_delay.delay@*"]},
            {"effect": "stribeck_friction", **friction},
            {"effect": "encoder_offset", "offset": of["offset"]},
        ]
    return model, {"joints": joints}


def chirps(rng, seconds):
    """Commands of all joints on the clock of the log: sweeps from 0.1 to 4 Hz that begin gently, no two alike."""
    t = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    gentle = np.minimum(t / 2.0, 1.0)[:, None]
    low, high = rng.uniform(0.08, 0.15, 12), rng.uniform(2.5, 4.5, 12)
    grows = np.log(high / low) / seconds
    turns = low * (np.exp(grows * t[:, None]) - 1.0) / grows
    size = np.tile([0.25, 0.45, 0.5], 4) * rng.uniform(0.8, 1.2, 12)
    return t, gentle * size * np.sin(2 * np.pi * turns + rng.uniform(0, 6.3, 12))


def replayed(model, effects, commands):
    """What the encoders read at the times of the commands."""
    data = mujoco.MjData(model)
    stepper = btr.mujoco.EffectStepper(model, effects or {"joints": {}})
    places = np.array([model.joint(joint).qposadr[0] for joint in JOINTS])
    data.qpos[places] = commands[0]
    read = np.empty_like(commands)
    for row, command in zip(read, commands):
        readings = stepper.readings(data)
        row[:] = [readings.get(joint, data.qpos[place]) for joint, place in zip(JOINTS, places)]
        data.ctrl[:] = command
        for _ in range(round(1 / RATE_HZ / model.opt.timestep)):
            stepper.step(data)
    return read


def logged(model, effects, rng, seconds):
    t, commands = chirps(rng, seconds)
    read = replayed(model, effects, commands) + rng.normal(0, NOISE_RAD, commands.shape)
    columns = {f"cmd_{j}": commands[:, k] for k, j in enumerate(JOINTS)}
    return btr.Log(t, columns | {f"q_{j}": read[:, k] for k, j in enumerate(JOINTS)}), commands, read


def case(seed, folder, seconds):
    rng = np.random.default_rng(seed)
    text = mjcf()
    (folder / "robot.xml").write_text(text)
    values = planted(rng)
    plant, beside = real(text, values)
    learn, _, _ = logged(plant, beside, rng, seconds)
    held_out, commands, read = logged(plant, beside, rng, seconds)
    model = btr.Model.from_mujoco(folder / "robot.xml")
    known = [parameter.name for parameter in model.parameters]
    effects = ["armature", "viscous_friction", "stribeck_friction", "encoder_offset", "command_delay@*"]
    model = model.add(*effects).at({f"stribeck_friction.velocity@{joint}": STRIBECK_RAD_S for joint in JOINTS})
    (folder / "model.toml").write_text(model.text)
    fitted = btr.fit(model, [learn], held_out=[held_out], freeze=[*known, "stribeck_friction.velocity@*"])
    found = {parameter.name: parameter for parameter in fitted.parameters}
    within = sum(p.ci95 is not None and p.ci95[0] <= values[name] <= p.ci95[1] for name, p in found.items())
    kinds = {}
    for name, parameter in found.items():
        off = parameter.value - values[name]
        relative = off if "offset" in name else off / values[name]
        kinds.setdefault(name.partition("@")[0], []).append(abs(relative))
    exported = fitted.model.export("mujoco", folder / "robot.xml")
    exported.save(folder / "fitted.xml")
    again = replayed(mujoco.MjModel.from_xml_path(str(folder / "fitted.xml")), exported.effects, commands)
    error = float(np.sqrt(np.mean((again - read) ** 2))) / NOISE_RAD
    worst = ", ".join(f"{kind.partition('.')[2]} {max(off):.4f}" for kind, off in kinds.items())
    print(
        f"{seed:4}  {within} of {len(found)} within; off by at most {worst}; {fitted.train:.3f} learnt, "
        f"{fitted.held_out:.3f} held out, exported {error:.3f}; {fitted.rollouts} rollouts, {fitted.seconds:.1f} s"
        + (f"; {fitted.withheld}" if fitted.withheld else ""),
        flush=True,
    )
    return within / len(found)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1..5", help="A..B, both included")
    parser.add_argument("--seconds", type=float, default=60.0, help="length of each log")
    parser.add_argument("--keep", type=Path, help="folder for the files of the last seed")
    arguments = parser.parse_args()
    first, last = map(int, arguments.seeds.split(".."))
    shares = []
    for seed in range(first, last + 1):
        with tempfile.TemporaryDirectory() as folder:
            shares.append(case(seed, arguments.keep or Path(folder), arguments.seconds))
    print(f"values within their intervals: {np.mean(shares):.3f}")


if __name__ == "__main__":
    main()
