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
    """Cards of suspects, each with buttons."""

    def __init__(
        self,
        server: viser.ViserServer,
        add: Callable[[Names], None],
        remove: Callable[[Names], None],
        preview: Callable[[Names], None],
    ) -> None:
        """`preview` is called with a suspect to show, and with none to end that."""
        self._gui, self._add, self._remove, self._preview = server.gui, add, remove, preview
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
        shown = () if session.previewed is None else session.previewed.added[len(added) :]
        known = session.candidates
        listed = {name for candidate in known for name in candidate.names}
        others = [Candidate((name,), "", "", (), None, False, (), None) for name in added if name not in listed]
        self._place.visible = bool(known or others)
        with self._place:
            for candidate in [*known, *others]:
                is_added = all(name in added for name in candidate.names)
                self._card(candidate, is_added=is_added, is_shown=candidate.names == shown)

    def _card(self, candidate: Candidate, *, is_added: bool, is_shown: bool) -> None:
        is_open = candidate.established or is_added or is_shown
        folder = self._gui.add_folder(candidate.title, expand_by_default=is_open)
        with folder:
            self._gui.add_html(panels.card(candidate))
            first = candidate.names[0]
            verb, act = ("Remove", self._remove) if is_added else ("Add", self._add)
            button = self._gui.add_button(f"{verb} {first}", color="gray" if is_added else "violet")
            if not is_added:
                self._preview_button(candidate.names, is_shown=is_shown)
        button.on_click(lambda _: act(candidate.names))
        self._shown.append(folder)
        self.buttons.append(button)

    def _preview_button(self, names: Names, *, is_shown: bool) -> None:
        label = f"End preview of {names[0]}" if is_shown else f"Preview {names[0]}"
        button = self._gui.add_button(label, color="gray", icon=viser.Icon.EYE_OFF if is_shown else viser.Icon.EYE)
        button.on_click(lambda _: self._preview(() if is_shown else names))
        self.buttons.append(button)


class NextExperiment:
    """The experiment that would tell suspects apart, with a button that shows its motion."""

    def __init__(self, server: viser.ViserServer, show: Callable[[], None], end: Callable[[], None]) -> None:
        self._place = server.gui.add_folder("Would tell rivals apart", visible=False)
        self._is_shown = False
        with self._place:
            self._told = server.gui.add_html("")
            self._button = server.gui.add_button("Show its motion", color="gray", icon=viser.Icon.RUN)
        self._button.on_click(lambda _: end() if self._is_shown else show())

    def load(self, session: Session) -> None:
        """Shows what the diagnosis of the session proposes, if it does."""
        proposed = None if session.diagnosis is None else session.diagnosis.next_experiment
        can_move = session.diagnosis is not None and session.diagnosis.next_commands is not None
        self._place.visible, self._button.visible = proposed is not None, can_move
        self._told.content = "" if proposed is None else panels.next_experiment(proposed)
        self._is_shown = session.motion is not None
        self._button.label = "Back to the log" if self._is_shown else "Show its motion"


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
