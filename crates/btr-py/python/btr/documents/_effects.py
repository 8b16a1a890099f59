"""Objects of the document of `effects`."""

from __future__ import annotations

from typing import Literal

from btr.documents._record import Record


class EffectParameter(Record):
    """A parameter of an effect."""

    name: str
    """Name, unique in its effect."""
    unit: str
    """SI unit."""
    min: float
    """Smallest sensible value, in `unit`."""
    max: float | None
    """Largest sensible value, in `unit`; None if there is no limit."""
    off: float | None
    """Value without the effect, in `unit`; None for limits (infinite) and where the model's own value holds."""
    typical: float
    """Typical value, in `unit`, where a search starts."""
    shape: bool
    """Whether it only shapes the effect, like the order of cogging, and does not switch it on."""


class EffectSpec(Record):
    """A physical effect of the library."""

    effect: str
    """Name of the effect."""
    site: Literal["joint", "link", "base", "ground", "robot"]
    """What it sits on."""
    law: str
    """Its law in one line."""
    shows: str
    """How it shows in the error of a model that lacks it."""
    source: str
    """Reference for the law."""
    alike: list[str]
    """Effects that most motions cannot tell from it."""
    starts: list[list[float]]
    """Values of its shape parameters from which a search starts."""
    parameters: list[EffectParameter]
    """Its parameters."""
