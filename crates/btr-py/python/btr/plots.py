"""Plots of results and logs, with Matplotlib (`pip install 'btr[plot]'`), in the colours of the reports.

Usually called as `result.plot()` and `log.plot()`. Each function draws on the given axes or on a new figure, and
returns the figure (`result.plot().savefig("errors.png")`), whose `axes` are in the order of the drawing. Without
Matplotlib it raises `ImportError`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, cast

from btr._btr import Log
from btr._optional import needed
from btr._tables import cell
from btr.documents import Augmentation, ChannelError, Dimension, Estimate, Iteration, LadderStep
from btr.documents._common import interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = {"main": "#0b62b0", "second": "#d9730d", "third": "#a3479c", "alarm": "#c5221f", "truth": "#5c5c5c"}
"""Colours by meaning: simulated; measured or held out; before; warning; true."""

_JOINT_CHANNELS = ("cmd", "q", "dq", "tau")
_FLOORS = "error (noise floors)"


# What is drawn of each result. Results have `plot` methods and thus import this module.
class _Compared(Protocol):
    channels: list[ChannelError]


class _Diagnosed(Protocol):
    error_ladder: list[LadderStep]


class _Fitted(Protocol):
    parameters: list[Estimate]
    space: list[Dimension]
    error_ladder: list[LadderStep]


class _Coevolved(Protocol):
    iterations: list[Iteration]
    augmentations: list[Augmentation]


def _figure(rows: int = 1, columns: int = 1, *, size: tuple[float, float], **options: Any) -> list[Axes]:
    """New axes, row by row, on a figure of this size in inches."""
    pyplot = needed("matplotlib.pyplot", "plot")
    _, axes = pyplot.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained", **options)
    return list(axes.flat)


def _figure_of(ax: Axes) -> Figure:
    return cast("Figure", ax.figure)


def _height(rows: int) -> float:
    """Height of a figure with so many rows, in inches."""
    return 1.3 + 0.28 * rows


def _rows(ax: Axes, names: Sequence[str]) -> None:
    """One row per name, from top to bottom."""
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.grid(axis="x", color="#e6e6e6")
    ax.set_axisbelow(True)


def _notes(ax: Axes, notes: Sequence[str]) -> None:
    """Notes to the right of the rows."""
    ax.secondary_yaxis("right").set_yticks(range(len(notes)), notes)


def _errors(ax: Axes, errors: Sequence[float]) -> None:
    """Logarithmic axis of errors in noise floors, with a line at the noise floor."""
    finite = [x for x in errors if x > 0 and math.isfinite(x)]
    ax.set_xscale("log")
    ax.set_xlim(0.6 * min([1.0, *finite]), 1.8 * max([3.0, *finite]))
    ax.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    ax.xaxis.set_minor_formatter("")
    ax.axvline(1.0, color=INK["truth"], linestyle="--", label="noise floor")
    ax.set_xlabel(_FLOORS)


def compare(found: _Compared, ax: Axes | None = None) -> Figure:
    """The error of each channel in noise floors (`chi`), as bars on a logarithmic scale with the noise floor."""
    channels = found.channels
    ax = ax or _figure(size=(6.4, _height(len(channels))))[0]
    chi = [channel.chi for channel in channels]
    _rows(ax, [channel.name for channel in channels])
    ax.barh(range(len(chi)), chi, height=0.6, color=INK["main"])
    _errors(ax, chi)
    _notes(ax, [f"{x:.2f}" for x in chi])
    _head(ax, "Model error by channel")
    return _figure_of(ax)


def diagnose(found: _Diagnosed, ax: Axes | None = None) -> Figure:
    """The error ladder on training and held-out logs, in noise floors on a logarithmic scale."""
    ladder = found.error_ladder
    ax = ax or _figure(size=(6.4, _height(len(ladder))))[0]
    _ladder(ladder, ax)
    return _figure_of(ax)


def _ladder(ladder: Sequence[LadderStep], ax: Axes) -> None:
    _rows(ax, [step.step for step in ladder])
    drawn: list[float] = []
    for key, name, ink in (("train", "training logs", "main"), ("held_out", "held-out logs", "second")):
        errors = [math.nan if step[key] is None else step[key] for step in ladder]
        if any(map(math.isfinite, errors)):
            ax.plot(errors, range(len(errors)), "o-", color=INK[ink], label=name)
        drawn.extend(errors)
    _errors(ax, drawn)
    _head(ax, "Error after each step")


def fit(found: _Fitted, ax: Sequence[Axes] | None = None) -> Figure:
    """The fitted values with 95 % intervals between their bounds, and the error after each step, on a pair of axes."""
    rows = max(len(found.parameters), len(found.error_ladder))
    values, ladder = _figure(1, 2, size=(13.0, _height(rows))) if ax is None else ax
    _values(found, values)
    _ladder(found.error_ladder, ladder)
    return _figure_of(values)


def _values(found: _Fitted, ax: Axes) -> None:
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
    ax.set_xlabel("position between the bounds (0 to 1)")
    _head(ax, "Fitted values between their bounds")


def _value_text(parameter: Estimate) -> str:
    """A value with its interval as text; the interval is often too narrow to be visible."""
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    return f"{cell(parameter.value)}{unit}: {interval(parameter)}"


def _share(dim: Dimension, value: float | None) -> float:
    """Position of a value between its bounds, 0 to 1; NaN without a value."""
    if value is None:
        return math.nan
    low, high = dim.min, dim.max
    if dim.scale == "log":
        return math.log(value / low) / math.log(high / low)
    return float((value - low) / (high - low))


def coevolve(found: _Coevolved, ax: Sequence[Axes] | None = None) -> Figure:
    """Results by iteration, on a pair of axes. Left: phi on a logarithmic scale, of the new simulation, and of the
    previous one on tests that it was not fitted to. Right: the best controller's fitness, predicted and real. Without
    any fitness there is only the left one."""
    fitness = [("fitness_sim", "predicted", "main"), ("fitness_real", "real", "second")]
    has_fitness = any(iteration[key] is not None for iteration in found.iterations for key, _, _ in fitness)
    axes = _figure(1, 1 + has_fitness, size=(6.4 * (1 + has_fitness), 3.6)) if ax is None else list(ax)
    phi = [("phi", "new simulation", "main"), ("phi_predicted", "previous simulation, on fresh tests", "second")]
    _iterations(found, axes[0], phi, "phi", "Distance between simulation and reality")
    axes[0].set_yscale("log")
    if has_fitness:
        _iterations(found, axes[1], fitness, "fitness", "Fitness of the best controller")
    return _figure_of(axes[0])


def _iterations(found: _Coevolved, ax: Axes, lines: Sequence[tuple[str, str, str]], label: str, title: str) -> None:
    """One line per (key, name, ink) over the iterations, with marks where parameters were added to the simulation."""
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


def log(of: Log, channels: Sequence[str] = (), ax: Axes | None = None) -> Figure:
    """Channels in their units over time in s; by default the commands and positions of the joints (all channels of a
    log without joints). Channels of one joint and one unit share axes; a given `ax` receives all channels. Raises
    `KeyError` for an unknown channel."""
    joints = [name for name in of.keys() if name.startswith(("cmd_", "q_"))]
    names = list(channels) or joints or of.keys()
    groups: dict[tuple[str, str], list[str]] = {}
    for name in names:
        groups.setdefault((_joint(name), of.unit(name)), []).append(name)
    if ax is not None:
        _lines(of, names, ax)
        return _figure_of(ax)
    columns = max(1, math.ceil(len(groups) / 5))
    rows = max(1, math.ceil(len(groups) / columns))
    grid = _figure(rows, columns, size=(6.4 * min(columns, 3), 0.6 + 1.9 * rows), sharex=True)
    axes, spare, figure = grid[: len(groups)], grid[len(groups) :], _figure_of(grid[0])
    for empty in spare:
        empty.remove()
    for k, (group, ax) in enumerate(zip(groups.values(), axes)):
        _lines(of, group, ax)
        lowest = k + columns >= len(groups)
        ax.tick_params(labelbottom=lowest)
        ax.xaxis.label.set_visible(lowest)
    return figure


def _joint(channel: str) -> str:
    """The joint of a channel; the channel's name if it belongs to no joint."""
    kind, _, joint = channel.partition("_")
    return joint if kind in _JOINT_CHANNELS else channel


def _lines(of: Log, channels: Sequence[str], ax: Axes) -> None:
    joints = list(dict.fromkeys(map(_joint, channels)))
    for channel in channels:
        is_command = channel.startswith("cmd_")
        # One joint has the reports' colours; with several, each joint and its command have one colour.
        alone = INK["truth" if is_command else "second"]
        colour = alone if len(joints) == 1 else f"C{joints.index(_joint(channel))}"
        ax.plot(of.clock_s, of[channel], "--" if is_command else "-", color=colour, label=channel)
    units = ", ".join(dict.fromkeys(of.unit(channel) for channel in channels))
    ax.set_ylabel(f"{joints[0]} ({units})" if len(joints) == 1 else f"({units})")
    ax.set_xlabel("time (s)")
    ax.grid(color="#e6e6e6")
    _head(ax)


def _head(ax: Axes, title: str = "") -> None:
    """Title and legend above the axes, each label once."""
    handles, labels = ax.get_legend_handles_labels()
    unique = dict(zip(labels, handles))
    place: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": 4}
    ax.legend(unique.values(), unique.keys(), fontsize="small", frameon=False, **place)
    ax.set_title(title, pad=24)
