"""The texts of the page, as HTML. Every name is escaped: names of logs, joints and effects come from files."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Union

from btr._studio import failures
from btr._studio.candidates import Candidate
from btr._studio.doubts import Doubts
from btr._studio.scene import BODY, GHOST, STEPS, Colour, colour_of
from btr._studio.server import CLICKED, CLICKS
from btr._tables import cell, probability
from btr.documents import Dimension, NextExperiment, RegimeFailure
from btr.results import CompareResult

Ladder = Sequence[tuple[str, float, Union[float, None]]]

MUTED = "color:#6b7280"
SMALL = f"font-size:12px;line-height:1.45;{MUTED}"
WARNING = "font-size:12px;line-height:1.45;color:#b45309;overflow-wrap:anywhere"
# viser's number beside a slider is too narrow for five digits.
WIDER = "<style>.mantine-NumberInput-root{width:4.2rem!important}</style>"
_MOST_FLOORS = 100.0
BLANK = "blank where it is noise, or less than on average over the joint's motion"
OF_LADDER = (
    "These errors are of the diagnosis or the fit, which estimates where each log begins; those at the top are always "
    "of replays from the first readings."
)


def css(colour: Colour) -> str:
    """A colour in CSS."""
    return f"rgb({colour[0]},{colour[1]},{colour[2]})"


def box(content: str, style: str = "") -> str:
    """A paragraph of the page; its content is HTML."""
    return f'<div style="padding:4px 10px;font-size:13px;line-height:1.45;{style}">{content}</div>'


def _bar(error: float, colour: Colour) -> str:
    """A bar of an error on a logarithmic scale from 0.5 to 100 noise floors, with a mark at 1."""
    share = 100 * _share(error)
    bar = f'<div style="width:{share:.1f}%;height:100%;background:{css(colour)};border-radius:3px"></div>'
    place = f"position:absolute;left:{100 * _share(1.0):.1f}%;top:-2px;bottom:-2px;border-left:2px solid #111827"
    frame = "position:relative;height:10px;background:#e5e7eb;border-radius:3px;margin:2px 0"
    return f'<div style="{frame}">{bar}<div style="{place}"></div></div>'


def _share(error: float) -> float:
    low, high = math.log(0.5), math.log(_MOST_FLOORS)
    return 1.0 if not math.isfinite(error) else min(1.0, max(0.0, (math.log(max(error, 1e-9)) - low) / (high - low)))


def floors(error: Union[float, None]) -> str:
    """An error in noise floors, in few digits."""
    if error is None:
        return "-"
    return "infinite" if not math.isfinite(error) else f"{error:.2f}" if error < 10 else f"{error:.1f}"


def head(
    model: str,
    step: str,
    learn: Union[float, None],
    held_out: Union[float, None],
    *,
    tails: bool = False,
    left_out: Sequence[str] = (),
) -> str:
    """The model, what was added to it, its errors, and why logs are left out; with `tails`, the last 30 % of each log
    are what is held out."""
    title = f'<b style="font-size:15px">{escape(model)}</b> <span style="{MUTED}">{escape(step)}</span>'
    names = ("first 70 %", "last 30 %") if tails else ("training logs", "held-out logs")
    rows = "".join(
        f'<div style="display:flex;align-items:baseline;gap:8px"><span style="width:92px;{MUTED}">{name}</span>'
        f'<b style="font-size:18px;width:72px">{floors(error)}</b>'
        f'<div style="flex:1">{_bar(error, colour_of(error))}</div></div>'
        for name, error in zip(names, (learn, held_out))
        if error is not None
    )
    measure = "error of replays from the first readings, in noise floors; the mark is the noise itself"
    scale = f'<div style="{SMALL};text-align:right">{measure}</div>'
    if tails:
        scale += f'<div style="{SMALL}">No log is named as held out: the last 30 % of each log are held out.</div>'
    beside = "".join(f'<div style="{WARNING}">left out: {escape(reason)}</div>' for reason in left_out)
    errors = rows + scale if rows else f'<div style="{SMALL}">no error in noise floors so far</div>'
    return box(title + errors + beside)


def legend() -> str:
    """What the colours of the robots mean."""
    names = [f"&le;&thinsp;{most:g}" if math.isfinite(most) else "more" for most, _ in STEPS]
    chips = "".join(chip(css(colour), name) for name, (_, colour) in zip(names, STEPS))
    robots = chip(css(BODY), "measured") + chip(css(GHOST), "model")
    return box(f'{robots}<br><span style="{SMALL}">joints, in noise floors now: </span>{chips}', "font-size:12px")


def lines(inks: Mapping[str, str], of: str = "") -> str:
    """What the lines of a plot mean: names with their colours in CSS, behind what they are of."""
    chips = "".join(chip(ink, escape(name)) for name, ink in inks.items())
    return box(f"{escape(of)} {chips}", "font-size:12px;padding-bottom:0")


def chip(colour: str, name: str) -> str:
    """A square of a colour in CSS, and what it means, in HTML."""
    square = f"display:inline-block;width:10px;height:10px;border-radius:2px;background:{colour};margin-right:4px"
    return f'<span style="margin-right:10px;white-space:nowrap"><span style="{square}"></span>{name}</span>'


def ladder(steps: Ladder, status: str) -> str:
    """The error ladder so far, and what is going on."""
    rows = ""
    for name, train, held in steps:
        beside = "" if held is None else f'<span style="{MUTED}"> / {floors(held)} held out</span>'
        error = f"<b>{floors(train)}</b>{beside}{_bar(train, colour_of(train))}"
        rows += f'<div style="margin-top:3px">{escape(name)} {error}</div>'
    of = f'<div style="{SMALL}">{OF_LADDER}</div>' if steps else ""
    return box(f'{rows}{of}<div style="{SMALL}">{escape(status)}</div>')


def stopped(steps: Ladder) -> str:
    """How far work came that was cancelled."""
    return ladder(steps, f"stopped: {'best' if steps else 'nothing'} so far; the model is as it was")


def sentence(comparison: Union[CompareResult, None], covered: str) -> str:
    """What `compare` says first of the logs that it covers, and what it warns of."""
    if comparison is None:
        return box("comparing ...", MUTED)
    first, *others = map(escape, comparison.verdict.sentences[: failures.TOLD])
    warnings = [*comparison.warnings, *(f"no log measures {joint}" for joint in comparison.not_judged)]
    of = f'<span style="{MUTED}">Of {escape(covered)}</span>'
    return box("<br>".join([of, f"<b>{first}</b>", *others])) + "".join(map(note, warnings))


def regimes(
    comparison: Union[CompareResult, None], joints: Sequence[str], covered: str, chosen: Union[int, None] = None
) -> str:
    """The map of joints and regimes of motion, coloured by the error in noise floors, of the logs that it covers; which
    cell is the worst; and where a click on the `chosen` one has gone."""
    worst = None if comparison is None else failures.worst(comparison)
    if comparison is None or worst is None:
        return ""
    found = comparison.failures
    went = "A click shows where it is worst." if chosen is None else _went(found[chosen])
    head = note(f"Joints and regimes of motion, error in noise floors, of {covered}; {BLANK}. {went}")
    return head + _map(found, joints, chosen) + note(_worst(worst, failures.named(comparison)))


def _worst(worst: RegimeFailure, named: Union[failures.Named, None]) -> str:
    """The worst cell, and why the sentence names another one."""
    told = f"Worst in the map: {_told(worst)}, mostly in {worst.log}."
    if named is None:
        return f"{told} The sentence is of the joint's whole motion."
    if named.failure is worst:
        return told
    return f"{told} The sentence names {_told(named.failure)}, as {named.why}."


def _told(failure: RegimeFailure) -> str:
    return f"{failure.joint} {failures.words(failure)} ({floors(failures.chi(failure))})"


def _went(failure: RegimeFailure) -> str:
    begin, end = failure.t0, failure.t1
    return f"Shown: {_told(failure)}; most of that error in {failure.log} is from {begin:.2f} s to {end:.2f} s."


def _map(found: Sequence[RegimeFailure], joints: Sequence[str], chosen: Union[int, None]) -> str:
    number_of = {(failure.joint, failure.regime): number for number, failure in enumerate(found)}
    columns = [joint for joint in joints if any(joint == failure.joint for failure in found)]
    rows = list(dict.fromkeys(failure.regime for failure in found))
    top = "".join(f'<th style="text-align:center;font-weight:600">{escape(joint)}</th>' for joint in columns)
    body = ""
    for regime in rows:
        cells = ""
        for joint in columns:
            number = number_of.get((joint, regime))
            cells += "<td></td>" if number is None else _cell(number, found[number], number == chosen)
        body += f'<tr><td style="white-space:nowrap">{escape(regime.replace("_", " "))}</td>{cells}</tr>'
    style = "border-collapse:separate;border-spacing:2px;font-size:12px"
    table = f'<table style="{style}"><tr><th></th>{top}</tr>{body}</table>'
    return box(f'<div style="overflow-x:auto">{table}</div>')


def _cell(number: int, failure: RegimeFailure, is_chosen: bool) -> str:
    """A number of the map. viser tells no click on HTML: the page asks for an address of the server's own."""
    chi = failures.chi(failure)
    style = f"background:{css(colour_of(chi))};color:#111827;text-align:center;border-radius:3px;padding:1px 8px"
    style += ";outline:2px solid #111827" if is_chosen else ""
    click = f"fetch('{CLICKS}{number}',{{headers:{{'{CLICKED}':'1'}}}})"
    plain = "all:unset;cursor:pointer;display:block;width:100%"
    label = f'title="{escape(failure.hint)}" aria-label="{escape(_told(failure))}"'
    button = f'<button type="button" style="{plain}" {label} onclick="{click}">{floors(chi)}</button>'
    return f'<td style="{style}">{button}</td>'


def card(candidate: Candidate) -> str:
    """A suspect: its law, how it shows, its probability and values, and what it cannot be told from."""
    likely = "" if candidate.probability is None else f"probability {probability(candidate.probability)}"
    tried = "" if candidate.held_out is None else f"held-out error with it {floors(candidate.held_out)}"
    facts = ", ".join(fact for fact in (likely, tried) if fact)
    lines = [
        f"<code>{escape(candidate.law)}</code>" if candidate.law else "",
        f'<span style="{MUTED}">shows as: {escape(candidate.shows)}</span>' if candidate.shows else "",
        *(f"<b>{escape(value)}</b>" for value in candidate.values),
        f"found beside {escape(', '.join(candidate.beside))}: add that first, or all" if candidate.beside else "",
        f"these logs cannot tell it from {escape(_alike(candidate))}" if candidate.alike else "",
        f"explains these logs as well where {escape(candidate.instead)} is frozen" if candidate.instead else "",
        escape(_rest(candidate)),
        escape(facts),
    ]
    return box("<br>".join(line for line in lines if line), "font-size:12px")


def _alike(candidate: Candidate) -> str:
    """What a suspect cannot be told from, with the probabilities that are known."""
    likely = {rival.name: rival.probability for rival in candidate.rivals}
    return ", ".join(
        f"{name} (probability {probability(likely[name])})" if name in likely else name for name in candidate.alike
    )


def _rest(candidate: Candidate) -> str:
    """Who else has a part of a suspect's probability."""
    others = [rival for rival in candidate.rivals if rival.name not in candidate.alike]
    told = [f"{rival.name or 'the model without it'} {probability(rival.probability)}" for rival in others]
    return f"the rest of the probability: {', '.join(told)}" if told else ""


def next_experiment(proposed: NextExperiment) -> str:
    """What to do next, and how far it separates the suspects."""
    rivals = "".join(
        f"<br>{escape(rival.effect)}: {rival.separation:.3g} noise floors apart" for rival in proposed.rivals
    )
    return box(f'{escape(proposed.sentence)}<span style="{MUTED}">{rivals}</span>', "font-size:12px")


def no_experiment(rivals: Sequence[str]) -> str:
    """Why there is nothing to do next that would tell what was found from its rivals."""
    told = f"No motion in the range of these logs separates what was found from {', '.join(rivals)}."
    return box(escape(told), "font-size:12px")


def verdict(finding: str, *, is_current: bool) -> str:
    """What a diagnosis says, of the present model or of an earlier one."""
    first, *others = map(escape, finding.splitlines())
    if is_current:
        evidence = box("<br>".join(others), "font-size:12px;padding-top:0") if others else ""
        return box(first, "font-weight:600") + evidence
    text = "<br>".join([first, *others])
    return box("This diagnosis is about an earlier model: ask again what is missing.") + box(text, SMALL)


def doubts(found: Doubts) -> str:
    """Doubts about the logs, the worst first."""
    lines = "".join(
        f'<div><span style="{MUTED}">{escape(severity)}, {escape(log)}:</span> {escape(sentence)}</div>'
        for severity, log, sentence in found.findings
    )
    listed = f'<div style="max-height:260px;overflow-y:auto">{lines}</div>'
    return box(f'<div style="{SMALL}">{escape(found.of)}</div>{listed}', "font-size:12px") + "".join(
        map(note, found.remedies)
    )


def at_bounds(ended: Sequence[tuple[Dimension, float]]) -> str:
    """Which parameters a fit left at which bound."""
    told = []
    for dim, bound in ended:
        which, unit = "lower" if bound == dim.min else "upper", "" if dim.unit == "1" else f" {dim.unit}"
        # A bound at 0 is mostly one of physics.
        beyond = "" if bound == 0.0 else "; the best value may lie beyond it"
        told.append(f"{dim.name} ended at its {which} bound, {cell(bound)}{unit}{beyond}")
    return "".join(map(note, told))


def note(text: str) -> str:
    """A remark."""
    return box(escape(text).replace("\n", "<br>"), SMALL)


def commands(shell: str, python: str) -> str:
    """The scripts that come to the same."""
    block = "background:#f3f4f6;color:#111827;padding:6px;font-size:11px;overflow-x:auto;white-space:pre"
    return box(
        f'In a shell<pre style="{block}">{escape(shell)}</pre>In Python<pre style="{block}">{escape(python)}</pre>'
    )

