"""Asks btr about a case and scores what it says."""

from __future__ import annotations

import json
import math
import resource
import signal
import subprocess
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from .cases import Case, Files
from .plant import softness
from .robots import GRAVITY, MOUNTS, rotation

# An error of the best model without an effect, in noise floors, above which the effect should have been found.
VISIBLE = 1.3
# A probability from which on a wrong name counts as confident.
CONFIDENT = 0.95

# Scores in the order of tables, with their meaning.
SCORES = {
    "exact": "what is hidden, and nothing else",
    "quiet": "nothing is hidden, and nothing was said",
    "alike": "declared or physically the same as what is hidden",
    "admitted": "outside the library, or no name for it, and called unexplained",
    "invisible": "nothing was said, and nothing could be seen",
    "partial": "some of what is hidden, and nothing else; the rest cannot be seen",
    "hedged": "what is hidden, but called unexplained",
    "unexplained": "called unexplained although the library has it",
    "part": "some of what is hidden, and nothing else; the rest can be seen",
    "extra": "what is hidden, and something else",
    "missed": "nothing was said, although it could be seen",
    "wrong": "something that is not there",
    "false alarm": "nothing is hidden, and something was said",
    "timeout": "no answer in time",
    "failed": "btr refused or crashed",
}
ANSWERS = ("effect_missing", "value_wrong")
GOOD = ("exact", "quiet", "alike", "admitted", "invisible", "partial")


@dataclass
class Outcome:
    """All that is kept of a case, for tables and for a developer."""

    seed: int
    kind: str
    effect: str
    hidden: str
    truth: list[str]
    difference: list[float]
    robot: dict[str, Any]
    score: str = "failed"
    # Whether btr fits the logs no better with the truth than with what it named.
    indistinct: bool = False
    confident_and_wrong: bool = False
    verdict: str = ""
    named: list[str] = field(default_factory=list)
    alike: list[str] = field(default_factory=list)
    probabilities: list[float] = field(default_factory=list)
    right: list[bool] = field(default_factory=list)
    before: float = math.nan
    after: float = math.nan
    # Error of btr's model with the true constants and effects: what the best answer could reach.
    true_error: float = math.nan
    # btr's noise floors of the encoders over the true one: their least and their most.
    floors: list[float] = field(default_factory=list)
    ladder: list[dict[str, Any]] = field(default_factory=list)
    intervals: list[dict[str, Any]] = field(default_factory=list)
    at_bound: list[str] = field(default_factory=list)
    residual_law: str = ""
    doubts: list[str] = field(default_factory=list)
    rollouts: int = 0
    # Of the processor, for btr's answer and for the generator.
    seconds: float = math.nan
    prepared_s: float = math.nan
    complaint: str = ""

    def line(self) -> str:
        """The case in one line."""
        said = " + ".join(f"{name} {p:.2f}" for name, p in zip(self.named, self.probabilities)) or self.verdict
        flags = "!" if self.confident_and_wrong else "=" if self.indistinct else " "
        shape = f"{self.robot['joints']} {self.robot['mount'][:4]:<4} {self.robot['clock_hz']:3.0f} Hz"
        return (
            f"{self.score:<11}{flags} {self.seed:>5} {self.kind:<9} {shape} {self.hidden:<70} -> {said:<52} "
            f"[{self.verdict[:7]}] {self.before:6.2f} -> {self.after:5.2f} (truth {self.true_error:5.2f}) "
            f"{self.rollouts:6} rollouts {self.seconds:5.0f} s"
        )


class TooLong(Exception):
    """btr has used up its time."""


class Btr:
    """The command btr. Its time is that of the processor, for all threads, so that a busy machine changes no score."""

    def __init__(self, command: str, threads: int, timeout_s: float):
        self.command, self.threads, self.timeout_s = command, threads, timeout_s

    def ask(self, *words: str) -> dict[str, Any]:
        """The document that a verb prints; raises `TooLong`, or `ValueError` with what btr complains of."""
        line = [self.command, *words, "--json", "-q", "--threads", str(self.threads)]
        most = math.ceil(self.timeout_s)
        limit = lambda: resource.setrlimit(resource.RLIMIT_CPU, (most, most + 1))  # noqa: E731
        done = subprocess.run(line, capture_output=True, text=True, preexec_fn=limit)
        if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
            raise TooLong
        try:
            said = json.loads(done.stdout)
        except json.JSONDecodeError:
            raise ValueError((done.stdout + done.stderr).strip()[:500]) from None
        if not said.get("ok"):
            raise ValueError(done.stdout.strip()[:500])
        return dict(said)


def judge(btr: Btr, case: Case, files: Files, prepared_s: float) -> Outcome:
    """Asks btr and scores the answer."""
    outcome = Outcome(
        seed=case.seed,
        kind=case.kind,
        effect=" + ".join(h.effect for h in case.hidden) or case.effect,
        hidden=case.describe(),
        truth=[h.name for h in case.hidden],
        difference=case.difference,
        robot=facts(case),
        prepared_s=round(prepared_s, 1),
    )
    learn, held_out = (list(map(str, paths)) for paths in (files.learn, files.held_out))
    before = processor_s()
    try:
        said = btr.ask("diagnose", str(files.model), *learn, "--held-out", *held_out)
    except TooLong:
        outcome.score, outcome.seconds = "timeout", btr.timeout_s
        return outcome
    except ValueError as error:
        outcome.complaint = str(error)
        return outcome
    outcome.seconds = round(processor_s() - before, 1)
    read(said, outcome)
    floors = [floor["sigma"] / case.sensors.floor for floor in said["noise_floor"] if floor["channel"].startswith("q_")]
    outcome.floors = [round(min(floors), 2), round(max(floors), 2)]
    true_train = math.nan
    if files.truth:
        true_train = true_error(btr, files.truth, learn)
        outcome.true_error = true_error(btr, files.truth, held_out)
    mark(case, outcome)
    # Half a percent of the error is one percent of its square: less than btr's own criterion asks for.
    last = outcome.ladder[-1]
    as_good = outcome.after < 1.005 * outcome.true_error and last["train"] < 1.005 * true_train
    outcome.indistinct = outcome.score in ("wrong", "extra", "part", "unexplained") and as_good
    return outcome


def processor_s() -> float:
    """Processor time of all btrs that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def facts(case: Case) -> dict[str, Any]:
    """What tables are grouped by, and what a developer wants to know first."""
    return {
        "joints": len(case.robot.axes),
        "mount": case.robot.mount,
        "stiff": case.robot.stiff,
        "rotors": any(axis.armature > 0.0 for axis in case.robot.axes),
        "clock_hz": round(1.0 / case.tick_s, 1),
        "floor_rad": case.sensors.floor,
        "speeds": case.sensors.speed_noise > 0.0,
        "noise_stated": bool(case.told.noise),
        "step_stated": bool(case.told.simulation),
        "free": len(case.told.free),
        "moving_start": case.moving,
        "learn": [f"{kind} {log.clock[-1]:.1f} s" for kind, log in case.logs],
        "held_out": [f"{kind} {log.clock[-1]:.1f} s" for kind, log in case.held_out],
        "integrator": case.numerics.integrator,
        "step_s": case.numerics.step_s,
        "own_error": round(case.own_error, 4),
    }


def true_error(btr: Btr, truth: Path, logs: list[str]) -> float:
    """Error of the true model, over all channels, in noise floors."""
    try:
        said = btr.ask("compare", str(truth), *logs)
    except (ValueError, TooLong):
        return math.nan
    weights = [channel["samples"] for channel in said["channels"]]
    squares = [channel["chi"] ** 2 for channel in said["channels"]]
    return round(math.sqrt(float(np.average(squares, weights=weights))), 4)


def read(said: dict[str, Any], outcome: Outcome) -> None:
    """Takes over what btr says."""
    outcome.verdict = said["verdict"]
    outcome.ladder = said["error_ladder"]
    errors = [math.inf if step["held_out"] is None else step["held_out"] for step in said["error_ladder"]]
    outcome.before, outcome.after = errors[min(1, len(errors) - 1)], errors[-1]
    found = said["effects"] + [{"effect": value["value"], **value} for value in said["wrong_values"]]
    for effect in found:
        sites = effect["site"] if isinstance(effect["site"], list) else [effect["site"]]
        for site in sites:
            outcome.named.append(f"{effect['effect']}@{site}")
            outcome.probabilities.append(effect["probability"])
        # A law and what changes it are declared as one.
        outcome.alike += [name for alike in effect["alike"] for name in alike.split(" + ")]
        outcome.intervals += [{"name": p["name"], "value": p["value"], "ci95": p["ci95"]} for p in effect["parameters"]]
    outcome.at_bound = said["at_bound"]
    law = said.get("residual_law")
    outcome.residual_law = f"{law['law']} on {law['on']} of {law['site']}: {law['explains']:.2f}" if law else ""
    outcome.doubts = [json.dumps(doubt) for doubt in said["doubts"]]
    outcome.rollouts = said["rollouts"]


# ---------------------------------------------------------------- scores


def mark(case: Case, outcome: Outcome) -> None:
    """Scores an answer, its names and its intervals."""
    truth = {name.replace("payload_at_end@", "end_payload@") for name in outcome.truth}
    twins = {name: {name, *exact_twins(case, name)} for name in truth}
    carried = [h.site for h in case.hidden if h.effect == "payload_at_end"]
    for link in carried:
        # The place is part of the truth: a load at the link's end and one at a free place are both that load.
        twins[f"end_payload@{link}"].add(f"tool_load@{link}")
    acceptable = set().union(*twins.values(), case.right)
    # Part of every dry friction and backlash in MuJoCo: right where it is named, and not asked for.
    soft = softness(case.robot, case.hidden, case.numerics, case.carried)
    case = replace(case, hidden=case.hidden + soft)
    creeps = {h.name for h in soft} - truth
    acceptable |= creeps
    alike = ("tool_load", "end_payload", "payload", "com_offset", "link_inertia")
    acceptable |= {f"{name}@{link}" for link in carried for name in alike}
    outcome.right = [name in acceptable for name in outcome.named]
    mark_intervals(case, outcome)
    asked = replace(outcome, named=[name for name in outcome.named if name not in creeps])
    outcome.score = {"none": score_nothing, "outside": score_outside, "constants": score_constant}.get(
        case.kind, score_effects
    )(asked, truth, twins, acceptable)
    declared = bool(truth & set(outcome.alike))
    wrong = [p for p, right in zip(outcome.probabilities, outcome.right) if not right and not declared]
    named_as_answer = outcome.verdict in ANSWERS
    outcome.confident_and_wrong = named_as_answer and outcome.score not in GOOD and max(wrong, default=0.0) >= CONFIDENT


Twins = dict[str, set[str]]


def score_nothing(outcome: Outcome, truth: set[str], twins: Twins, acceptable: set[str]) -> str:
    return "quiet" if outcome.verdict == "nothing_missing" else "false alarm"


def score_outside(outcome: Outcome, truth: set[str], twins: Twins, acceptable: set[str]) -> str:
    match outcome.verdict:
        case "unexplained" | "partly_explained":
            return "admitted"
        case "nothing_missing":
            return "invisible" if outcome.before <= VISIBLE else "missed"
    return "wrong"


def score_constant(outcome: Outcome, truth: set[str], twins: Twins, acceptable: set[str]) -> str:
    """A free constant is right without a name, a fixed one with its name or its twin's, or called unexplained."""
    if not outcome.named and outcome.verdict == "nothing_missing":
        if outcome.effect.endswith("_free"):
            return "exact"
        return "invisible" if outcome.before <= VISIBLE else "missed"
    if outcome.named and set(outcome.named) <= acceptable:
        return "exact" if outcome.verdict in ANSWERS else "hedged"
    if outcome.verdict not in ANSWERS:
        return "unexplained" if acceptable else "admitted"
    return "extra" if acceptable & set(outcome.named) else "wrong"


def score_effects(outcome: Outcome, truth: set[str], twins: Twins, acceptable: set[str]) -> str:
    named = set(outcome.named)
    if not named:
        if outcome.verdict != "nothing_missing":
            return "unexplained"
        return "invisible" if outcome.before <= VISIBLE else "missed"
    if outcome.effect == "payload_at_end" and named <= acceptable:
        return "exact" if outcome.verdict in ANSWERS else "hedged"
    if named == truth:
        return "exact" if outcome.verdict in ANSWERS else "hedged"
    if named < truth:
        return "partial" if outcome.after <= VISIBLE else "part"
    said = named | set(outcome.alike)
    if len(named) <= len(truth) and all(twins[name] & said for name in truth):
        return "alike" if outcome.verdict in ANSWERS else "hedged"
    if outcome.verdict not in ANSWERS:
        return "unexplained"
    return "extra" if truth < named else "wrong"


def exact_twins(case: Case, name: str) -> set[str]:
    """Effects that are physically the same as this one on this robot, whatever it does."""
    first = case.robot.axes[0]
    # Every rotation of the first link is one about its axis, so its inertia is a single number.
    same = [{f"armature@{first.joint}", f"link_inertia@{first.link}", f"inertia@{first.link}"}]
    weight = rotation(MOUNTS[case.robot.mount]).T @ GRAVITY / 9.81
    upright = abs(float((rotation(first.rpy).T @ weight) @ first.axis))
    if upright > 0.999:
        # Weight does not act on the first joint: its link's is not felt, and a payload there is inertia alone.
        same[0] |= {f"payload@{first.link}", f"com_offset@{first.link}", f"mass@{first.link}"}
    elif upright < 0.001:
        # To turn the robot about its first, level axis is to turn gravity.
        same.append({f"encoder_offset@{first.joint}", "gravity_tilt@base"})
    return set().union(*(group for group in same if name in group)) - {name}


def mark_intervals(case: Case, outcome: Outcome) -> None:
    """Adds the truth to the intervals of what was planted, and whether they hold it."""
    planted = {
        f"{'tool_load' if h.effect == 'payload_at_end' else h.effect}.{key}@{h.site}": value
        for h in case.hidden
        for key, value in h.values.items()
    }
    for interval in outcome.intervals:
        if interval["name"] in planted:
            true = interval["true"] = planted[interval["name"]]
            if interval["ci95"] is not None:
                # JSON has no infinity: a limit may have none on one side.
                low, high = interval["ci95"]
                interval["holds"] = bool((low is None or low <= true) and (high is None or true <= high))
