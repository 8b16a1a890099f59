"""The panel of the cause: what is missing, what was added, values to try, and what is saved."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import viser

from btr._studio import panels
from btr._studio.candidates import Candidate
from btr._studio.session import Session
from btr.documents import Dimension

Names = Sequence[str]


class Candidates:
    """Cards of suspects, each with a button."""

    def __init__(
        self, server: viser.ViserServer, add: Callable[[Names], None], remove: Callable[[Names], None]
    ) -> None:
        self._gui, self._add, self._remove = server.gui, add, remove
        self._place = self._gui.add_folder("Suspects", visible=False)
        self._shown: list[Any] = []
        self.buttons: list[Any] = []
        """The buttons of the cards."""

    def load(self, session: Session) -> None:
        """Shows what the session suspects and what it has added."""
        for part in self._shown:
            part.remove()
        self._shown, self.buttons = [], []
        added = session.step.added
        known = session.candidates
        listed = {name for candidate in known for name in candidate.names}
        others = [Candidate((name,), "", "", (), None, False, (), None) for name in added if name not in listed]
        self._place.visible = bool(known or others)
        with self._place:
            for candidate in [*known, *others]:
                self._card(candidate, is_added=all(name in added for name in candidate.names))

    def _card(self, candidate: Candidate, *, is_added: bool) -> None:
        folder = self._gui.add_folder(candidate.title, expand_by_default=candidate.established or is_added)
        with folder:
            self._gui.add_html(panels.card(candidate))
            first = candidate.names[0]
            verb, act = ("Remove", self._remove) if is_added else ("Add", self._add)
            button = self._gui.add_button(f"{verb} {first}", color="gray" if is_added else "violet")
        button.on_click(lambda _: act(candidate.names))
        self._shown.append(folder)
        self.buttons.append(button)


class Sliders:
    """One slider per free parameter."""

    def __init__(self, server: viser.ViserServer, change: Callable[[str, float], None]) -> None:
        self._gui, self._change = server.gui, change
        self._place = self._gui.add_folder("Free parameters")
        self._sliders: dict[str, Any] = {}

    def load(self, parameters: Sequence[Dimension], values: Mapping[str, float]) -> None:
        """Shows these parameters at their values."""
        for name in [name for name in self._sliders if name not in values]:
            self._sliders.pop(name).remove()
        for dim in parameters:
            value, slider = values[dim.name], self._sliders.get(dim.name)
            if slider is not None and slider.min <= value <= slider.max:
                slider.value = _rounded(value, slider)
                continue
            if slider is not None:
                slider.remove()
            with self._place:
                self._sliders[dim.name] = self._slider(dim, value)

    def _slider(self, dim: Dimension, value: float) -> Any:
        low, high = reach(dim, value)
        step = 10.0 ** math.floor(math.log10((high - low) / 100))
        unit = "" if dim.unit == "1" else f" ({dim.unit})"
        slider: Any = self._gui.add_slider(f"{dim.name}{unit}", low, high, step, value)
        slider.value = _rounded(value, slider)

        def moved(event: Any) -> None:
            # What the page itself shows is no change.
            if event.client is not None:
                self._change(dim.name, min(dim.max, max(dim.min, float(slider.value))))

        slider.on_update(moved)
        return slider


def reach(dim: Dimension, value: float) -> tuple[float, float]:
    """The ends of a parameter's slider: its bounds, or a part from 0 on if the value is tiny beside them."""
    if dim.min == 0 and 0 < value < 0.1 * dim.max:
        return 0.0, min(dim.max, float(f"{4 * value:.1g}"))
    return dim.min, dim.max


def _rounded(value: float, slider: Any) -> float:
    """The value with as many digits as the slider's step has, for the eye."""
    digits = max(0, round(-math.log10(slider.step)))
    return float(min(slider.max, max(slider.min, round(value, digits))))
