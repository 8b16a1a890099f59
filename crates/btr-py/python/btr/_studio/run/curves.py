"""Plots of a run: both populations over their generations, and one channel of a real test with its simulations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Union

import numpy as np
import viser

from btr._studio.panels import lines as legend
from btr._studio.plots import cursor, line, options, with_cursor
from btr._studio.replay import Replay, Series
from btr._studio.run import panels
from btr._studio.run.folder import Scores, Snapshot
from btr._studio.run.session import Tested

INK = {
    "best": "#7c3aed",
    "mean": "#b9a5ea",
    "promised": "#f0962a",
    "real": "#2ea05a",
    "measured": "#8a8f98",
    "before": "#f0962a",
    "after": "#7c3aed",
}
MOST_SAMPLES = 2000
_HEIGHT = 140
_COUNTS = tuple(digit * 10**power for power in range(6) for digit in (1, 2, 5))


class Curves:
    """Fitness and phi over the generations, and fitness in simulation and in reality over the real tests."""

    def __init__(self, gui: viser.GuiApi) -> None:
        # Both lines of phi would be flat after the first generations, were its axis not logarithmic.
        log = {"y": {"distr": 3}}
        self._fitness = _Curve(gui, {"fitness: best of a generation": "best", "mean": "mean"}, {})
        self._tests = _Curve(gui, {"fitness of real tests: promised": "promised", "real": "real"}, {}, points=True)
        self._phi = _Curve(gui, {"phi: best of a generation": "best", "mean": "mean"}, log)
        self._told = gui.add_html("")

    def load(self, run: Snapshot) -> None:
        """Shows a run."""
        self._fitness.load([_scores(run.controllers, key) for key in ("best", "mean")], first=1)
        real = [test.verdict.done.fitness for test in run.done if test.verdict.done is not None]
        self._tests.load([_numbers([test.promised for test in run.done]), _numbers(real)], first=0)
        phi = [_scores(run.simulators, key) for key in ("best", "mean")]
        self._phi.load([np.where(values > 0, values, np.nan) for values in phi], first=1)
        self._told.content = panels.phi(run.distance) if run.simulators else ""


class _Curve:
    """A plot of two lines, which is shown once it has something."""

    def __init__(
        self, gui: viser.GuiApi, names: dict[str, str], scales: dict[str, Any], *, points: bool = False
    ) -> None:
        """`names` are the lines with their inks; `scales` is what is special about uPlot's."""
        self._told = gui.add_html(legend({name: INK[ink] for name, ink in names.items()}), visible=False)
        style: dict[str, Any] = {"points": {"show": True, "size": 7}} if points else {}
        # The first line is wider: it shows where both agree.
        widths = (4.0, 1.5) if points else (1.5, 1.5)
        series = [line(name, INK[ink], **style, width=width) for (name, ink), width in zip(names.items(), widths)]
        of_all = options(_HEIGHT)
        across, up = of_all["axes"]
        # Generations and tests are counted.
        axes = ({**across, "incrs": _COUNTS}, up)
        drawn = {**of_all, "scales": {"x": {"time": False}, "y": {}, **scales}, "axes": axes}
        empty = (np.array([0.0, 1.0]), *(np.full(2, np.nan),) * len(series))
        self._plot = gui.add_uplot(empty, _all(series), **drawn, visible=False)

    def load(self, lines: Sequence[Series], first: int) -> None:
        """Shows these lines; their first values belong to the number `first`."""
        shown = _seen(lines)
        known = np.flatnonzero(np.all(np.isfinite(shown), axis=0)) if shown else np.empty(0)
        self._plot.visible = self._told.visible = len(known) > 0
        if len(known) > 0:
            # uPlot finds no scale for a line that begins without a number.
            begin = int(known[0])
            self._plot.data = (np.arange(first, first + len(shown[0]), dtype=np.float64)[begin:],) + tuple(
                values[begin:] for values in shown
            )


class TestPlot:
    """A channel of a real test, and its simulations before and after."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._clock: Series = np.array([0.0, 1.0])
        self._lines: list[Series] = [np.full(2, np.nan)] * 3
        names = {"measured": "measured", "simulated before": "before", "simulated after": "after"}
        self._told = gui.add_html(legend({name: INK[key] for name, key in names.items()}))
        styles = {"measured": {"width": 3.5}}
        series = [line(name, INK[name], **styles.get(name, {})) for name in ("measured", "before", "after")]
        self._plot = gui.add_uplot(
            with_cursor(self._clock, self._lines, 0), _all([*series, cursor()]), **options(_HEIGHT)
        )

    def load(self, test: Tested, channel: str, time_s: float) -> None:
        """Shows a channel of a test."""
        every = max(1, -(-len(test.run.clock_s) // MOST_SAMPLES))
        self._clock = test.run.clock_s[::every]
        simulated = [_channel(replay, channel) for replay in (test.before, test.after)]
        lines = [test.run.measured(channel), *simulated]
        shown = [np.full(len(self._clock), np.nan) if values is None else values[::every] for values in lines]
        self._lines = _seen(shown)
        self.at(time_s)

    def at(self, time_s: float) -> None:
        """Puts the cursor at a time."""
        sample = int(np.clip(np.searchsorted(self._clock, time_s), 0, max(0, len(self._clock) - 2)))
        self._plot.data = with_cursor(self._clock, self._lines, sample)

    def show(self, visible: bool) -> None:
        """Shows or hides it."""
        self._plot.visible = self._told.visible = visible


def _channel(replay: Union[Replay, None], channel: str) -> Union[Series, None]:
    return None if replay is None else replay.simulated.get(channel)


def _scores(generations: Sequence[Scores], key: str) -> Series:
    return _numbers([getattr(scores, key) for scores in generations])


def _numbers(values: Sequence[Union[float, None]]) -> Series:
    return np.array([np.nan if value is None else value for value in values])


def _seen(lines: Sequence[Series]) -> list[Series]:
    """The lines; what has no numbers hides behind one that has: uPlot finds no scale for it."""
    known = [values for values in lines if np.isfinite(values).any()]
    return [values if np.isfinite(values).any() or not known else known[0] for values in lines]


def _all(series: Sequence[Any]) -> tuple[Any, ...]:
    return ({"label": "x"}, *series)

