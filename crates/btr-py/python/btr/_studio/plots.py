"""Plots over time: a channel as commanded, measured and simulated, and what is left of it beside the noise."""

from __future__ import annotations

from typing import Any, Union

import numpy as np
import viser
from numpy.typing import NDArray

from btr._studio import panels
from btr._studio.replay import Replay, Series

MOST_SAMPLES = 4000
"""Of a plot at rest, which may be magnified."""
MOVING_SAMPLES = 800
"""Of a plot that changes: more than it has pixels."""
CURSOR_PARTS = 200
"""Of the width of a plot, the cursor takes one such part at least."""
NOISE_BAND = 2.0
"""Half width of the noise band, in noise floors."""

INK = {"command": "#8a8f98", "measured": "#d9730d", "model": "#7c3aed", "residual": "#0b62b0", "noise": "#2ea05a"}
MOTION = {name: INK[name] for name in ("command", "measured", "model")}
_CURSOR_INK = "#1f2937"


class Plots:
    """A pair of plots of one channel, with a cursor at the time that is shown. They have few samples while they change,
    and all that are drawn once they are at rest."""

    def __init__(self, server: viser.ViserServer) -> None:
        gui, empty = server.gui, np.array([0.0, 1.0])
        nothing = [np.full(2, np.nan)] * 3
        self._motion = Lines(empty, nothing, nothing[0])
        self._rest = Lines(empty, nothing, nothing[0])
        self._legend = gui.add_html(panels.lines(MOTION))
        self.motion = gui.add_uplot(self._motion.at(0.0, MOVING_SAMPLES), _motion_series(), **options(150), bands=None)
        names = {"measured less model, in noise floors": INK["residual"], "noise, 95 %": INK["noise"]}
        gui.add_html(panels.lines(names))
        self.rest = gui.add_uplot(
            self._rest.at(0.0, MOVING_SAMPLES),
            _rest_series(),
            **options(150),
            bands=({"series": (2, 3), "fill": "rgba(46,160,90,0.16)"},),
        )

    def load(self, replay: Replay, channel: str, floor: Union[float, None], time_s: float) -> None:
        """Shows a channel of a replay, as one that changes."""
        clock = replay.run.clock_s
        command = replay.run.measured(f"cmd_{channel[2:]}") if channel.startswith("q_") else None
        simulated = replay.simulated.get(channel)
        measured = _first(replay.run.measured(channel), simulated)
        nothing = np.full(len(clock), np.nan)
        # uPlot finds no scale for a line without numbers: what is missing hides behind another line.
        lines = (_first(command, measured), measured, _first(simulated, measured))
        motion = [nothing if values is None else values for values in lines]
        self._motion = Lines(clock, motion, motion[2])
        unit = replay.run.log.unit(channel) if channel in replay.run.log else ""
        self._legend.content = panels.lines(MOTION, f"{channel}{f' in {unit}' if unit else ''} over s:")
        residual = replay.residual(channel)
        left = nothing if residual is None else residual / (floor or np.nan)
        band = np.full(len(clock), NOISE_BAND if floor else np.nan)
        self._rest = Lines(clock, [left, band, -band], left)
        self.at(time_s, moving=True)

    def at(self, time_s: float, *, moving: bool) -> None:
        """Puts the cursor at a time; `moving` plots have few samples."""
        most = MOVING_SAMPLES if moving else MOST_SAMPLES
        self.motion.data, self.rest.data = self._motion.at(time_s, most), self._rest.at(time_s, most)


class Lines:
    """Lines over a clock, thinned."""

    def __init__(self, clock: Series, lines: list[Series], of: Series) -> None:
        """Thinned lines keep the extremes of `of`."""
        self._clock, self._lines, self._of = clock, lines, of
        self._thinned: dict[int, tuple[Series, list[Series]]] = {}

    def at(self, time_s: float, most: int) -> tuple[Series, ...]:
        """The clock, the lines and a cursor at a time, with so many samples at most."""
        if most not in self._thinned:
            kept = extremes(self._of, most)
            self._thinned[most] = self._clock[kept], [values[kept] for values in self._lines]
        clock, lines = self._thinned[most]
        sample = int(np.clip(np.searchsorted(clock, time_s), 0, max(0, len(clock) - 2)))
        return with_cursor(clock, lines, sample)


def extremes(values: Series, most: int) -> NDArray[np.intp]:
    """Places of at most so many values: the least and the greatest of each of equal parts, in their order."""
    count, parts = len(values), most // 2
    if count <= most:
        return np.arange(count)
    # What is missing is no extreme.
    known = np.where(np.isfinite(values), values, np.nanmean(values) if np.isfinite(values).any() else 0.0)
    edges = np.linspace(0, count, parts + 1).astype(np.intp)
    width = int(np.diff(edges).max())
    places = np.minimum(edges[:-1, None] + np.arange(width), edges[1:, None] - 1)
    rows = np.arange(parts)
    least, greatest = (places[rows, pick(known[places], axis=1)] for pick in (np.argmin, np.argmax))
    return np.unique(np.concatenate([least, greatest]))


def with_cursor(clock: Series, lines: list[Series], sample: int) -> tuple[Series, ...]:
    """The lines, and one that rises from the bottom to the top at a sample: uPlot's own cursor is the mouse's. uPlot
    draws nothing of a line that is less than a pixel wide between gaps, so this one goes up and down over a few dense
    samples."""
    rises = np.full(len(clock), np.nan)
    wide = max(2, len(clock) // CURSOR_PARTS)
    rises[sample : sample + wide] = (np.arange(wide) % 2)[: len(clock) - sample]
    return (clock, *lines, rises)


def _first(*lines: Union[Series, None]) -> Union[Series, None]:
    """The first line that has numbers; None without any."""
    return next((line for line in lines if line is not None and np.isfinite(line).any()), None)


def line(label: str, ink: str, **style: Any) -> Any:
    """A line of a plot."""
    return {"label": label, "stroke": ink, "width": 1.5, "points": {"show": False}, **style}


def cursor() -> Any:
    """The line of `with_cursor`."""
    return line("time", _CURSOR_INK, scale="cursor", width=1.0)


def _motion_series() -> tuple[Any, ...]:
    names = ("command", "measured", "model")
    # The model is drawn over the readings: these are wider, so that they show where both agree.
    styles: dict[str, Any] = {"command": {"dash": (4, 4)}, "measured": {"width": 3.5}}
    return ({"label": "t (s)"}, *(line(name, INK[name], **styles.get(name, {})) for name in names), cursor())


def _rest_series() -> tuple[Any, ...]:
    edge = {"width": 0.5}
    return (
        {"label": "t (s)"},
        line("residual", INK["residual"]),
        line("noise", INK["noise"], **edge),
        line("noise", INK["noise"], **edge),
        cursor(),
    )


def options(height: int) -> dict[str, Any]:
    """What the studio's plots have in common."""
    return {
        "height": height,
        "scales": {"x": {"time": False}, "y": {}, "cursor": {"auto": False, "range": (0.0, 1.0)}},
        "axes": ({"size": 26, "ticks": {"size": 4}}, {"size": 60, "space": 18, "ticks": {"size": 4}}),
        "legend": {"show": False},
        "padding": (6, 10, 0, 0),
    }
