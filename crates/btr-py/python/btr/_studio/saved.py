"""What the studio leaves behind: the model, its report, and scripts that come to the same."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Union

from btr._btr import BtrError
from btr._studio.replay import Run
from btr.model import Model
from btr.results import Reported


@dataclass(frozen=True)
class Saved:
    """Files that were written."""

    model: Path
    """The model file."""
    report: Path
    """The report, HTML."""
    shell: Union[Path, None]
    """The commands for a shell; None where logs or laws are in memory only."""
    python: Union[Path, None]
    """The same in Python; None in the same cases."""


def save(
    folder: Path,
    first: Model,
    runs: Sequence[Run],
    model: Model,
    added: Sequence[str],
    by_hand: Mapping[str, float],
    report: Reported,
) -> Saved:
    """Writes the files into `folder`, under names of which none exists. Raises `BtrError` if one cannot be written."""
    stem = _free(folder, re.sub(r"[^\w.-]+", "_", first.name).lstrip(".") or "model")
    saved = Saved(folder / f"{stem}.toml", folder / f"{stem}.html", folder / f"{stem}.sh", folder / f"{stem}.py")
    model.save(saved.model)
    report.report(saved.report)
    if model.laws or any(run.path is None for run in runs):
        return Saved(saved.model, saved.report, None, None)
    _write(saved.shell, shell(first, runs, added, by_hand))
    _write(saved.python, python(first, runs, added, by_hand))
    return saved


def shell(first: Model, runs: Sequence[Run], added: Sequence[str], by_hand: Mapping[str, float]) -> str:
    """Commands for a shell that lead from the first model to the present one."""
    logs, held = _paths(runs, held_out=False), _paths(runs, held_out=True)
    held_out = ["--held-out", *held] if held else []
    adding = [word for name in added for word in ("--add", name)]
    fit = ["btr", "fit", str(first.path), *logs, *adding, "-o", "fitted.toml", "--report", "fitted.html", *held_out]
    hand = [word for name, value in by_hand.items() for word in ("--set", f'parameters."{name}".value={value!r}')]
    lines = [
        ["btr", "compare", str(first.path), *logs],
        ["btr", "diagnose", str(first.path), *logs, *held_out],
        fit,
        ["btr", "compare", "fitted.toml", *(held or logs), *hand],
    ]
    return "#!/bin/sh\nset -e\n" + "".join(f"{shlex.join(line)}\n" for line in lines)


def python(first: Model, runs: Sequence[Run], added: Sequence[str], by_hand: Mapping[str, float]) -> str:
    """A Python script that leads from the first model to the present one."""
    logs, held = _paths(runs, held_out=False), _paths(runs, held_out=True)
    hand = f".at({dict(by_hand)!r})" if by_hand else ""
    return "\n".join(
        [
            "import btr",
            "",
            f"model = btr.load_model({str(first.path)!r})",
            f"logs = {logs!r}",
            f"held_out = {held!r}",
            "print(btr.compare(model, logs))",
            "print(btr.diagnose(model, logs, held_out=held_out))",
            f"fitted = btr.fit(model, logs, held_out=held_out, add={list(added)!r})",
            f"found = fitted.model{hand}",
            "print(btr.compare(found, held_out or logs))",
            'found.save("fitted.toml")',
            'fitted.report("fitted.html")',
            "",
        ]
    )


def _paths(runs: Sequence[Run], *, held_out: bool) -> list[str]:
    return [run.path for run in runs if run.held_out == held_out and run.path is not None]


def _free(folder: Path, name: str) -> str:
    """A name of which no file exists yet."""
    number = 1
    while True:
        stem = f"{name}-studio" if number == 1 else f"{name}-studio-{number}"
        if not any((folder / f"{stem}{ending}").exists() for ending in (".toml", ".html", ".sh", ".py")):
            return stem
        number += 1


def _write(path: Union[Path, None], text: str) -> None:
    if path is None:
        return
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise BtrError(f"{path}: {error.strerror}\nhelp: choose another folder") from error
