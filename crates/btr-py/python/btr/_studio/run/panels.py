"""The texts of a run's page, as HTML. Every name is escaped: names of experiments and parameters come from files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import Union

from btr._studio.panels import MUTED, SMALL, box, chip, css, note
from btr._studio.run.folder import Distance, Snapshot, Truth, test_name
from btr._studio.run.scene import AFTER, BEFORE
from btr._studio.run.session import Course
from btr._studio.run.strip import colour_of_merit
from btr._studio.scene import BODY
from btr._tables import cell
from btr.documents import Dimension, TestEntry

_INK, _TRUTH = "#7c3aed", "#2ea05a"
_WIDE, _HIGH = 100.0, 24.0
_MOST_TESTS = 12
# Small enough for five columns of numbers in the panel.
_OF_TABLES = "font-size:11px"


def head(name: str, run: Snapshot, age_s: Union[float, None], failed: str) -> str:
    """The run, how far it is, and why its folder cannot be read if it cannot."""
    of = "" if run.planned is None else f" of {run.planned}"
    if run.stop_reason is not None:
        doing = f"stopped: {run.stop_reason.replace('_', ' ')}"
    else:
        since = "" if age_s is None else f"; last step {_ago(age_s)}"
        doing = f"iteration {run.iteration}{of}: {run.activity}{since}"
    lost = f", {run.failed} failed" if run.failed else ""
    count = f"{len(run.tests)} real tests{lost}, {run.simulated} simulated behaviours"
    lines = [
        f'<b style="font-size:15px">{escape(name)}</b>',
        escape(doing),
        f'<span style="{MUTED}">{count}</span>',
        # A run that has ended says it among its conclusions.
        "" if run.cause is None or run.stop_reason is not None else escape(run.cause),
        f'<b style="color:#b91c1c">{escape(failed)}</b>' if failed else "",
    ]
    return box("<br>".join(line for line in lines if line))


def _ago(age_s: float) -> str:
    if age_s < 60.0:
        return f"{age_s:.0f} s ago"
    return f"{age_s / 60:.0f} min ago" if age_s < 5400.0 else f"{age_s / 3600:.0f} h ago"


def conclusions(sentences: Sequence[str]) -> str:
    """What the run comes to."""
    items = "".join(f'<li style="margin-bottom:2px">{escape(sentence)}</li>' for sentence in sentences)
    return box(f'<ul style="margin:0;padding-left:16px;overflow-wrap:anywhere">{items}</ul>', "font-size:12px")


def phi(distance: Union[Distance, None]) -> str:
    """What phi is."""
    by = "" if distance is None else f", by {distance.name} ({distance.compares})"
    what = "phi is the distance between what the robot did and what the simulation does with the same controllers"
    return note(f"{what}{by}, as the mean over real tests. Less is better.")


def iterations(run: Snapshot) -> str:
    """The last iterations: fitness promised and real, phi of the simulation before and of the new one."""
    if not run.iterations:
        return box("no iteration is closed so far", MUTED)
    head = ("iteration", "fitness promised", "fitness real", "phi predicted", "phi")
    rows = [(it.i, it.fitness_sim, it.fitness_real, it.phi_predicted, it.phi) for it in run.iterations[-_MOST_TESTS:]]
    told = note("phi predicted: on the iteration's own tests, before the simulation has learnt from them")
    return box(_table(head, [[cell(value) for value in row] for row in rows]), _OF_TABLES) + told


def tests(entries: Sequence[TestEntry]) -> str:
    """The last real tests: fitness promised and real."""
    rows = []
    for entry in entries[-_MOST_TESTS:]:
        done, failed = entry.verdict.done, entry.verdict.failed
        real = cell(done.fitness) if done is not None else f"failed: {failed.why if failed is not None else ''}"
        rows.append([test_name(entry.trial.number), str(entry.trial.iteration), cell(entry.promised), real])
    told = note("Tests have the numbers of their folders in transfers/, from 0000 on.")
    head = ("", "iteration", "fitness promised", "fitness real")
    return box(_table(head, rows), _OF_TABLES) + told if rows else ""


def controller(name: str, dims: Sequence[Dimension], values: Sequence[float]) -> str:
    """What was tried in a real test: every searched parameter of the controller, and its range."""
    rows = []
    for dim, value in zip(dims, values):
        unit = "" if dim.unit == "1" else f" {dim.unit}"
        rows.append([dim.name, f"{cell(value)}{unit}", f"{cell(dim.min)} .. {cell(dim.max)}"])
    title = f"<b>Controller of {escape(name)}</b>"
    return box(title + _table(("parameter", "value", "range"), rows), _OF_TABLES) if rows else ""


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table whose first column is of names or numbers of lines, and the others of values."""
    bold = f"font-weight:600;vertical-align:bottom;{MUTED}"
    titles = "".join(_cell("th", title, k, bold) for k, title in enumerate(head))
    lines = "".join("<tr>" + "".join(_cell("td", x, k, "") for k, x in enumerate(row)) + "</tr>" for row in rows)
    style = "border-collapse:separate;border-spacing:6px 1px;font-variant-numeric:tabular-nums"
    return f'<div style="overflow-x:auto"><table style="{style}"><tr>{titles}</tr>{lines}</table></div>'


def _cell(kind: str, text: str, column: int, style: str) -> str:
    aligned = "left" if column == 0 else "right"
    return f'<{kind} style="text-align:{aligned};{style}">{escape(text)}</{kind}>'


def parameters(courses: Sequence[Course], truth: Union[Truth, None]) -> str:
    """Every parameter over the iterations, between its bounds, beside its true value if that is known."""
    known = any(course.truth is not None for course in courses)
    inks = chip(_INK, "estimate, with its 95 % interval") + (chip(_TRUTH, "truth, revealed") if known else "")
    hidden = "" if truth is None or not truth.effects else f"hidden effects: {escape(', '.join(truth.effects))}"
    scale = f'<div style="{SMALL}">from bound to bound, over the iterations</div>'
    return box(f"{inks}{scale}" + "".join(map(_course, courses)) + hidden, "font-size:12px")


def _course(course: Course) -> str:
    dim, value, interval = course.dim, course.values[-1], course.intervals[-1]
    unit = "" if dim.unit == "1" else f" {escape(dim.unit)}"
    within = "" if interval is None else f" ({cell(interval[0])} .. {cell(interval[1])})"
    true = "" if course.truth is None else f'; <span style="color:{_TRUTH}">truth {cell(course.truth)}</span>'
    told = f"{cell(value)}{within}{unit}{true}"
    bounds = f'<span style="{MUTED};white-space:nowrap">{cell(dim.min)} .. {cell(dim.max)}{unit}</span>'
    between = '<div style="display:flex;justify-content:space-between;gap:8px">'
    title = f"{between}<b>{escape(dim.name)}</b>{bounds}</div>"
    return f'<div style="margin-top:6px">{title}{told}{_curve(course)}</div>'


def _curve(course: Course) -> str:
    """A drawing of a parameter between its bounds."""
    last = max(1, len(course.values) - 1)
    places = [_WIDE * k / last for k in range(len(course.values))]
    heights = [_height(course, value) for value in course.values]
    band = [(x, interval) for x, interval in zip(places, course.intervals) if interval is not None]
    around = [(x, _height(course, high)) for x, (_, high) in band]
    around += [(x, _height(course, low)) for x, (low, _) in reversed(band)]
    stroke = 'fill="none" vector-effect="non-scaling-stroke"'
    parts = [f'<polygon points="{_points(around)}" fill="{_INK}" fill-opacity="0.2"/>' if len(band) > 1 else ""]
    if course.truth is not None:
        y = _height(course, course.truth)
        true = f'stroke="{_TRUTH}" stroke-width="2" stroke-dasharray="5 3"'
        parts.append(f'<line x1="0" x2="{_WIDE:g}" y1="{y:.2f}" y2="{y:.2f}" {true} {stroke}/>')
    # One value alone is a line as well.
    drawn = [*zip(places, heights), *([(_WIDE, heights[0])] if len(heights) == 1 else [])]
    parts.append(f'<polyline points="{_points(drawn)}" stroke="{_INK}" stroke-width="2" {stroke}/>')
    size = f'viewBox="0 0 {_WIDE:g} {_HIGH:g}" preserveAspectRatio="none"'
    style = "display:block;width:100%;height:26px;background:#f3f4f6;border-radius:3px"
    return f'<svg {size} style="{style}">{"".join(parts)}</svg>'


def _points(points: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in points)


def _height(course: Course, value: float) -> float:
    """Where a value is between the bounds, from the top."""
    low, high = course.dim.min, course.dim.max
    if course.dim.scale == "log" and low > 0 and value > 0:
        low, high, value = math.log(low), math.log(high), math.log(value)
    share = (value - low) / (high - low) if high > low else 0.5
    return _HIGH * (1.0 - min(1.0, max(0.0, share)))


def legend() -> str:
    """What the colours of the robots mean."""
    worst, best = (css(colour_of_merit(merit)) for merit in (0.0, 1.0))
    side = chip(worst, "least real fitness") + chip(best, "most")
    robots = chip(css(BODY), "real test") + chip(css(BEFORE), "simulated before") + chip(css(AFTER), "after")
    return box(f'<span style="{SMALL}">side by side: </span>{side}<br>{robots}', "font-size:12px")
