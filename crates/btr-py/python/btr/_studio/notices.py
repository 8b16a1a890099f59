"""What runs and what was done, over the scene of every browser: panels may be scrolled away from their own words."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any, Union

import viser

from btr._studio.panels import floors
from btr._studio.replay import Errors
from btr._studio.step import Step
from btr._tables import cell
from btr.model import Model
from btr.results import DiagnoseResult

DONE_S = 8.0
"""How long it is shown what was done."""
TITLE = "btr studio"


class Notices:
    """One notice at a time: that something runs, or for a while what came of it."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._lock = threading.Lock()
        self._shown: list[Any] = []
        self._is_running = False

    def running(self, status: str) -> None:
        """Says how far the work is."""
        with self._lock:
            if not self._is_running:
                self._show(status, loading=True, with_close_button=False)
                self._is_running = True
            for notice in self._shown:
                notice.body = status

    def done(self, told: str) -> None:
        """Says what was done, and that nothing runs any more."""
        with self._lock:
            self._show(told, auto_close_seconds=DONE_S)
            self._is_running = False

    def _show(self, body: str, **how: Any) -> None:
        for notice in self._shown:
            notice.remove()
        clients = self._server.get_clients().values()
        self._shown = [client.add_notification(TITLE, body, **how) for client in clients]


def changed(step: Step, before: Errors, after: Errors) -> str:
    """What a fit has done to the model, and to its error."""
    sign, _, names = step.label.partition(" ")
    done = {"+": f"Added {names}", "-": f"Removed {names}"}.get(sign, "Fitted")
    return f"{done}: the error went {_fall(before, after)}."


def previewed(names: Sequence[str], before: Errors, after: Errors) -> str:
    """What a fit would do to the error."""
    return f"Preview of {', '.join(names)}: the error would go {_fall(before, after)}. Nothing is added."


def by_hand(errors: Errors) -> str:
    """What the error is after values were set by hand."""
    learn, held = errors
    held_out = "" if held is None else f" (held out: {floors(held)})"
    return f"Set by hand: the error is {floors(learn)} noise floors{held_out}."


def frozen(name: str, step: Step, first: Model) -> str:
    """Whether fits and diagnoses keep a parameter from now on, and what the first model has."""
    if name not in step.frozen:
        return f"{name} is free again: the next fit and diagnosis estimate it."
    value, stated = step.model.values[name], first.values[name]
    beside = "" if value == stated else f" (in the model as it stands: {cell(stated)})"
    return f"{name} is frozen at {cell(value)}{beside}: the next fit and diagnosis keep it."


def diagnosed(found: Union[DiagnoseResult, None]) -> str:
    """What a diagnosis has come to; all about it is in the panel."""
    if found is None:
        return "Diagnosis done."
    names = f" ({', '.join(found.names)})" if found.names else ""
    done = "Diagnosis cut short, so far" if found.cut_short else "Diagnosis done"
    return f"{done}: {found.verdict.replace('_', ' ')}{names}."


def _fall(before: Errors, after: Errors) -> str:
    (learn, held), (learnt, judged) = before, after
    held_out = "" if held is None else f" (held out: from {floors(held)} to {floors(judged)})"
    return f"from {floors(learn)} to {floors(learnt)} noise floors{held_out}"
