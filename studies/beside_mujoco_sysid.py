#!/usr/bin/env python3
"""btr and mujoco.sysid on the same logs: an arm with dry friction on one joint, which the model lacks.

    cargo build --release && python3 -m venv venv && venv/bin/pip install 'mujoco[sysid]'
    venv/bin/python studies/beside_mujoco_sysid.py [--frictions 0.2,0.5,1.0] [--seed 1000]

Reality is the arm of `robots/arm5.toml` in MuJoCo, with other rotor inertias and dampings, noisy encoders, and a
frictionloss on its shoulder. mujoco.sysid fits the free parameters (five armatures, five dampings) with MuJoCo itself:
it has reality's integrator, time step and initial states. With `--by-hand` it also fits a frictionloss to one joint
after the other, and the best of five is taken. btr gets the model file and the logs: `fit`, then `compare` of the
fitted model, and `diagnose` and `fit --add` from the original model file. Intervals are 95 % intervals of parameters.
Takes two to four minutes per friction on two cores, and several more with `--by-hand`. """

import argparse
import contextlib
import csv
import io
import tempfile
import time
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import mujoco
import numpy as np
from hidden_in_mujoco import CLOCK, HARD, HELD_OUT, LEARN, ROOT, SETTLE_S, TICK_S, ask
from mujoco import sysid
from mujoco.sysid.report.sections.insights import AutomatedInsights

MODEL = ROOT / "robots" / "arm5.toml"
# Runge-Kutta at this step is far more accurate than the encoders; MuJoCo's other integrators are of first order.
STEP_S = 0.002
STEPS_PER_TICK = round(TICK_S / STEP_S)
SITE = "shoulder"


@dataclass
class Row:
    """A line of the table."""

    tool: str
    says: str
    estimate: float | None
    seconds: float

    def line(self, friction: float) -> str:
        error = "" if self.estimate is None else f"{100 * (self.estimate / friction - 1):+.2f}"
        estimate = "" if self.estimate is None else f"{self.estimate:.4f}"
        return f"{friction:8.1f}  {self.tool:<33}{self.says:<75}{estimate:>8}{error:>9}{self.seconds:8.1f}"


@dataclass
class Doubts:
    """Rotor inertias and dampings by joint."""

    armature: dict[str, float]
    damping: dict[str, float]


class Arm:
    """The five-joint arm of the model files."""

    def __init__(self) -> None:
        self.toml = tomllib.loads(MODEL.read_text())
        self.robot = ET.parse(MODEL.parent / self.toml["robot"]["urdf"]).getroot()
        self.joints = [joint.get("name") for joint in self.robot.findall("joint")]

    def bounds(self, quantity: str, joint: str) -> tuple[float, float]:
        name = {"armature": "armature.inertia", "damping": "viscous_friction.coefficient"}[quantity]
        return tuple(self.toml["parameters"][f"{name}@{joint}"]["bounds"])

    def nominal(self) -> Doubts:
        """The geometric middle of all bounds, which span a factor of four."""
        middle = lambda quantity: {joint: 2.0 * self.bounds(quantity, joint)[0] for joint in self.joints}  # noqa: E731
        return Doubts(middle("armature"), middle("damping"))

    def spec(self, doubts: Doubts, friction: float = 0.0) -> mujoco.MjSpec:
        """The arm for MuJoCo, with this dry friction on one joint."""
        root = ET.Element("mujoco", model="arm5")
        ET.SubElement(root, "compiler", angle="radian")
        ET.SubElement(root, "option", timestep=str(STEP_S), integrator="RK4")
        body = ET.SubElement(root, "worldbody")
        actuators, sensors = ET.SubElement(root, "actuator"), ET.SubElement(root, "sensor")
        links = {link.get("name"): link.find("inertial") for link in self.robot.findall("link")}
        hard = {"solreffriction": HARD["solref"], "solimpfriction": HARD["solimp"]}
        for joint in self.robot.findall("joint"):
            name, inertial = joint.get("name"), links[joint.find("child").get("link")]
            body = ET.SubElement(body, "body", pos=joint.find("origin").get("xyz"))
            moments = " ".join(inertial.find("inertia").get(axis) for axis in ("ixx", "iyy", "izz"))
            ET.SubElement(body, "inertial", pos=inertial.find("origin").get("xyz"),
                          mass=inertial.find("mass").get("value"), diaginertia=moments)  # fmt: skip
            ET.SubElement(body, "joint", name=name, type="hinge", axis=joint.find("axis").get("xyz"),
                          armature=str(doubts.armature[name]), damping=str(doubts.damping[name]),
                          frictionloss=str(friction if name == SITE else 0.0), **hard)  # fmt: skip
            servo = self.toml["actuators"][name]
            ET.SubElement(actuators, "position", name=name, joint=name, kp=str(servo["kp"]), kv=str(servo["kd"]))
            ET.SubElement(sensors, "jointpos", name=f"q_{name}", joint=name)
        return mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))


@dataclass
class Episode:
    """Commands and readings of the arm, and its state at the start of the log."""

    commands: np.ndarray
    readings: np.ndarray
    start: np.ndarray


def record(arm: Arm, friction: float, rng: np.random.Generator) -> tuple[Doubts, list[Episode]]:
    """Reality's episodes, training episodes first."""
    off = lambda values: {joint: value * rng.uniform(0.75, 1.5) for joint, value in values.items()}  # noqa: E731
    truth = Doubts(off(arm.nominal().armature), off(arm.nominal().damping))
    model = arm.spec(truth, friction).compile()
    noise = arm.toml["noise"]
    episodes = []
    for kind in LEARN + HELD_OUT:
        commands = np.stack([kind(rng) for _ in arm.joints], axis=1)
        start, angles = simulate(model, commands)
        noisy = angles + noise["position_rad"] * rng.standard_normal(angles.shape)
        quantum = noise["position_quantum_rad"]
        episodes.append(Episode(commands, quantum * np.round(noisy / quantum), start))
    return truth, episodes


def simulate(model: mujoco.MjModel, commands: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The state after the arm has held its first command for a while, and the angles at every later tick."""
    data = mujoco.MjData(model)
    data.qpos[:], data.ctrl[:] = commands[0], commands[0]
    mujoco.mj_step(model, data, round(SETTLE_S / STEP_S))
    start, angles = sysid.create_initial_state(model, data.qpos, data.qvel, data.act), []
    for command in commands:
        angles.append(data.qpos.copy())
        data.ctrl[:] = command
        mujoco.mj_step(model, data, STEPS_PER_TICK)
    return start, np.array(angles)


def write(arm: Arm, episodes: list[Episode], folder: Path) -> None:
    """The episodes as btr reads them."""
    for number, episode in enumerate(episodes):
        kind = "learn" if number < len(LEARN) else "held"
        with open(folder / f"{kind}{number}.csv", "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["t", *(f"cmd_{joint}" for joint in arm.joints), *(f"q_{joint}" for joint in arm.joints)])
            for t, told, said in zip(CLOCK, episode.commands, episode.readings):
                writer.writerow([f"{t:.2f}", *(f"{x:.6f}" for x in told), *(f"{x:.8f}" for x in said)])


# ---------------------------------------------------------------- mujoco.sysid


def sequences(arm: Arm, spec: mujoco.MjSpec, episodes: list[Episode]) -> sysid.ModelSequences:
    model = spec.compile()
    held = [np.repeat(episode.commands, STEPS_PER_TICK, axis=0)[: 1 - STEPS_PER_TICK] for episode in episodes]
    fine = np.arange(len(held[0])) * STEP_S
    controls = [sysid.TimeSeries(fine, told) for told in held]
    # In a rollout MuJoCo's sensors lag its state by one step, which would look like damping; so states are compared.
    signals = [(f"{joint}_qpos", sysid.SignalType.MjStateQPos) for joint in arm.joints]
    measured = [sysid.TimeSeries.from_names(CLOCK, episode.readings, model, signals) for episode in episodes]
    names = [f"episode {number}" for number in range(len(episodes))]
    return sysid.ModelSequences("arm5", spec, names, [episode.start for episode in episodes], controls, measured)


def parameters(arm: Arm, rubbing: str | None) -> sysid.ParameterDict:
    """The free parameters, and optionally the dry friction of one joint."""

    def damp(spec: mujoco.MjSpec, parameter: sysid.Parameter, joint: str) -> None:
        spec.joint(joint).damping[0] = parameter.value[0]

    def set_plain(attribute: str, joint: str):
        return lambda spec, parameter: setattr(spec.joint(joint), attribute, parameter.value[0])

    params, nominal = sysid.ParameterDict(), arm.nominal()
    for joint in arm.joints:
        least, most = arm.bounds("armature", joint)
        modifier = set_plain("armature", joint)
        params.add(sysid.Parameter(f"armature@{joint}", nominal.armature[joint], least, most, modifier=modifier))
    for joint in arm.joints:
        least, most = arm.bounds("damping", joint)
        modifier = lambda spec, parameter, joint=joint: damp(spec, parameter, joint)  # noqa: E731
        params.add(sysid.Parameter(f"damping@{joint}", nominal.damping[joint], least, most, modifier=modifier))
    if rubbing:
        modifier = set_plain("frictionloss", rubbing)
        params.add(sysid.Parameter(f"frictionloss@{rubbing}", 0.1, 0.0, 5.0, modifier=modifier))
    return params


@dataclass
class Fitted:
    values: np.ndarray
    half_widths: np.ndarray
    cost: float
    insights: list[str]


def fit(arm: Arm, measured: sysid.ModelSequences, rubbing: str | None = None) -> Fitted:
    """Results of mujoco.sysid on the logs."""
    residual = sysid.build_residual_fn(models_sequences=[measured])
    with contextlib.redirect_stdout(io.StringIO()):
        params, result = sysid.optimize(
            initial_params=parameters(arm, rubbing),
            residual_fn=residual,
            optimizer="mujoco",
            verbose=False,
            max_iters=20,
        )
    values = params.as_vector().copy()
    left = residual(values, params)[0]
    _, half_widths = sysid.calculate_intervals(left, result.jac)
    insights = AutomatedInsights("insights", params).get_context()["insights"]
    cost = sum(float(np.sum(part**2)) for part in left)
    return Fitted(values, half_widths, cost, [insight["title"] for insight in insights])


def with_sysid(arm: Arm, truth: Doubts, episodes: list[Episode]) -> Iterator[Row]:
    measured = sequences(arm, arm.spec(arm.nominal()), episodes[: len(LEARN)])
    begin = time.monotonic()
    plain = fit(arm, measured)
    seconds = time.monotonic() - begin
    wanted = np.array([*truth.armature.values(), *truth.damping.values()])
    misses = np.abs(plain.values - wanted) / plain.half_widths
    says = (
        f"{', '.join(sorted(set(plain.insights)))}; {sum(misses <= 1)}/10 intervals hold, worst miss {max(misses):.0f}x"
    )
    yield Row("mujoco.sysid", says, None, seconds)


def by_hand(arm: Arm, truth: Doubts, episodes: list[Episode]) -> Iterator[Row]:
    """A frictionloss on one joint after the other; the fit with the least error is taken."""
    measured = sequences(arm, arm.spec(arm.nominal()), episodes[: len(LEARN)])
    wanted = np.array([*truth.armature.values(), *truth.damping.values()])
    begin = time.monotonic()
    tried = {joint: fit(arm, measured, joint) for joint in arm.joints}
    best = min(tried, key=lambda joint: tried[joint].cost)
    misses = np.abs(tried[best].values[:10] - wanted) / tried[best].half_widths[:10]
    says = f"best on {best}; {sum(misses <= 1)}/10 intervals hold, worst miss {max(misses):.0f}x"
    yield Row("  frictionloss tried by hand", says, tried[best].values[-1], time.monotonic() - begin)


# ---------------------------------------------------------------- btr


def with_btr(btr: str, folder: Path) -> Iterator[Row]:
    learn, held = (sorted(map(str, folder.glob(f"{kind}*.csv"))) for kind in ("learn", "held"))
    judged = ["--held-out", *held]
    plain = str(folder / "plain.toml")
    begin = time.monotonic()
    said = ask(btr, "fit", str(MODEL), *learn, *judged, "-o", plain)
    yield Row("btr fit", f"{said['stop_reason']}; held-out {ladder(said)}", None, time.monotonic() - begin)
    begin = time.monotonic()
    said = ask(btr, "compare", plain, *learn)
    worst = max(said["channels"], key=lambda channel: channel["chi"])
    failure = said["failures"][0]
    says = f"{worst['name']} {worst['chi']:.1f} sigma; {failure['hint'].split(' (')[0]}"
    yield Row("btr compare, fitted model", says, None, time.monotonic() - begin)
    begin = time.monotonic()
    said = ask(btr, "diagnose", str(MODEL), *learn, *judged)
    seconds = time.monotonic() - begin
    found = [f"{effect['effect']}@{effect['site']}" for effect in said["effects"]]
    says = f"{said['verdict']}: {' + '.join(found)}; held-out {ladder(said)}"
    yield Row("btr diagnose", says, friction_in(said["effects"]), seconds)
    begin = time.monotonic()
    said = ask(btr, "fit", str(MODEL), *learn, *judged, "--add", f"coulomb_friction@{SITE}",
               "-o", str(folder / "fitted.toml"))  # fmt: skip
    says = f"{said['stop_reason']}; held-out {ladder(said)}"
    yield Row("btr fit --add coulomb_friction", says, friction_in([said]), time.monotonic() - begin)


def ladder(said: dict) -> str:
    errors = [step["held_out"] for step in said["error_ladder"]]
    return f"{errors[0]:.1f} -> {errors[-1]:.2f} sigma"


def friction_in(lists: list[dict]) -> float | None:
    """The estimate of the shoulder's dry friction, if any."""
    for parameter in (parameter for entry in lists for parameter in entry["parameters"]):
        if parameter["name"] == f"coulomb_friction.torque@{SITE}":
            return parameter["value"]
    return None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--btr", default=str(ROOT / "target" / "release" / "btr"))
    parser.add_argument("--frictions", default="0.2,0.5,1.0", help="N·m")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--by-hand", action="store_true", help="try a frictionloss joint by joint with mujoco.sysid")
    parser.add_argument("--keep", type=Path, help="where to keep the logs, a folder per friction")
    args = parser.parse_args()
    arm = Arm()
    print(f"{'N·m':>8}  {'tool':<33}{'what it reports':<75}{'N·m':>8}{'error %':>9}{'s':>8}")
    for friction in map(float, args.frictions.split(",")):
        truth, episodes = record(arm, friction, np.random.default_rng(args.seed))
        with tempfile.TemporaryDirectory() as temporary:
            folder = args.keep / f"friction-{friction:g}" if args.keep else Path(temporary)
            folder.mkdir(parents=True, exist_ok=True)
            write(arm, episodes, folder)
            tried = by_hand(arm, truth, episodes) if args.by_hand else ()
            for row in chain(with_sysid(arm, truth, episodes), tried, with_btr(args.btr, folder)):
                print(row.line(friction), flush=True)


if __name__ == "__main__":
    main()
