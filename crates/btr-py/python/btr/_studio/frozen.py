"""Which free parameters are frozen: a box for each, and buttons for those that may stand in for an effect."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import viser

from btr._studio import panels
from btr._studio.session import Session
from btr._tables import cell

FOLDER = "Frozen in fits"
EXPLAINED = "Fits and diagnoses keep a frozen parameter at its value: set what you know by its slider, then freeze it."
Freeze = Callable[[str, bool], None]


class Frozen:
    """A box for each parameter that can be frozen; ticked where it is."""

    def __init__(self, server: viser.ViserServer, freeze: Freeze) -> None:
        """`freeze` is called with a parameter, and whether it is to be frozen."""
        self._gui, self._freeze = server.gui, freeze
        self._place = self._gui.add_folder(FOLDER, expand_by_default=False)
        with self._place:
            self._gui.add_html(panels.note(EXPLAINED))
        self.boxes: dict[str, Any] = {}
        """The boxes by the parameter's name."""

    def load(self, session: Session) -> None:
        """Shows what is frozen in the present step."""
        names = session.freezable
        self._place.visible = bool(names)
        with self._place:
            for name in names:
                if name not in self.boxes:
                    self.boxes[name] = self._box(name)
        frozen = session.step.frozen
        for name, box in self.boxes.items():
            box.value = name in frozen
        self._place.label = f"{FOLDER} ({len(frozen)})" if frozen else FOLDER

    def _box(self, name: str) -> Any:
        box = self._gui.add_checkbox(name, False)

        async def ticked(event: Any) -> None:
            # A change by the page itself has no client. The value is read at once, as `load` after a change of another
            # box may reset this one before a worker runs. The work is done by a worker: this is the server's thread.
            if event.client is not None:
                asyncio.get_running_loop().run_in_executor(None, self._freeze, name, bool(box.value))

        box.on_update(ticked)
        return box


class StandIns:
    """Buttons below a verdict, for parameters that may stand in for an effect in it."""

    def __init__(self, server: viser.ViserServer, freeze: Callable[[str, float], None]) -> None:
        """`freeze` is called with a parameter and the value that the diagnosed model states."""
        self._gui, self._freeze = server.gui, freeze
        self._place = self._gui.add_folder("May stand in for an effect", visible=False)
        self.buttons: list[Any] = []
        """The buttons."""

    def load(self, session: Session) -> None:
        """Shows those of the diagnosis that are not frozen yet."""
        for button in self.buttons:
            button.remove()
        self.buttons = []
        found = session.diagnosis
        can = [name for name in session.freezable if name not in session.step.frozen]
        taken = [] if found is None else [stand_in for stand_in in found.stand_ins if stand_in.parameter in can]
        self._place.visible = bool(taken)
        with self._place:
            for stand_in in taken:
                self.buttons.append(self._button(stand_in.parameter, stand_in.in_model))

    def _button(self, name: str, value: float) -> Any:
        label = f"Freeze {name} at {cell(value)}"
        button = self._gui.add_button(label, color="gray", icon=viser.Icon.SNOWFLAKE)
        button.on_click(lambda _: self._freeze(name, value))
        return button
