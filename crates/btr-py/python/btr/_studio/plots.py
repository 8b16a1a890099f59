"""Plots over time: a channel as commanded, measured and simulated, and what is left of it beside the noise."""

from __future__ import annotations

from typing import Any, Union

import numpy as np
import viser

from btr._studio import panels
from btr._studio.replay import Replay, Series

MOST_SAMPLES = 4000
NOISE_BAND = 2.0
"""Half width of the noise band, in noise floors."""

INK = {"command": "#8a8f98", "measured": "#d9730d", "model": "#7c3aed", "residual": "#0b62b0", "noise": "#2ea05a"}
_CURSOR_INK = "#1f2937"


class Plots:
    """A pair of plots of one channel, with a cursor at the time that is shown."""

    def __init__(self, server: viser.ViserServer) -> None:
        gui, empty = server.gui, np.array([0.0, 1.0])
        self._clock: Series = empty
        self._motion: list[Series] = [np.full(2, np.nan)] * 3
        self._rest: list[Series] = [np.full(2, np.nan)] * 3
        gui.add_html(panels.lines({name: INK[name] for name in ("command", "measured", "model")}))
        self.motion = gui.add_uplot(with_cursor(empty, self._motion, 0), _motion_series(), **options(150), bands=None)
        names = {"measured less model, in noise floors": INK["residual"], "noise, 95 %": INK["noise"]}
        gui.add_html(panels.lines(names))
        self.rest = gui.add_uplot(
            with_cursor(empty, self._rest, 0),
            _rest_series(),
            **options(150),
            bands=({"series": (2, 3), "fill": "rgba(46,160,90,0.16)"},),
        )

    def load(self, replay: Replay, channel: str, floor: Union[float, None], time_s: float) -> None:
        """Shows a channel of a replay."""
        every = max(1, -(-len(replay.run.clock_s) // MOST_SAMPLES))
        self._clock = replay.run.clock_s[::every]
        command = replay.run.measured(f"cmd_{channel[2:]}") if channel.startswith("q_") else None
        simulated = replay.simulated.get(channel)
        measured = _first(replay.run.measured(channel), simulated)
        # uPlot finds no scale for a line without numbers: what is missing hides behind another line.
        lines = (_first(command, measured), measured, _first(simulated, measured))
        self._motion = [self._line(values, every) for values in lines]
        band = np.full(len(self._clock), NOISE_BAND if floor else np.nan)
        left = self._line(replay.residual(channel), every) / (floor or np.nan)
        self._rest = [left, band, -band]
        self.at(time_s)

    def at(self, time_s: float) -> None:
        """Puts the cursor at a time."""
        sample = int(np.clip(np.searchsorted(self._clock, time_s), 0, max(0, len(self._clock) - 2)))
        self.motion.data = with_cursor(self._clock, self._motion, sample)
        self.rest.data = with_cursor(self._clock, self._rest, sample)

    def _line(self, values: Union[Series, None], every: int) -> Series:
        return np.full(len(self._clock), np.nan) if values is None else np.asarray(values[::every])


def with_cursor(clock: Series, lines: list[Series], sample: int) -> tuple[Series, ...]:
    """The lines, and one that rises from the bottom to the top at a sample: uPlot's own cursor is the mouse's."""
    rises = np.full(len(clock), np.nan)
    rises[sample : sample + 2] = (0.0, 1.0)[: len(rises[sample : sample + 2])]
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
        "axes": ({"size": 26, "ticks": {"size": 4}}, {"size": 44, "space": 18, "ticks": {"size": 4}}),
        "legend": {"show": False},
        "padding": (6, 10, 0, 0),
    }
