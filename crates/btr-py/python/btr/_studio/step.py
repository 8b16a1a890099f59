"""A state of the model, and what is known of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Union

from btr._studio.replay import Replay
from btr.model import Model
from btr.results import CompareResult, DiagnoseResult, FitResult

Ladder = list[tuple[str, float, Union[float, None]]]
"""Steps of the error ladder: what was done, and the errors on the training and held-out logs in noise floors."""

FITTED = "fitted"
BY_HAND = "set by hand"
PREVIEW = "preview: "


@dataclass
class Step:
    """A state of the model, to which `Session.undo` returns."""

    label: str
    """What was done."""
    model: Model
    """The model."""
    added: tuple[str, ...] = ()
    """Effects and values that were added to the first model, as `fit(add=...)` takes them."""
    fit: Union[FitResult, None] = None
    """The fit that this model comes from."""
    by_hand: dict[str, float] = field(default_factory=dict)
    """Values that were set since, by name."""
    frozen: tuple[str, ...] = ()
    """Free parameters that fits and diagnoses keep at their values from now on."""
    comparison: Union[CompareResult, None] = None
    """The error of this model; None until `Session.compare`."""
    replays: dict[int, Replay] = field(default_factory=dict)
    """Simulations so far, by the number of the run."""
    ladder: Ladder = field(default_factory=list)
    """Steps of the diagnosis of this model, or of the fit that it comes from."""
    diagnosis: Union[DiagnoseResult, None] = None
    """What this model lacks; None until `Session.diagnose`."""

    @property
    def title(self) -> str:
        """What the model is: what was added to the first one, what is frozen, and whether values were set since."""
        added = [f"+ {name}" for name in self.added] or ([FITTED] if self.fit is not None else [])
        parts = [*added, *(f"({name} frozen)" for name in self.frozen)]
        if self.label.startswith(PREVIEW):
            return PREVIEW + " ".join(parts)
        return " ".join([*parts, BY_HAND] if self.by_hand else parts) or self.label


def ladder_of(found: Union[DiagnoseResult, FitResult]) -> Ladder:
    """All steps of a result. A step by which one law takes the place of another is not told while it is computed."""
    return [(step.step, step.train, step.held_out) for step in found.error_ladder]
