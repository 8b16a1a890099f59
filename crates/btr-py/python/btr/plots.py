"""Plots of results and logs, with Matplotlib (`pip install 'btr[plot]'`), in the colours of the reports.

Usually called as `result.plot()` and `log.plot()`. Each function draws on the axes that it is given or on a new figure and
gives the axes back; without Matplotlib it raises `ImportError`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from btr._optional import needed
from btr._tables import cell, interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from btr._btr import Log
    from btr.documents import Dimension, Estimate, LadderStep
    from btr.results import CoevolveResult, CompareResult, DiagnoseResult, FitResult

INK = {"main": "#0b62b0", "second": "#d9730d", "third": "#a3479c", "alarm": "#c5221f", "truth": "#5c5c5c"}
"""Colours by meaning: simulated, measured or held out, before, out of place, true."""

_JOINT_CHANNELS = ("cmd", "q", "dq", "tau")
_FLOORS = "error (noise floors)"


def _figure(rows: int = 1, columns: int = 1, *, size: tuple[float, float], **options: Any) -> list[Axes]:
    """New axes, row by row, on a figure of this size in inches."""
    pyplot = needed("matplotlib.pyplot", "plot")
    _, axes = pyplot.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained", **options)
    return list(axes.flat)


def _height(rows: int) -> float:
    """Of a picture with so many rows, in inches."""
    return 1.3 + 0.28 * rows


def _rows(ax: Axes, names: Sequence[str]) -> None:
    """A row for every name, from above."""
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.grid(axis="x", color="#e6e6e6")
    ax.set_axisbelow(True)


def _notes(ax: Axes, notes: Sequence[str]) -> None:
    """Notes to the right of the rows."""
    ax.secondary_yaxis("right").set_yticks(range(len(notes)), notes)


def _errors(ax: Axes, errors: Sequence[float]) -> None:
    """A logarithmic scale of errors in noise floors, with the noise floor on it."""
    finite = [x for x in errors if x > 0 and math.isfinite(x)]
    ax.set_xscale("log")
    ax.set_xlim(0.6 * min([1.0, *finite]), 1.8 * max([3.0, *finite]))
    ax.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    ax.xaxis.set_minor_formatter("")
    ax.axvline(1.0, color=INK["truth"], linestyle="--", label="noise floor")
    ax.set_xlabel(_FLOORS)


def compare(found: CompareResult, ax: Axes | None = None) -> Axes:
    """The error of every channel in noise floors (`chi`), as bars on a logarithmic scale beside the noise floor."""
    channels = found.channels
    ax = ax or _figure(size=(6.4, _height(len(channels))))[0]
    chi = [channel.chi for channel in channels]
    _rows(ax, [channel.name for channel in channels])
    ax.barh(range(len(chi)), chi, height=0.6, color=INK["main"])
    _errors(ax, chi)
    _notes(ax, [f"{x:.2f}" for x in chi])
    _head(ax, "Where the model errs")
    return ax


def diagnose(found: DiagnoseResult, ax: Axes | None = None) -> Axes:
    """The error ladder on training and held-out logs, in noise floors on a logarithmic scale."""
    ladder = found.error_ladder
    return _ladder(ladder, ax or _figure(size=(6.4, _height(len(ladder))))[0])


def _ladder(ladder: Sequence[LadderStep], ax: Axes) -> Axes:
    _rows(ax, [step.step for step in ladder])
    drawn: list[float] = []
    for key, name, ink in (("train", "learnt from", "main"), ("held_out", "held out", "second")):
        errors = [math.nan if step[key] is None else step[key] for step in ladder]
        if any(map(math.isfinite, errors)):
            ax.plot(errors, range(len(errors)), "o-", color=INK[ink], label=name)
        drawn.extend(errors)
    _errors(ax, drawn)
    _head(ax, "The error, step by step")
    return ax


def fit(found: FitResult, ax: Sequence[Axes] | None = None) -> list[Axes]:
    """Every fitted value with its 95 % interval between its bounds, and how the error fell: on a pair of axes."""
    rows = max(len(found.parameters), len(found.error_ladder))
    values, ladder = _figure(1, 2, size=(13.0, _height(rows))) if ax is None else ax
    return [_values(found, values), _ladder(found.error_ladder, ladder)]


def _values(found: FitResult, ax: Axes) -> Axes:
    dims = {dim.name: dim for dim in found.space}
    _rows(ax, [parameter.name for parameter in found.parameters])
    for row, parameter in enumerate(found.parameters):
        dim, ink = dims[parameter.name], INK["alarm" if parameter.at_bound else "main"]
        if parameter.ci95 is not None:
            low, high = (_share(dim, end) for end in parameter.ci95)
            ax.hlines(row, low, high, color=ink, alpha=0.45, linewidth=5)
        ax.plot(_share(dim, dim.nominal), row, "o", color=INK["third"], label="before")
        label = "at its bound" if parameter.at_bound else "fitted, with its 95 % interval"
        ax.plot(_share(dim, parameter.value), row, "o", color=ink, label=label)
    _notes(ax, [_value_text(parameter) for parameter in found.parameters])
    ax.set_xlim(-0.03, 1.03)
    ax.set_xlabel("share of the way between the bounds")
    _head(ax, "Each value between its bounds")
    return ax


def _value_text(parameter: Estimate) -> str:
    """A value with its interval, which is often too narrow to be seen between the bounds."""
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    return f"{cell(parameter.value)}{unit}: {interval(parameter)}"


def _share(dim: Dimension, value: float | None) -> float:
    """Where a value lies between its bounds, 0 to 1; NaN where there is none."""
    if value is None:
        return math.nan
    low, high = dim.min, dim.max
    if dim.scale == "log":
        return math.log(value / low) / math.log(high / low)
    return float((value - low) / (high - low))


def coevolve(found: CoevolveResult, ax: Sequence[Axes] | None = None) -> list[Axes]:
    """What every iteration came to, on a pair of axes: phi on a logarithmic scale, of the new simulation and of the one before
    it on tests that it had not seen; and the best controller's fitness, as it was promised and as it was. Without any fitness
    phi is alone."""
    ends = [("fitness_sim", "promised", "main"), ("fitness_real", "real", "second")]
    has_fitness = any(iteration[key] is not None for iteration in found.iterations for key, _, _ in ends)
    axes = _figure(1, 1 + has_fitness, size=(6.4 * (1 + has_fitness), 3.6)) if ax is None else list(ax)
    phi = [("phi", "of the simulation found", "main"), ("phi_predicted", "of the one before, on fresh tests", "second")]
    drawn = [_iterations(found, axes[0], phi, "phi", "How far simulation is from reality")]
    axes[0].set_yscale("log")
    if has_fitness:
        drawn.append(_iterations(found, axes[1], ends, "fitness", "What the best controller is worth"))
    return drawn


def _iterations(found: CoevolveResult, ax: Axes, lines: Sequence[tuple[str, str, str]], label: str, title: str) -> Axes:
    """A line per key with its name and ink over the iterations, with marks where simulations gained parameters."""
    for key, name, ink in lines:
        values = [math.nan if iteration[key] is None else iteration[key] for iteration in found.iterations]
        ax.plot([iteration.i for iteration in found.iterations], values, "o-", color=INK[ink], label=name)
    for grown in found.augmentations:
        gained = f"+ {', '.join(grown.parameters)}"
        ax.axvline(grown.after_iteration + 0.5, color=INK["third"], linestyle="--", label=gained)
    ax.xaxis.set_major_locator(needed("matplotlib.ticker", "plot").MaxNLocator(integer=True))
    ax.set_xlabel("iteration")
    ax.set_ylabel(label)
    ax.grid(color="#e6e6e6")
    _head(ax, title)
    return ax


def log(of: Log, channels: Sequence[str] = (), ax: Axes | None = None) -> list[Axes]:
    """Channels in their units against the clock in s; without any named, what joints were told and what they read (all channels
    of a log without joints). What belongs to one joint and has one unit shares an axes; `ax` takes everything. Raises
    `KeyError` for a channel that is not there."""
    joints = [name for name in of.keys() if name.startswith(("cmd_", "q_"))]
    names = list(channels) or joints or of.keys()
    groups: dict[tuple[str, str], list[str]] = {}
    for name in names:
        groups.setdefault((_joint(name), of.unit(name)), []).append(name)
    if ax is not None:
        return [_lines(of, names, ax)]
    columns = max(1, math.ceil(len(groups) / 5))
    rows = max(1, math.ceil(len(groups) / columns))
    grid = _figure(rows, columns, size=(6.4 * min(columns, 3), 0.6 + 1.9 * rows), sharex=True)
    axes, spare = grid[: len(groups)], grid[len(groups) :]
    for empty in spare:
        empty.remove()
    for k, (group, ax) in enumerate(zip(groups.values(), axes)):
        _lines(of, group, ax)
        lowest = k + columns >= len(groups)
        ax.tick_params(labelbottom=lowest)
        ax.xaxis.label.set_visible(lowest)
    return axes


def _joint(channel: str) -> str:
    """The joint that a channel is of; the channel's own name where it is of none."""
    kind, _, joint = channel.partition("_")
    return joint if kind in _JOINT_CHANNELS else channel


def _lines(of: Log, channels: Sequence[str], ax: Axes) -> Axes:
    joints = list(dict.fromkeys(map(_joint, channels)))
    for channel in channels:
        is_command = channel.startswith("cmd_")
        # One joint has the reports' colours; several share a colour with their own command only.
        alone = INK["truth" if is_command else "second"]
        colour = alone if len(joints) == 1 else f"C{joints.index(_joint(channel))}"
        ax.plot(of.clock_s, of[channel], "--" if is_command else "-", color=colour, label=channel)
    units = ", ".join(dict.fromkeys(of.unit(channel) for channel in channels))
    ax.set_ylabel(f"{joints[0]} ({units})" if len(joints) == 1 else f"({units})")
    ax.set_xlabel("time (s)")
    ax.grid(color="#e6e6e6")
    _head(ax)
    return ax


def _head(ax: Axes, title: str = "") -> None:
    """Every label once, above the picture where it hides nothing, and above that a title."""
    handles, labels = ax.get_legend_handles_labels()
    unique = dict(zip(labels, handles))
    place: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": 4}
    ax.legend(unique.values(), unique.keys(), fontsize="small", frameon=False, **place)
    ax.set_title(title, pad=24)
