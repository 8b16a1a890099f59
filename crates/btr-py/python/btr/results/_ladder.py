"""Where in an error ladder a finding came in, and by how much the error fell with it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Union

from btr.documents import LadderStep

_FOR = " for "
"""Separates what came in at a step from what it took the place of."""


def entered(ladder: Sequence[LadderStep], names: Sequence[str]) -> Union[int, None]:
    """The last step that brings one of these names (`effect@site`) in; None if none does."""
    came_in = [step.step.partition(_FOR)[0].replace(",", " ").split() for step in ladder]
    brings = (k for k, words in enumerate(came_in) if words[:1] != ["-"] and set(words) & set(names))
    return max(brings, default=None)


def fell(ladder: Sequence[LadderStep], names: Sequence[str]) -> Union[tuple[LadderStep, LadderStep], None]:
    """The steps before and after one of these names came in; None if none did. What took the place of something has the
    fall of that as well."""
    step = entered(ladder, names)
    before = None if step is None else _before(ladder, step)
    return None if step is None or before is None else (ladder[before], ladder[step])


def _before(ladder: Sequence[LadderStep], step: int) -> Union[int, None]:
    replaced = ladder[step].step.partition(_FOR)[2].split(" + ")
    came_in = (entered(ladder[:step], [name]) for name in replaced)
    earlier = min((k for k in came_in if k is not None), default=None)
    return _before(ladder, earlier) if earlier is not None else step - 1 if step > 0 else None
