"""The code blocks of the book, how they run, and how what they print is compared.

The info string of a block says what the tests do with it:

    sh, console        is run, in the order of its page; `exit=1` if it ends with that code
    python             is run, with the names of the blocks before it
    toml               is a whole model file; with `fragment`, it is merged into robots/arm.toml, or `fragment=FILE`
    text               is what the block before it prints; `(...)` stands for lines or words that are left out
    title="NAME"       is written as that file
    no-run=REASON      is not run, for one of REASONS
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import btr

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
# Why a block is not run, and how many there may be.
REASONS = {
    "build": 4,  # builds or installs btr
    "robot": 1,  # moves a robot
    "yours": 2,  # needs files of the reader
    "cluster": 1,  # needs several machines
    "page": 2,  # serves a page until Ctrl-C
    "long": 6,  # takes minutes, or is a study
}
LANGUAGES = {"sh", "console", "python", "toml", "text", "xml"}
FENCE = re.compile(r"^(?P<indent> *)```(?P<info>[^\n`]+)\n(?P<text>.*?)^(?P=indent)```$", re.M | re.S)
ATTRIBUTE = re.compile(r'([\w-]+)(?:=(?:"([^"]*)"|(\S+)))?')
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
TOLERANCE, SMALL = 0.02, 3e-5
OMITTED = "(...)"


@dataclass(frozen=True)
class Block:
    """A block of code, and where it stands."""

    place: str
    language: str
    attributes: Mapping[str, str]
    text: str


def pages() -> list[Path]:
    """The pages that are written by hand, and the README."""
    return [ROOT / "README.md"] + [path for path in sorted(DOCS.rglob("*.md")) if "_book" not in path.parts]


def blocks(page: Path) -> Iterator[Block]:
    """The code blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    for found in FENCE.finditer(text):
        language, _, rest = found["info"].partition(" ")
        attributes = {name: quoted or plain for name, quoted, plain in ATTRIBUTE.findall(rest)}
        line = text.count("\n", 0, found.start()) + 1
        indent = re.compile(f"^{found['indent']}", re.M)
        place = f"{page.relative_to(ROOT)}:{line}"
        yield Block(place, language, attributes, indent.sub("", found["text"]))


class Reader:
    """Someone who follows a page in a folder with robots/ and examples/."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.known: dict[str, Any] = {"__name__": "__main__"}
        self.printed: str | None = None
        for name in ("robots", "examples"):
            shutil.copytree(ROOT / name, folder / name)

    def follow(self, block: Block) -> None:
        """Runs, checks or compares a block."""
        if "title" in block.attributes:
            path = self.folder / block.attributes["title"]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
        if "no-run" in block.attributes:
            self.printed = None
        elif block.language in {"sh", "console"}:
            self.printed = self._shell(block)
        elif block.language == "python" and "title" not in block.attributes:
            self.printed = self._python(block)
        elif block.language == "toml":
            self._toml(block)
        elif block.language == "text" and self.printed is not None:
            problem = difference(block.text, self.printed)
            assert problem is None, f"{block.place}: {problem}\n--- printed:\n{self.printed}"

    def _shell(self, block: Block) -> str:
        search = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        command = ["bash", "-euo", "pipefail", "-c", block.text]
        environment = {**os.environ, "PATH": search}
        run = subprocess.run(command, capture_output=True, text=True, cwd=self.folder, env=environment, check=False)
        expected = int(block.attributes.get("exit", "0"))
        assert run.returncode == expected, f"{block.place}: exit code {run.returncode}\n{run.stdout}{run.stderr}"
        return f"{run.stdout}\n{run.stderr}"

    def _python(self, block: Block) -> str:
        printed = io.StringIO()
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(printed):
            exec(compile(block.text, block.place, "exec"), self.known)
        return printed.getvalue()

    def _toml(self, block: Block) -> None:
        stated = tomllib.loads(block.text)
        beside = self.folder / block.attributes.get("title", "robots/model.toml")
        if "fragment" in block.attributes:
            beside = self.folder / (block.attributes["fragment"] or "robots/arm.toml")
            stated = merged(tomllib.loads(beside.read_text(encoding="utf-8")), stated)
        try:
            btr.Model("\n".join(f"{json.dumps(key)} = {inline(value)}" for key, value in stated.items()), beside)
        except btr.BtrError as error:
            raise AssertionError(f"{block.place}: {error}") from error


def merged(base: dict[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    """A table with the values of another one, tables in it merged and lists of tables joined."""
    result = dict(base)
    for key, value in more.items():
        old = result.get(key)
        if isinstance(old, dict) and isinstance(value, dict) and "kind" not in value:
            value = merged(old, value)
        elif isinstance(old, list) and isinstance(value, list):
            value = [*old, *value]
        result[key] = value
    return result


def inline(value: Any) -> str:
    """A value as TOML, on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {inline(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(inline(inner) for inner in value) + "]"
    return str(value).lower() if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


def difference(expected: str, printed: str) -> str | None:
    """What a text says that was not printed, line by line and in order; numbers may differ by 2 %."""
    lines = [" ".join(line.split()) for line in printed.splitlines()]
    at, may_skip = 0, True
    for line in (" ".join(line.split()) for line in expected.strip("\n").splitlines()):
        if line == OMITTED:
            may_skip = True
            continue
        ahead = range(at, len(lines)) if may_skip else range(at, min(at + 1, len(lines)))
        found = next((k for k in ahead if is_same(line, lines[k])), None)
        if found is None:
            return f"`{line}` is not printed" + ("" if may_skip else f", but `{''.join(lines[at : at + 1])}`")
        at, may_skip = found + 1, False
    return None


def is_same(expected: str, line: str) -> bool:
    """Whether a printed line is the expected one."""
    if set(expected) == {"-", " "} or (expected and set(expected) == {"-"}):
        return set(line) <= {"-", " "} and line != ""
    pattern, last = "", 0
    for found in re.finditer(rf"{re.escape(OMITTED)}|{NUMBER.pattern}", expected):
        gap = ".*" if found[0] == OMITTED else f"({NUMBER.pattern})"
        pattern += re.escape(expected[last : found.start()]) + gap
        last = found.end()
    match = re.fullmatch(pattern + re.escape(expected[last:]), line)
    if match is None:
        return False
    stated = NUMBER.findall(expected.replace(OMITTED, ""))
    return all(
        math.isclose(float(a), float(b), rel_tol=TOLERANCE, abs_tol=SMALL)
        for a, b in zip(stated, match.groups(), strict=True)
    )
