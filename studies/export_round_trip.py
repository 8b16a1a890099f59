#!/usr/bin/env python3
"""From MuJoCo to btr and back: does an exported model replay held-out logs in MuJoCo as well as btr said it would?

    cargo build --release && maturin develop --release && python3 studies/export_round_trip.py [--seeds 1..20] [--each]

Needs btr, NumPy and MuJoCo (`pip install 'btr[mujoco]'`). Reality is the desk arm of `robots/arm.urdf` in MuJoCo, with
position servos, one or two effects drawn from the seed, masses off by up to 10 %, and encoders' noise of 0.5 mrad. btr
sees the nominal model and two logs, with one held out; what `diagnose` finds is fitted and exported into the nominal
MJCF file, and that is replayed in MuJoCo. A line per seed: what was planted, what was found, and the held-out error in
noise floors of the nominal file, of btr's fitted model, and of the exported file in MuJoCo, with the effects that MJCF
lacks and without them. With `--each`, every effect that an export carries or applies is planted once, alone.

Reality and replay are integrated by RK4 in steps of 0.5 ms. With `implicitfast` in such steps MuJoCo and btr differ by
half a milliradian, which is then part of the error.
"""

import argparse
import tempfile
from pathlib import Path

import btr
import mujoco
import numpy as np

ROBOTS = Path(__file__).resolve().parent.parent / "robots"
JOINTS = ["yaw", "shoulder", "elbow"]
GAINS = {"yaw": (20.0, 0.5), "shoulder": (25.0, 0.6), "elbow": (12.0, 0.25)}
STEP_S, RATE_HZ, SECONDS = 0.0005, 100, 10.0
NOISE_RAD = 0.0005
# Effects and the ranges of their values; each at one joint.
EFFECTS = {
    "viscous_friction": {"coefficient": (0.1, 0.5)},
    "coulomb_friction": {"torque": (0.1, 0.4)},
    "armature": {"inertia": (0.01, 0.05)},
    "parallel_spring": {"stiffness": (0.5, 2.0), "rest": (-0.3, 0.3)},
    "command_delay": {"delay": (0.01, 0.04)},
    "motor_lag": {"time_constant": (0.02, 0.06)},
    "command_rate_limit": {"rate": (0.8, 2.0)},
    "load_dependent_friction": {"ratio": (0.1, 0.3)},
    "cogging": {"amplitude": (0.1, 0.4), "order": (6.0, 20.0), "phase": (-3.0, 3.0)},
    "quadratic_drag": {"coefficient": (0.1, 0.5)},
}
# Those that are planted with `--each` alone.
FURTHER = {
    "stribeck_friction": {"coulomb": (0.1, 0.3), "static": (0.4, 0.6), "velocity": (0.05, 0.3)},
    "asymmetric_friction": {
        "coulomb_forward": (0.1, 0.2),
        "coulomb_backward": (0.3, 0.4),
        "viscous_forward": (0.0, 0.1),
        "viscous_backward": (0.1, 0.3),
    },
    "command_deadband": {"band": (0.01, 0.03)},
    "command_offset": {"offset": (0.02, 0.05)},
    "command_resolution": {"step": (0.01, 0.03)},
    "command_hysteresis": {"band": (0.01, 0.03)},
    "encoder_offset": {"offset": (0.02, 0.05)},
    "encoder_delay": {"delay": (0.01, 0.03)},
    "backlash": {"gap": (0.02, 0.06)},
    "joint_elasticity": {"stiffness": (40.0, 120.0), "damping": (0.01, 0.05)},
}
# What MuJoCo has attributes for.
ATTRIBUTES = {
    "viscous_friction": "dof_damping",
    "coulomb_friction": "dof_frictionloss",
    "armature": "dof_armature",
}


def nominal():
    """The arm's MJCF with its servos."""
    spec = mujoco.MjSpec.from_file(str(ROBOTS / "arm.urdf"))
    for joint, (kp, kd) in GAINS.items():
        servo = spec.add_actuator(name=f"{joint}_servo", target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=kp, kv=kd)
    spec.option.timestep = STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.compile()
    return spec.to_xml()


def planted(rng, text, effects=None):
    """The real arm, and the effects beside it: these, or one or two that are drawn."""
    real = mujoco.MjModel.from_xml_string(text)
    factors = rng.uniform(0.9, 1.1, real.nbody)
    real.body_mass[:] *= factors
    real.body_inertia[:] *= factors[:, None]
    beside, said = {"joints": {}}, []
    for effect in effects or rng.choice(list(EFFECTS), size=rng.integers(1, 3), replace=False):
        joint = str(rng.choice(JOINTS))
        ranges = {**EFFECTS, **FURTHER}[effect]
        values = {name: float(rng.uniform(*bounds)) for name, bounds in ranges.items()}
        said.append(f"{effect}@{joint}")
        dof = real.joint(joint).dofadr[0]
        if effect in ATTRIBUTES:
            getattr(real, ATTRIBUTES[effect])[dof] += next(iter(values.values()))
        elif effect == "parallel_spring":
            real.jnt_stiffness[real.joint(joint).id] = values["stiffness"]
            real.qpos_spring[real.joint(joint).qposadr[0]] = values["rest"]
        else:
            beside["joints"].setdefault(joint, []).append({"effect": str(effect), **values})
    mujoco.mj_setConst(real, mujoco.MjData(real))
    return real, beside, said


def motion(rng):
    """Commands of all joints: sums of sines, on the clock of the logs."""
    t = np.arange(int(SECONDS * RATE_HZ)) / RATE_HZ
    waves = [(rng.uniform(0.1, 0.4), rng.uniform(0.5, 8.0), rng.uniform(0, 6.3)) for _ in range(4 * len(JOINTS))]
    of_joint = [sum(a * np.sin(w * t + p) - a * np.sin(p) for a, w, p in waves[k::3]) for k in range(len(JOINTS))]
    return t, np.stack(of_joint, axis=1)


def replayed(model, effects, t, commands, start):
    """The joints' positions at the times of the commands, as their encoders read them."""
    data = mujoco.MjData(model)
    stepper = btr.mujoco.EffectStepper(model, effects or {"joints": {}})
    places = [model.joint(joint).qposadr[0] for joint in JOINTS]
    data.qpos[places] = start
    positions = []
    for command in commands:
        read = stepper.readings(data)
        positions.append([read.get(joint, data.qpos[place]) for joint, place in zip(JOINTS, places)])
        data.ctrl[:] = command
        for _ in range(round(1 / RATE_HZ / STEP_S)):
            stepper.step(data)
    return np.array(positions)


def recorded(rng, real, beside):
    """Three logs of the real arm."""
    logs = []
    for _ in range(3):
        t, commands = motion(rng)
        positions = replayed(real, beside, t, commands, commands[0]) + rng.normal(0, NOISE_RAD, (len(t), 3))
        columns = {f"cmd_{j}": commands[:, k] for k, j in enumerate(JOINTS)}
        columns |= {f"q_{j}": positions[:, k] for k, j in enumerate(JOINTS)}
        logs.append(btr.Log(t, columns))
    return logs


def identified(learn, held_out):
    """What the nominal model lacks, and a fit with it that begins at what was found."""
    stated = (ROBOTS / "arm.toml").read_text().replace("position_quantum_rad = 0.0017453", "")
    model = btr.Model(stated, ROBOTS / "arm.toml")
    answer = btr.diagnose(model, learn, held_out=[held_out])
    return answer, btr.fit(model, learn, held_out=[held_out], add=answer.names)


def case(seed, folder, effects=None):
    rng = np.random.default_rng(seed)
    text = nominal()
    (folder / "robot.xml").write_text(text)
    real, beside, said = planted(rng, text, effects)
    *learn, held_out = recorded(rng, real, beside)
    answer, fitted = identified(learn, held_out)
    exported = fitted.model.export("mujoco", folder / "robot.xml")
    exported.save(folder / "fitted.xml")

    def error(name, effects):
        of = mujoco.MjModel.from_xml_path(str(folder / name))
        measured = np.stack([held_out[f"q_{j}"] for j in JOINTS], axis=1)
        commands = np.stack([held_out[f"cmd_{j}"] for j in JOINTS], axis=1)
        moved = replayed(of, effects, held_out.clock_s, commands, commands[0])
        return float(np.sqrt(np.mean((moved - measured) ** 2))) / NOISE_RAD

    names = ", ".join(answer.names) or "nothing"
    with_them, without = error("fitted.xml", exported.effects), error("fitted.xml", None)
    print(
        f"{seed:4}  planted {', '.join(said)}; {answer.verdict}: {names}; nominal {error('robot.xml', None):.1f}, "
        f"btr {fitted.held_out:.3f}, exported {with_them:.3f}, without its effects {without:.1f}",
        flush=True,
    )
    return with_them / fitted.held_out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1..20", help="A..B, both included")
    parser.add_argument("--each", action="store_true", help="plant every effect once, alone, from the first seed on")
    arguments = parser.parse_args()
    first, last = map(int, arguments.seeds.split(".."))
    cases = [(seed, None) for seed in range(first, last + 1)]
    if arguments.each:
        cases = [(first + k, [effect]) for k, effect in enumerate([*EFFECTS, *FURTHER])]
    ratios = []
    for seed, effects in cases:
        with tempfile.TemporaryDirectory() as folder:
            ratios.append(case(seed, Path(folder), effects))
    within = sum(abs(ratio - 1) <= 0.05 for ratio in ratios)
    print(f"exported within 5 % of btr's own error: {within} of {len(ratios)}; median {np.median(ratios):.3f}")


if __name__ == "__main__":
    main()
