"""The logs of a session, as they are read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Union

from btr import _btr, _sources
from btr._btr import BtrError
from btr._sources import LogLike, Logs
from btr._studio.replay import Run
from btr.model import Model


def runs(
    model: Model, logs: Union[LogLike, Iterable[LogLike], None], left_out: list[str], *, held_out: bool
) -> Iterator[Run]:
    """The logs of a call that can be read and that the model can replay. Why others cannot goes into `left_out`."""
    for given in Logs(model._model).all(logs):
        name, source = given if isinstance(given, tuple) else (None, given)
        try:
            log = _sources.read(source, None, model._model)
        except BtrError as damage:
            if not isinstance(source, Path) or not source.exists():
                raise
            left_out.append(str(damage))
            continue
        why = _btr.unusable(model._model, log)
        if why is not None:
            left_out.append(why)
            continue
        path = str(source) if isinstance(source, Path) else None
        yield Run(name or str(log.name), log, held_out, path)
