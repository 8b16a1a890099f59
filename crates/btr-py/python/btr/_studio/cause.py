"""The panel of the cause: what is missing, what was added, what is doubtful, and what would tell suspects apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import viser

from btr._studio import panels
from btr._studio.candidates import Candidate
from btr._studio.session import Session
from btr.results import DiagnoseResult

Names = Sequence[str]


class Candidates:
    """Cards of suspects and of what was added, each with buttons."""

    def __init__(
        self,
        server: viser.ViserServer,
        add: Callable[[Names], None],
        remove: Callable[[Names], None],
        preview: Callable[[Names], None],
    ) -> None:
        """`preview` is called with a suspect to show, and with none to end that."""
        self._gui, self._add, self._remove, self._preview = server.gui, add, remove, preview
        self._suspects = self._gui.add_folder("Suspects", visible=False)
        self._added = self._gui.add_folder("Added", visible=False)
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
        suspects, in_model = session.candidates, session.added
        self._suspects.visible, self._added.visible = bool(suspects), bool(in_model)
        with self._suspects:
            self._add_all([candidate for candidate in suspects if candidate.established])
            for candidate in suspects:
                self._card(candidate, is_added=False, is_shown=candidate.names == shown)
        with self._added:
            for candidate in in_model:
                self._card(candidate, is_added=True, is_shown=False)

    def _add_all(self, established: Sequence[Candidate]) -> None:
        """A button that adds all that is established, where that is more than one."""
        names = [name for candidate in established for name in candidate.names]
        if len(established) > 1:
            button = self._gui.add_button(f"Add all {len(established)}", color="violet")
            button.on_click(lambda _: self._add(names))
            self._shown.append(button)
            self.buttons.append(button)

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
        """Shows what the diagnosis of the session proposes, or why it proposes nothing that separates rivals."""
        found = session.diagnosis
        self._told.content = "" if found is None else told_next(found)
        self._place.visible = self._told.content != ""
        self._button.visible = found is not None and found.next_commands is not None
        self._is_shown = session.motion is not None
        self._button.label = "Back to the log" if self._is_shown else "Show its motion"


def told_next(found: DiagnoseResult) -> str:
    """The next experiment, or why there is none; empty without rivals."""
    if found.next_experiment is not None:
        return panels.next_experiment(found.next_experiment)
    rivals = [rival for support in [*found.effects, *found.wrong_values] for rival in support.alike]
    return panels.no_experiment(list(dict.fromkeys(rivals))) if rivals else ""


class LogDoubts:
    """What is doubtful about the logs, folded; nothing where nothing is."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._place = server.gui.add_folder("Doubts about the logs", expand_by_default=False, visible=False)
        with self._place:
            self._told = server.gui.add_html("")

    def load(self, session: Session) -> None:
        """Shows the doubts that the session knows."""
        found = session.doubts
        self._place.visible = found is not None and bool(found.findings)
        if found is not None:
            self._place.label = f"Doubts about the logs ({len(found.findings)})"
            self._told.content = panels.doubts(found)
