"""Points of a space, as they may be given: rows, or columns by name."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btr import _btr

Points = Union[ArrayLike, Mapping[str, ArrayLike], Any]
"""Points of a space, a row for each; or columns by name, in a mapping or a frame."""
Table = Union[NDArray[np.float64], dict[str, NDArray[np.float64]], None]
"""Points as they were given: rows, columns by name, or none."""


def table_of(points: Any) -> Table:
    if points is None:
        return None
    names = points if isinstance(points, Mapping) else getattr(points, "columns", None)
    if names is None:
        return np.asarray(points, dtype=np.float64)
    return {str(name): np.asarray(points[name], dtype=np.float64) for name in names}


def rollouts_in(table: Table) -> int:
    """How many points there are."""
    if isinstance(table, dict):
        return max((column.size for column in table.values()), default=0)
    return 0 if table is None else len(np.atleast_1d(table))


def rows_of(table: Table, model: _btr.Model, what: str, rollouts: int) -> list[list[float]] | None:
    """A row for every rollout of what is called `parameters` or `controllers`."""
    if table is None:
        return None
    of_controllers = what == "controllers"
    rows, nominal = table, model.nominal[of_controllers]
    if isinstance(rows, dict):
        rows = _filled(rows, model.places(of_controllers, list(rows), what), nominal, (what, rollouts))
    if rows.shape != (rollouts, len(nominal)):
        names = ", ".join(dim["name"] for dim in json.loads(model.spaces[of_controllers]))
        needed = f"({rollouts}, {len(nominal)}) is needed: a row of {names or 'nothing'}"
        raise ValueError(f"{what} has shape {rows.shape}, but {needed}")
    listed: list[list[float]] = rows.tolist()
    return listed


def _filled(
    columns: dict[str, NDArray[np.float64]], places: list[int], nominal: list[float], needed: tuple[str, int]
) -> NDArray[np.float64]:
    """Columns at their places, and nominal values at the others."""
    what, rollouts = needed
    rows = np.tile(np.array(nominal), (rollouts, 1))
    for place, (name, column) in zip(places, columns.items()):
        if column.shape not in ((), (rollouts,)):
            raise ValueError(f"{what}[{name!r}] has shape {column.shape}, but ({rollouts},) is needed")
        rows[:, place] = column
    return rows
