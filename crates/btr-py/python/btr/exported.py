"""Models in the files of other simulators."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Exported:
    """A model as a file of another simulator, from `Model.export`."""

    text: str
    """The file."""
    carried: list[str]
    """What it says that the model says, a line each."""
    left: list[str]
    """What of the model it does not say, a line each."""
    effects: dict[str, Any] | None
    """The effects that it does not say, in SI units; `btr.mujoco.EffectStepper` applies them. None where it says all.
    """
    advice: list[str]
    """What you may want to see to in the file, a line each: a time step longer than the model's, what default classes
    give that the model does not have."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the file, and the effects that are left beside it: `robot.xml` and `robot.effects.json`."""
        path = Path(path)
        _write_whole(path, self.text)
        if self.effects is not None:
            _write_whole(path.with_suffix(".effects.json"), json.dumps(self.effects, indent=2) + "\n")


def _write_whole(path: Path, text: str) -> None:
    """Writes a file whole or not at all."""
    beside = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        beside.write_text(text, encoding="utf-8")
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
