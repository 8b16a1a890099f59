"""What the studio leaves behind: the model, its report, and scripts that come to the same."""

from __future__ import annotations

import re
import shlex
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Union

from btr._btr import BtrError
from btr._studio.replay import Run
from btr._tables import cell
from btr.model import Model, loaded
from btr.results import Reported


_SAVED, _OLDER = "Saved by btr studio", "# The comments below are older: what they say may no longer hold."
_EARLIER = re.compile(rf"^# {_SAVED} from (?:.*\n)*?{re.escape(_OLDER)}\n", re.MULTILINE)


@dataclass(frozen=True)
class Saved:
    """Files that were written."""

    model: Path
    """The model file."""
    report: Path
    """The report, HTML."""
    shell: Union[Path, None]
    """The commands for a shell; None where the model, logs or laws are in memory only."""
    python: Union[Path, None]
    """The same in Python; None in the same cases."""


@dataclass(frozen=True)
class Journey:
    """How a model came about: the first model, its logs, and what was done."""

    first: Model
    """The model at the beginning."""
    runs: Sequence[Run]
    """The logs."""
    added: Sequence[str]
    """What was added to it, as `fit(add=...)` takes it."""
    is_fitted: bool
    """Whether it was fitted."""
    by_hand: Mapping[str, float]
    """Values that were set last, by name."""
    frozen: Mapping[str, float] = field(default_factory=dict)
    """Values of the parameters that were frozen in the fit, or are to be in one, by name."""

    def logs(self, *, held_out: bool) -> list[str]:
        """Absolute paths of the training or of the held-out logs: a script is run from any folder."""
        chosen = [run.path for run in self.runs if run.held_out == held_out and run.path is not None]
        return [str(Path(path).absolute()) for path in chosen]

    @property
    def model_path(self) -> str:
        """Absolute path of the first model."""
        return str(Path(self.first.path).absolute())

    @property
    def is_of_files(self) -> bool:
        """Whether all of it can be read again: no function, log or change is in memory only."""
        if self.first.laws or any(run.path is None for run in self.runs):
            return False
        try:
            return loaded(self.first.path).text == self.first.text
        except BtrError:
            return False


def save(folder: Path, model: Model, journey: Journey, report: Reported) -> Saved:
    """Writes the files into `folder`, under names of which none exists. Raises `BtrError` if one cannot be written."""
    stem = _free(folder, re.sub(r"[^\w.-]+", "_", journey.first.name).lstrip(".") or "model")
    saved = Saved(folder / f"{stem}.toml", folder / f"{stem}.html", folder / f"{stem}.sh", folder / f"{stem}.py")
    commented(model, journey).save(saved.model)
    report.report(saved.report)
    if not journey.is_of_files:
        return Saved(saved.model, saved.report, None, None)
    _write(saved.shell, shell(journey), mode=0o755)
    _write(saved.python, python(journey))
    return saved


def commented(model: Model, journey: Journey) -> Model:
    """The model with a comment at its beginning that says what was done, and that older comments may no longer hold.
    It replaces such a comment of the first model."""
    fitted = "fitted" if journey.is_fitted else ""
    added = f"{', '.join(journey.added)} added" if journey.added else ""
    by_hand, frozen = _values(journey.by_hand), _values(journey.frozen)
    parts = (added, fitted, frozen and f"frozen: {frozen}", by_hand and f"set by hand: {by_hand}")
    done = [part for part in parts if part]
    if not done:
        return model
    name = Path(journey.first.path).name
    told = f"{_SAVED} from {name}: {'; '.join(done)}."
    comment = textwrap.fill(told, 118, initial_indent="# ", subsequent_indent="# ", break_on_hyphens=False)
    lines = _EARLIER.sub("", model.text).splitlines(keepends=True)
    # Editors want the schema first, and btr its own mark next.
    before = sum(1 for _ in takewhile(lambda line: line.startswith(("#:schema", "# Written by btr")), lines))
    return model._with_text("".join([*lines[:before], f"{comment}\n{_OLDER}\n", *lines[before:]]))


def _values(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {cell(value)}" for name, value in values.items())


def moved_from(model: Model, frozen: Mapping[str, float]) -> dict[str, float]:
    """Values of frozen parameters that are not those of a model."""
    return {name: value for name, value in frozen.items() if value != model.values[name]}


def shell(journey: Journey) -> str:
    """Commands for a shell that lead from the first model to the present one."""
    first = journey.model_path
    logs, held = journey.logs(held_out=False), journey.logs(held_out=True)
    held_out = ["--held-out", *held] if held else []
    adding = [word for name in journey.added for word in ("--add", name)]
    freezing = [word for name in journey.frozen for word in ("--freeze", name)]
    is_changed = bool(journey.by_hand) or not journey.is_fitted
    report = ["--report", "result.html"]
    words = []
    moved = moved_from(journey.first, journey.frozen)
    if moved:
        words.append(_setting(first, moved, "result-start.toml", overwrite=False))
        first = "result-start.toml"
    lines = [["btr", "compare", first, *logs], ["btr", "diagnose", first, *logs, *freezing, *held_out]]
    if journey.is_fitted:
        written = ["-o", "result.toml", *(() if is_changed else report)]
        lines.append(["btr", "fit", first, *logs, *adding, *freezing, *written, *held_out])
    words += map(shlex.join, lines)
    if is_changed:
        begin = "result.toml" if journey.is_fitted else first
        words.append(_setting(begin, journey.by_hand, "result.toml", overwrite=journey.is_fitted))
    words.append(shlex.join(["btr", "compare", "result.toml", *logs, *held, *(report if is_changed else ())]))
    return "#!/bin/sh\nset -e\n" + "".join(f"{line}\n" for line in words)


def _setting(model: str, values: Mapping[str, float], path: str, *, overwrite: bool) -> str:
    """A command that writes a model with other values: `btr` itself has none that sets values alone."""
    load = f"import btr; btr.load_model({model!r}){_at(values)}.save({path!r}, overwrite={overwrite})"
    return f'"${{BTR_PYTHON:-python3}}" -c {shlex.quote(load)}'


def python(journey: Journey) -> str:
    """A Python script that leads from the first model to the present one."""
    logs, held = journey.logs(held_out=False), journey.logs(held_out=True)
    is_changed = bool(journey.by_hand) or not journey.is_fitted
    start = _at(moved_from(journey.first, journey.frozen))
    freeze = f", freeze={list(journey.frozen)!r}" if journey.frozen else ""
    fit = f"fitted = btr.fit(model, logs, held_out=held_out, add={list(journey.added)!r}{freeze})"
    return "\n".join(
        [
            "import btr",
            "",
            f"model = btr.load_model({journey.model_path!r}){start}",
            f"logs = {logs!r}",
            f"held_out = {held!r}",
            "print(btr.compare(model, logs))",
            f"print(btr.diagnose(model, logs, held_out=held_out{freeze}))",
            *([fit] if journey.is_fitted else []),
            f"result = {'fitted.model' if journey.is_fitted else 'model'}{_at(journey.by_hand)}",
            "compared = btr.compare(result, logs + held_out)",
            "print(compared)",
            'result.save("result.toml")',
            f'{"compared" if is_changed else "fitted"}.report("result.html")',
            "",
        ]
    )


def _at(values: Mapping[str, float]) -> str:
    """The call that sets values; empty without any."""
    return f".at({dict(values)!r})" if values else ""


def _free(folder: Path, name: str) -> str:
    """A name of which no file exists yet."""
    number = 1
    while True:
        stem = f"{name}-studio" if number == 1 else f"{name}-studio-{number}"
        if not any((folder / f"{stem}{ending}").exists() for ending in (".toml", ".html", ".sh", ".py")):
            return stem
        number += 1


def _write(path: Union[Path, None], text: str, mode: int = 0o644) -> None:
    if path is None:
        return
    try:
        path.write_text(text, encoding="utf-8")
        path.chmod(mode)
    except OSError as error:
        raise BtrError(f"{path}: {error.strerror}\nhelp: choose another folder") from error
