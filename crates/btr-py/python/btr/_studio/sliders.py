"""Sliders of the free parameters."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import viser

from btr._studio import panels
from btr._studio.session import Session
from btr._tables import cell
from btr.documents import Dimension

FEWEST_STEPS = 2000
PREVIEWED = "values without the preview; changing one ends the preview"
TYPED_S = 1.0
"""How long after the last change a number counts as typed."""


class Sliders:
    """One slider per free parameter."""

    def __init__(
        self, server: viser.ViserServer, change: Callable[[str, float], None], tell: Callable[[str], None]
    ) -> None:
        """`change` is called with each new value, `tell` with what is wrong with one that was typed."""
        self._gui, self._change, self._tell = server.gui, change, tell
        self._beyond: dict[str, float] = {}
        self._typing: threading.Timer | None = None
        self._place = self._gui.add_folder("Free parameters")
        with self._place:
            self._preview = self._gui.add_html(panels.note(PREVIEWED), visible=False)
        self.sliders: dict[str, Any] = {}
        """The sliders by the parameter's name."""

    def load(self, session: Session) -> None:
        """Shows the parameters of the present model at their values."""
        self.tell(session)
        self._load(session.model.parameters, session.model.values)

    def tell(self, session: Session) -> None:
        """Says whether a preview is shown, whose values these are not."""
        self._preview.visible = session.previewed is not None

    def _load(self, parameters: Sequence[Dimension], values: Mapping[str, float]) -> None:
        for name in [name for name in self.sliders if name not in values]:
            self.sliders.pop(name).remove()
        for dim in parameters:
            value, slider = values[dim.name], self.sliders.get(dim.name)
            if slider is not None and slider.min - slider.step < value < slider.max + slider.step:
                slider.value = _rounded(value, slider)
                continue
            if slider is not None:
                slider.remove()
            with self._place:
                self.sliders[dim.name] = self._slider(dim, value)

    def _slider(self, dim: Dimension, value: float) -> Any:
        low, high = reach(dim, value)
        unit = "" if dim.unit == "1" else f" ({dim.unit})"
        step = step_of(low, high)
        low, high = on_grid(low, high, step)
        slider: Any = self._gui.add_slider(f"{dim.name}{unit}", low, high, step, min(high, max(low, value)))
        # viser would take as many digits as the value has.
        slider.precision = digits_of(step)
        slider.value = _rounded(value, slider)

        def moved(event: Any) -> None:
            # What the page itself shows is no change.
            if event.client is not None:
                value = float(slider.value)
                self._typed(dim, slider, value)
                self._change(dim.name, _within(dim, value))

        slider.on_update(moved)
        return slider

    def _typed(self, dim: Dimension, slider: Any, value: float) -> None:
        """Keeps a value beyond the bounds until the typing ends: what is typed first of a number may be beyond them.
        The browser sets what is beyond the slider's ends to the nearer one when the field is left."""
        if value > slider.max:
            slider.max = on_grid(*reach(dim, _within(dim, value)), slider.step)[1]
        elif value < slider.min:
            slider.min = on_grid(*reach(dim, _within(dim, value)), slider.step)[0]
        if not dim.min - slider.step < value < dim.max + slider.step:
            self._beyond[dim.name] = value
        elif slider.min < value < slider.max:
            self._beyond.pop(dim.name, None)
        if self._typing is not None:
            self._typing.cancel()
        self._typing = threading.Timer(TYPED_S, self._tell_beyond, (dim, slider))
        self._typing.daemon = True
        self._typing.start()

    def _tell_beyond(self, dim: Dimension, slider: Any) -> None:
        typed = self._beyond.pop(dim.name, None)
        if typed is not None:
            bound = _within(dim, typed)
            slider.value = _rounded(bound, slider)
            self._tell(f"{dim.name}: {cell(typed)} is beyond its bounds, {_bounds(dim)}. It is set to {cell(bound)}.")


def _within(dim: Dimension, value: float) -> float:
    return min(dim.max, max(dim.min, value))


def _bounds(dim: Dimension) -> str:
    unit = "" if dim.unit == "1" else f" {dim.unit}"
    return f"{cell(dim.min)} to {cell(dim.max)}{unit}"


def reach(dim: Dimension, value: float) -> tuple[float, float]:
    """The ends of a parameter's slider: its bounds, or a part from 0 on if the value is tiny beside them."""
    if dim.min == 0 and 0 < value < 0.1 * dim.max:
        return 0.0, min(dim.max, float(f"{4 * value:.1g}"))
    return dim.min, dim.max


def step_of(low: float, high: float) -> float:
    """A slider's step, a power of ten: from 2000 to 20000 of them between its ends."""
    return float(10.0 ** math.floor(math.log10((high - low) / FEWEST_STEPS)))


def digits_of(step: float) -> int:
    """The digits after the point of a step that is a power of ten."""
    return max(0, round(-math.log10(step)))


def on_grid(low: float, high: float, step: float) -> tuple[float, float]:
    """The outermost multiples of a step between two bounds, for the eye: bounds may have any number of digits."""
    digits, nearly = digits_of(step), 1e-6
    return round(math.ceil(low / step - nearly) * step, digits), round(math.floor(high / step + nearly) * step, digits)


def _rounded(value: float, slider: Any) -> float:
    """The value with as many digits as the slider's step has, for the eye."""
    return float(min(slider.max, max(slider.min, round(value, digits_of(slider.step)))))
