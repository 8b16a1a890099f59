"""A case from its seed: a robot, what its user knows of it, logs, and what is hidden in them."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from . import sizes
from .commands import KINDS, episode
from .plant import APART, ROTOR, Hidden, Numerics, softness
from .robots import Axis, Random, Robot, Told, Vector, between, generate, known_rotors, loads, scaled, sign
from .simulation import Episode, Sensors, record, simulate, true_readings

# One kind for each seed, round and round; see `plan`.
CYCLE = ("one", "one", "none", "one", "constants", "one", "one", "outside", "one", "two")
# From the coarsest on: the first one that is honest is taken. First-order integrators are not among them: at 1 or 2 ms
# MuJoCo's own error is 0.3 to 6 noise floors, which is an effect of its own (`--integrator` shows it).
NUMERICS = tuple(Numerics("RK4", step_s) for step_s in (0.002, 0.001, 0.0005, 0.00025, 0.000125))
CALIBRATION = Numerics("RK4", 0.001)
# Most of its own integration error that an honest simulation makes, in noise floors. An error of 0.1 noise floors in
# each of some thousand readings moves a fitted value by several of its standard errors.
HONEST = 0.02
# The same over whole logs: above it the step is unstable somewhere. And the number of steps that are tried there.
STABLE = 0.2
FINER = 3
# Seconds of an episode that are simulated to choose a size or a step.
EXCERPT_S = 6.0
TICKS_S = (0.002, 0.004, 0.005, 0.01, 0.01, 0.02, 0.02, 0.034, 0.04, 0.056)
QUANTA = (math.tau / 4096, math.tau / 4096, math.radians(0.1), math.tau / 16384, math.tau / 65536, 0.0)


@dataclass
class Case:
    """All that is known of a case; `hidden` is what to find, `stated` which constant the model has wrong."""

    seed: int
    kind: str
    effect: str
    robot: Robot
    told: Told
    tick_s: float
    sensors: Sensors
    logs: list[tuple[str, Episode]]
    held_out: list[tuple[str, Episode]]
    carried: Vector
    hidden: list[Hidden] = field(default_factory=list)
    numerics: Numerics = CALIBRATION
    # MuJoCo's own integration error, in noise floors.
    own_error: float = 0.0
    # Difference that each hidden effect makes in the readings, in noise floors.
    difference: list[float] = field(default_factory=list)
    # The constant that the model has wrong, and the names with which btr would be right about it.
    stated: str = ""
    right: list[str] = field(default_factory=list)
    moving: bool = False

    def describe(self) -> str:
        """What is hidden, with its values."""
        parts = [h.name + " (" + ", ".join(f"{k} {v:.3g}" for k, v in h.values.items()) + ")" for h in self.hidden]
        return " + ".join(parts) or self.stated or "nothing"


def plan(seed: int) -> tuple[str, list[str]]:
    """Kind of a seed's case, and effects to hide; every effect comes equally often."""
    kind = CYCLE[seed % len(CYCLE)]
    turn = seed // len(CYCLE) * CYCLE.count(kind) + CYCLE[: seed % len(CYCLE)].count(kind)
    if kind == "one":
        # A stride without a common divisor: neighbouring seeds have unlike effects.
        return kind, [sizes.EFFECTS[7 * turn % len(sizes.EFFECTS)]]
    if kind == "two":
        rng = np.random.default_rng([seed, 7])
        while True:
            pair = [str(effect) for effect in rng.choice(sizes.EFFECTS, 2, replace=False)]
            if not set(pair) <= sizes.GAINS:
                return kind, pair
    options = {"none": ("none",), "outside": sizes.OUTSIDE, "constants": sizes.CONSTANTS}[kind]
    drawn = options[turn % len(options)]
    return "one" if kind == "outside" and drawn in sizes.KNOWN else kind, [drawn]


def build(seed: int, integrator: str = "", shows: tuple[float, float] | None = None) -> Case:
    """The case of a seed, always the same. An integrator of MuJoCo, if one is named, takes its default step. What is
    hidden shows by as many noise floors as asked for."""
    kind, effects = plan(seed)
    rng, hiding = np.random.default_rng([seed, 1]), np.random.default_rng([seed, 2])
    robot = generate(rng)
    carried, _ = loads(robot, np.random.default_rng([seed, 3]))
    tick_s = float(rng.choice(TICKS_S))
    sensors = sensor(rng, tick_s)
    moving = bool(rng.random() < 0.15)
    logs, held_out = episodes(robot, carried, tick_s, moving, rng)
    told = knowledge(robot, sensors, tick_s, rng)
    case = Case(seed, kind, effects[0], robot, told, tick_s, sensors, logs, held_out, carried, moving=moving)
    if kind == "constants":
        misstate(case, effects[0], hiding)
    elif kind != "none":
        usual = usually(case)
        for number, effect in enumerate(effects):
            hide(case, effect, usual, number, hiding, shows)
        case.hidden.sort(key=lambda h: h.name)
        for h in case.hidden:
            know_rotor_apart(case, h)
        # A rotor that is hidden is none that the model knows.
        case.told.effects = known_rotors(case.robot)
    choices = by_name(integrator, tick_s) if integrator else NUMERICS
    chosen, _ = honest(case, choices, excerpts(case), HONEST)
    # A stiff servo may diverge later on, or in the held-out logs alone.
    finer = choices[choices.index(chosen) :][:FINER]
    case.numerics, case.own_error = honest(case, finer, [log for _, log in case.logs + case.held_out], STABLE)
    return case


def by_name(integrator: str, tick_s: float) -> tuple[Numerics, ...]:
    """An integrator with MuJoCo's default step, or half of it where the log's clock needs that."""
    whole = abs(tick_s / 0.002 - round(tick_s / 0.002)) < 1e-6
    return (Numerics(integrator, 0.002 if whole else 0.001),)


# ---------------------------------------------------------------- what the user has


def sensor(rng: Random, tick_s: float) -> Sensors:
    """Encoders; one in five logs speeds as well."""
    quantum = float(rng.choice(QUANTA))
    noise = max(scaled(rng, 1e-4, 8e-4), 0.0 if quantum > 0 else 2e-4)
    speed_noise = scaled(rng, 0.01, 0.05) if rng.random() < 0.2 else 0.0
    return Sensors(noise, quantum, speed_noise)


Named = list[tuple[str, Episode]]


def episodes(robot: Robot, carried: Vector, tick_s: float, moving: bool, rng: Random) -> tuple[Named, Named]:
    """Two to four logs to learn from and one or two held out: of 5 s or more, 16 to 48 s together."""
    moved = carried + np.array([axis.armature for axis in robot.axes])
    bandwidth = np.sqrt(np.array([axis.kp for axis in robot.axes]) / moved) / math.tau
    fastest = np.minimum(np.minimum(bandwidth, 2.5), 0.12 / tick_s)
    # A slower controller than the log, now and then.
    repeats = round(0.02 / tick_s) if tick_s <= 0.01 and rng.random() < 0.4 else 1
    kinds = [str(kind) for kind in rng.permutation(list(KINDS))]
    count, held = int(rng.integers(2, 5)), int(rng.integers(1, 3))
    seconds = max(5.0, scaled(rng, 16.0, 48.0) / (count + held))
    before = round(between(rng, 1.0, 2.5) / tick_s) if moving else 0

    def one(kind: str) -> tuple[str, Episode]:
        ticks = round(max(5.0, seconds * scaled(rng, 0.6, 1.7)) / tick_s) + 1 + before
        t = np.arange(0, ticks, repeats) * tick_s
        told = np.repeat(episode(kind, rng, t, robot.middle, fastest), repeats, axis=0)[:ticks]
        return kind, Episode(np.round(told, 6), tick_s, before)

    return [one(kind) for kind in kinds[:count]], [one(kinds[k % count]) for k in range(held)]


def knowledge(robot: Robot, sensors: Sensors, tick_s: float, rng: Random) -> Told:
    """The model: masses and gains up to 15 % off and free within 10 to 20 %, rotors known."""
    told = robot.copy()
    free: dict[str, str] = {}
    knows_masses, knows_damping = rng.random() < 0.2, rng.random() < 0.3
    for axis in told.axes:
        if not knows_masses:
            factor = math.exp(between(rng, -0.14, 0.14))
            axis.mass, axis.inertia = axis.mass * factor, axis.inertia * factor
            free[f"mass@{axis.link}"] = "relative = [0.8, 1.25]"
        axis.kp *= math.exp(between(rng, -0.09, 0.09))
        free[f"kp@{axis.joint}"] = "relative = [0.87, 1.15]"
        if not knows_damping:
            axis.kd *= math.exp(between(rng, -0.14, 0.14))
            free[f"kd@{axis.joint}"] = "relative = [0.8, 1.25]"
    noise = ""
    if rng.random() < 0.5:
        noise = f"[noise]\nposition_rad = {sensors.noise:.6g}\nposition_quantum_rad = {sensors.quantum:.6g}"
        noise += f"\nvelocity_rad_s = {sensors.speed_noise:.6g}" if sensors.speed_noise > 0.0 else ""
    simulation = ""
    if rng.random() < 0.5:
        simulation = f"[simulation]\ncontrol_s = {tick_s:.6g}\nsteps_per_control = {max(1, round(tick_s / 0.002))}"
    return Told(told, free, known_rotors(robot), noise, simulation)


def misstate(case: Case, what: str, rng: Random) -> None:
    """A constant of the model that is wrong and not free; or free, within its bounds."""
    told, k = case.told, int(rng.integers(len(case.robot.axes)))
    axis, true = told.robot.axes[k], case.robot.axes[k]
    case.stated = what
    match what:
        case "armature_stated" | "armature_free":
            if true.armature <= 0.0:
                true.armature = case.carried[k] * between(rng, 0.2, 1.0)
            axis.armature = true.armature / scaled(rng, 0.3, 3.0)
            told.effects = known_rotors(told.robot, without=axis.joint)
            if what == "armature_free":
                bounds = f"bounds = [0.0, {4.0 * axis.armature:.6g}], value = {axis.armature:.6g}"
                told.free[f"armature.inertia@{axis.joint}"] = bounds
            else:
                told.effects = known_rotors(told.robot)
            case.stated += f": {axis.joint} has {true.armature:.3g}, the model {axis.armature:.3g} kg m²"
        case "mass_stated" | "mass_free":
            factor = math.exp(sign(rng) * between(rng, 0.15, 0.4))
            axis.mass, axis.inertia = true.mass * factor, true.inertia * factor
            told.free.pop(f"mass@{axis.link}", None)
            if what == "mass_free":
                told.free[f"mass@{axis.link}"] = "relative = [0.5, 2.0]"
            case.stated += f": {axis.link} has {true.mass:.3g}, the model {axis.mass:.3g} kg"
        case "kp_stated":
            axis.kp = true.kp * math.exp(sign(rng) * between(rng, 0.15, 0.4))
            told.free.pop(f"kp@{axis.joint}", None)
            case.stated += f": {axis.joint} has {true.kp:.3g}, the model {axis.kp:.3g} N m/rad"
        case "kd_stated":
            axis.kd = true.kd * math.exp(sign(rng) * between(rng, 0.3, 0.8))
            told.free.pop(f"kd@{axis.joint}", None)
            case.stated += f": {axis.joint} has {true.kd:.3g}, the model {axis.kd:.3g} N m s/rad"
        case "length_stated":
            k = int(rng.integers(max(1, len(case.robot.axes) - 1)))
            factor = 1.0 + 0.05 * sign(rng)
            told.robot.axes[k + 1].origin = factor * case.robot.axes[k + 1].origin
            axis, true = told.robot.axes[k], case.robot.axes[k]
            case.stated += f": {axis.link} is {factor:.2f} times as long in the model"
        case "com_stated":
            axis.com = true.com * (1.0 + sign(rng) * between(rng, 0.1, 0.3))
            case.stated += f": the centre of mass of {axis.link} is {axis.com - true.com} away in the model"
    below = told.robot.axes[k + 1].joint if k + 1 < len(told.robot.axes) else ""
    case.right = names_of_constant(what, axis, below) + twins_of_constant(what, axis, true)


def names_of_constant(what: str, told: Axis, below: str) -> list[str]:
    """The constant itself, by btr's name; `below` is the joint that the link carries."""
    names = {
        "armature_stated": [f"armature@{told.joint}"],
        "mass_stated": [f"mass@{told.link}"],
        "kp_stated": [f"kp@{told.joint}"],
        "kd_stated": [f"kd@{told.joint}"],
        "length_stated": [f"length@{told.link}", f"origin@{below}"],
    }
    return names.get(what, [])


def twins_of_constant(what: str, told: Axis, true: Axis) -> list[str]:
    """Effects of the library that do what a wrong constant does; none where they would have to be negative."""
    match what:
        case "armature_stated" if true.armature > told.armature:
            return [f"armature@{told.joint}", f"link_inertia@{told.link}"]
        case "mass_stated" if true.mass > told.mass:
            return [f"payload@{told.link}"]
        case "kd_stated" if true.kd > told.kd:
            return [f"viscous_friction@{told.joint}"]
        case "com_stated":
            return [f"com_offset@{told.link}"]
    return []


# ---------------------------------------------------------------- what is hidden


def excerpts(case: Case) -> list[Episode]:
    """Beginnings of the logs that sizes and steps are chosen by."""
    return [log.cut(EXCERPT_S) for _, log in case.logs]


def usually(case: Case) -> sizes.Usual:
    """What the joints do without anything hidden."""
    motions = [simulate(case.robot, [], log, CALIBRATION, case.carried) for log in excerpts(case)]
    torque = np.abs(np.concatenate([motion.torque for motion in motions]))
    speed = np.abs(np.concatenate([motion.dq for motion in motions]))
    energy = (torque * speed).sum(axis=0) * CALIBRATION.step_s / len(motions) + 1e-9
    inertia = case.carried + np.array([axis.armature for axis in case.robot.axes])
    return sizes.Usual(rms(torque), torque.max(axis=0), rms(speed), speed.max(axis=0), energy, inertia)


def rms(values: Vector) -> Vector:
    """Root mean square of each column, never zero."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)) + 1e-9)


def readings(case: Case, hidden: list[Hidden], numerics: Numerics, logs: list[Episode] | None = None) -> list[Vector]:
    """True readings in some logs, or in the excerpts."""
    made = []
    for log in logs or excerpts(case):
        motion = simulate(case.robot, hidden, log, numerics, case.carried)
        made.append(true_readings(case.robot, hidden, log, motion, numerics.step_s)[0])
    return made


def apart(case: Case, one: list[Vector], other: list[Vector]) -> float:
    """Root mean square of a difference of readings, in noise floors."""
    squares = np.concatenate([((a - b) ** 2).ravel() for a, b in zip(one, other)])
    return math.sqrt(float(squares.mean())) / case.sensors.floor


def hide(
    case: Case,
    effect: str,
    usual: sizes.Usual,
    number: int,
    rng: Random,
    shows: tuple[float, float] | None,
) -> None:
    """Hides an effect at a site where it shows, and of a size at which it shows as much as it should."""
    small = rng.random() < 0.35
    target = scaled(rng, *(shows or ((2.0, 5.0) if small else (5.0, 40.0))))
    best: tuple[float, float, Hidden] | None = None
    for _ in range(1 if effect == "armature" else 3):
        where = sizes.site(effect, case.robot, rng)
        if effect == "armature":
            case.robot.axes[case.robot.at(where)].armature = 0.0
        bare = readings(case, [], CALIBRATION)
        law = sizes.values(effect, where, case.robot, usual, rng)
        size = 1.0
        for _ in range(4):
            hidden = Hidden(effect, where, law(size), seed=case.seed + number)
            try:
                difference = apart(case, bare, readings(case, [hidden], CALIBRATION))
            except FloatingPointError:
                size *= 0.3
                continue
            off = abs(math.log(max(difference, 1e-6) / target))
            if best is None or off < best[0]:
                best = off, difference, hidden
            if off < 0.25:
                break
            size = min(12.0, max(0.02, size * min(6.0, max(0.15, target / max(difference, 1e-6)))))
        if best is not None and best[0] < 0.5:
            break
    assert best is not None
    case.difference.append(round(best[1], 2))
    case.hidden.append(best[2])


def know_rotor_apart(case: Case, hidden: Hidden) -> None:
    """Where a rotor is apart from its link, the plant gives it an inertia: the model knows that as well, or two things
    would be hidden."""
    if hidden.effect not in APART or any(h.name == f"armature@{hidden.site}" for h in case.hidden):
        return
    joint = case.robot.at(hidden.site)
    axis = case.robot.axes[joint]
    axis.armature = axis.armature or ROTOR * case.carried[joint]


def honest(case: Case, choices: tuple[Numerics, ...], logs: list[Episode], most: float) -> tuple[Numerics, float]:
    """The first choice whose own error is at most this, in noise floors, else the last; and that error: twice what
    half the step changes, as it is where a law has a kink and the error falls with the step alone."""
    chosen, error = choices[-1], math.inf
    coarse: list[Vector] | None = None
    for numerics in choices:
        steps = case.tick_s / numerics.step_s
        if abs(steps - round(steps)) > 1e-6 or round(steps) < 1:
            continue
        try:
            coarse = coarse or readings(case, case.hidden, numerics, logs)
            fine = readings(case, case.hidden, Numerics(numerics.integrator, 0.5 * numerics.step_s), logs)
        except FloatingPointError:
            coarse = None
            continue
        chosen, error = numerics, 2.0 * apart(case, coarse, fine)
        if error < most:
            break
        coarse = fine
    return chosen, error


# ---------------------------------------------------------------- on disk


@dataclass
class Files:
    """A case on disk. `truth` is btr's model with the true constants and effects, where btr's library has them."""

    model: Path
    truth: Path | None
    learn: list[Path]
    held_out: list[Path]


def write(case: Case, folder: Path) -> Files:
    """Writes the model, the truth and the logs."""
    rng = np.random.default_rng([case.seed, 4])
    model = case.told.write(folder, "model")
    truth = None
    if all(h.effect in sizes.KNOWN and h.effect != "payload_at_end" for h in case.hidden):
        soft = softness(case.robot, case.hidden, case.numerics, case.carried)
        inline = [inline_effect(h) for h in case.hidden + soft]
        rotors = known_rotors(case.robot)
        truth = Told(case.robot, {}, rotors + inline, case.told.noise, case.told.simulation).write(folder, "truth")
    paths: dict[str, list[Path]] = {"learn": [], "held_out": []}
    for part, logs in (("learn", case.logs), ("held_out", case.held_out)):
        for number, (kind, log) in enumerate(logs, 1):
            path = folder / f"{part}_{number}_{kind}.csv"
            motion = simulate(case.robot, case.hidden, log, case.numerics, case.carried)
            true = true_readings(case.robot, case.hidden, log, motion, case.numerics.step_s)
            write_log(path, case, log, record(true, case.sensors, rng))
            paths[part].append(path)
    return Files(model, truth, paths["learn"], paths["held_out"])


def inline_effect(hidden: Hidden) -> str:
    """A hidden effect as btr's model has it."""
    words = [f'effect = "{hidden.effect}"', f'site = "{hidden.site}"']
    return "{ " + ", ".join(words + [f"{key} = {value:.9g}" for key, value in hidden.values.items()]) + " }"


def write_log(path: Path, case: Case, log: Episode, said: tuple[Vector, Vector]) -> None:
    """One log as CSV."""
    speeds = case.sensors.speed_noise > 0.0
    kinds = ["cmd", "q", *(["dq"] if speeds else [])]
    rows = np.concatenate([log.commands[log.before :], said[0], *([said[1]] if speeds else [])], axis=1)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", *(f"{kind}_{joint}" for kind in kinds for joint in case.robot.joints)])
        for t, row in zip(log.clock, rows):
            writer.writerow([f"{t:.6g}", *(f"{x:.7g}" for x in row)])
