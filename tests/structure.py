#!/usr/bin/env python3
"""Checks the shape of the source: no import circles, small folders, lines of at most 120 columns, no retired words, no
commands in the texts of the libraries, and a reason for each dependency.

    python3 tests/structure.py

Circles are looked for between files, and between the files and folders of each folder. In Rust, imports are read from
`use` declarations and paths in the code, as text; unit tests in a file are left out, and so are the declarations of a
folder's `mod.rs` (`mod x;`, `pub use x::Y`), which own the folder and import nothing. In Python, every import counts,
also in a function or for annotations only.
"""

import ast
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from importlib.util import resolve_name
from pathlib import Path
from typing import TypeVar

ROOT = Path(__file__).resolve().parent.parent
MOST_FILES = 12
LONGEST_LINE = 120

# What stands for the word now is said beside it.
RETIRED = {
    r"\babreast\b": "batch",
    r"\bBeside\b(?! )": "IdentificationProblem",
    r"\bbeneath\b": "without the effect",
    r"\bBench\b(?!mark)": "Objective",
    r"\b[Cc]limb(s|ed|ing)?\b": "record",
    r"\b[Ee]lsewhere\b": "on other machines, distributed, another place",
    r"\b[Hh]eed(s|ed|ing)?\b": "check for cancellation",
    r"\bhands at a distance\b": "executor",
    r"\bin doubt\b(?!\[)": "free",
    r"\b[Kk]in\b": "similar",
    r"\b[Kk]nobs?\b": "free parameter",
    r"\b[Ll]ikeness\b": "correlation",
    r"\bmakes? do with fewer\b": "has fewer free parameters",
    r"\b[Pp]arcels?\b": "payload",
    r"\b[Rr]ungs?\b": "step of the ladder",
    r"\bseen_from\b": "with starts at",
    r"\b(Served|ServedModel)\b": "RemoteModel, RemoteSimulator",
    r"\bshakes?\b": "perturb",
    r"\b(Wanted|Made|Against)\b(?= [{<]|::|<')": "OutputRequest, Output, Reference",
    r"\b[Ww]hoever\b": "who, or the passive",
    r"\bwho simulates\b": "executor",
}
# What only the command line calls so: a text of a library mentions it by `btr_core::text`.
LIBRARIES = ("btr-core", "btr-identify", "btr-io", "btr-lab", "btr-physics")
OF_COMMAND_LINE = re.compile(r"`btr |--(add|drive|held-out|json|log|next|out|report|resume|seed|set|threads)\b")
# The command line's own wording, the stamp of a run, and a sentence of `--json`, which is the same everywhere.
WORDS_OF_COMMAND_LINE = {"btr-core/src/text.rs", "btr-lab/src/experiment/loaded.rs", "btr-lab/src/run/augment/ask.rs"}
# A key of `btr check --json` that must hold.
KEPT = re.compile(r"\"likeness\"|likeness: float")
PYTHON = {".py", ".pyi"}
TEXT = PYTHON | {".rs", ".md", ".toml", ".sh", ".snap"}

Module = tuple[str, ...]
Node = TypeVar("Node", Module, str)


def tracked() -> list[Path]:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [ROOT / name for name in listed.splitlines() if (ROOT / name).is_file()]


def words_and_lines() -> Iterator[str]:
    """Retired words and lines that are too long."""
    for path in tracked():
        if path.suffix not in TEXT:
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            place = f"{path.relative_to(ROOT)}:{number}"
            if path.name not in {"structure.py", "CHANGELOG.md"}:
                yield from (f"{place}: {problem}" for problem in retired_words(line))
            # rustfmt wraps code in Rust and leaves comments alone.
            wrapped = path.suffix in PYTHON or (path.suffix == ".rs" and line.lstrip().startswith("//"))
            if wrapped and len(line) > LONGEST_LINE:
                yield f"{place}: {len(line)} characters, {LONGEST_LINE} at most"


def retired_words(line: str) -> Iterator[str]:
    for word, instead in RETIRED.items():
        found = re.search(word, KEPT.sub("", line))
        if found:
            yield f"`{found.group()}` is retired; say: {instead}"


def commands_in_texts() -> Iterator[str]:
    """Literals of the libraries that name commands or options; front ends word a mention themselves."""
    for path in sorted(path for library in LIBRARIES for path in (ROOT / "crates" / library / "src").rglob("*.rs")):
        if str(path.relative_to(ROOT / "crates")) in WORDS_OF_COMMAND_LINE:
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            found = OF_COMMAND_LINE.search(line)
            if found and not line.lstrip().startswith("//"):
                yield f"{path.relative_to(ROOT)}:{number}: `{found.group()}` in a text; mention it by btr_core::text"


def large_folders() -> Iterator[str]:
    count: dict[Path, int] = defaultdict(int)
    for path in tracked():
        if path.suffix == ".rs" and "src" in path.parts:
            count[path.parent] += 1
    for folder, files in sorted(count.items()):
        if files > MOST_FILES:
            yield f"{folder.relative_to(ROOT)}: {files} files, {MOST_FILES} at most"


def unexplained_dependencies() -> Iterator[str]:
    """Dependencies on what comes from others that no line says the reason of, or that are not declared in one place."""
    reason = ""
    declared = (ROOT / "Cargo.toml").read_text(encoding="utf-8").split("[workspace.dependencies]")[1].split("\n[")[0]
    for line in declared.splitlines():
        name = line.split(" = ")[0]
        if " = " in line and not line.startswith(("#", "btr-")) and len(reason) < 5:
            yield f"Cargo.toml: the line before the dependency `{name}` says what it is for"
        reason = line[1:].strip() if line.startswith("#") else ""
    for manifest in sorted([*ROOT.glob("crates/*/Cargo.toml"), ROOT / "tests/Cargo.toml"]):
        for section in re.split(r"^\[", manifest.read_text(encoding="utf-8"), flags=re.M):
            for line in section.splitlines()[1:] if "dependencies]" in section.split("\n")[0] else []:
                if line and not line.startswith("#") and "workspace = true" not in line:
                    place = manifest.relative_to(ROOT)
                    yield f"{place}: `{line.split(' ')[0]}` belongs into [workspace.dependencies], with what it is for"


class Crate:
    """The modules of a crate and what each imports."""

    def __init__(self, source: Path) -> None:
        self.name = source.parent.name.replace("-", "_")
        files = [path for path in source.rglob("*.rs") if path.name != "main.rs"]
        self.text = {module_of(path.relative_to(source)): code_of(path) for path in files}
        self.exports: dict[Module, dict[str, Module]] = defaultdict(dict)
        self.uses: dict[Module, list[tuple[Module, str, bool]]] = {m: list(self._uses(m)) for m in self.text}
        for module, uses in self.uses.items():
            self.exports[module] = {name: path for path, name, public in uses if public}

    def _uses(self, module: Module) -> Iterator[tuple[Module, str, bool]]:
        for public, tree in re.findall(r"^\s*(pub(?:\([^)]*\))? )?use ([^;]+);", self.text[module], re.M):
            for path, name in leaves(tree):
                absolute = self.absolute(module, path)
                if absolute is not None:
                    yield absolute, name, bool(public)

    def absolute(self, module: Module, path: list[str]) -> Module | None:
        """A path from the crate's root; none where it leads out of the crate."""
        match path[0]:
            case "crate" | self.name:
                return tuple(path[1:])
            case "self":
                return module + tuple(path[1:])
            case "super":
                up = next((k for k, part in enumerate(path) if part != "super"), len(path))
                return module[: len(module) - up] + tuple(path[up:])
            case first if (*module, first) in self.text:
                return module + tuple(path)
        return None

    def defines(self, path: Module, depth: int = 0) -> Module | None:
        """The module in which a path's item is defined, through re-exports."""
        for length in range(len(path), -1, -1):
            module, rest = path[:length], path[length:]
            if module not in self.text:
                continue
            behind = self.exports[module].get(rest[0]) if rest and depth < 20 else None
            return self.defines(behind + rest[1:], depth + 1) if behind else module
        return None

    def imports(self) -> dict[Module, set[Module]]:
        graph: dict[Module, set[Module]] = {module: set() for module in self.text}
        for module, text in self.text.items():
            names = {name: path for path, name, _ in self.uses[module]}
            owned = {path for path, _, public in self.uses[module] if public and path[: len(module)] == module}
            paths = [path for path, _, _ in self.uses[module] if path not in owned]
            body = re.sub(r"\buse\s+[^;]+;", "", text)
            for inline in re.findall(r"\b\w+(?:::\w+)+", body):
                first, *rest = inline.split("::")
                path = names[first] + tuple(rest) if first in names else self.absolute(module, [first, *rest])
                paths.extend([path] if path is not None else [])
            graph[module] = {defined for path in paths if (defined := self.defines(path)) not in (None, module)}
        return graph


def module_of(path: Path) -> Module:
    parts = path.with_suffix("").parts
    return parts[:-1] if parts[-1] in {"mod", "lib", "__init__"} else parts


def code_of(path: Path) -> str:
    """A file without comments, strings and unit tests."""
    text = re.sub(r"//[^\n]*", "", path.read_text(encoding="utf-8"))
    text = re.sub(r'"(?:\\.|[^"\\])*"', '""', text)
    return re.split(r"#\[cfg\(test\)\]\s*mod \w+ \{", text)[0]


def leaves(tree: str) -> Iterator[tuple[list[str], str]]:
    """The paths of a `use` tree, and the names that they get."""
    tree = tree.strip()
    group = re.fullmatch(r"([\w:]*?)(?:::)?\{(.*)\}", tree, re.S)
    if group:
        before = [part for part in group[1].split("::") if part]
        for branch in branches(group[2]):
            yield from (([*before, *path], name) for path, name in leaves(branch))
        return
    leaf = re.fullmatch(r"([\w:*]+)(?:\s+as\s+(\w+))?", tree)
    if leaf:
        path = leaf[1].removesuffix("::self").split("::")
        yield path, leaf[2] or path[-1]


def branches(group: str) -> Iterator[str]:
    depth, begin = 0, 0
    for at, character in enumerate(group + ","):
        depth += {"{": 1, "}": -1}.get(character, 0)
        if character == "," and depth == 0:
            if group[begin:at].strip():
                yield group[begin:at]
            begin = at + 1


def python_imports(package: Path) -> dict[Module, set[Module]]:
    """The modules of a Python package and what each imports."""
    files = {module_of(path.relative_to(package)): path for path in package.rglob("*") if path.suffix in PYTHON}
    graph: dict[Module, set[Module]] = {}
    for module, file in files.items():
        names: set[str] = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                here = ".".join(file.parent.relative_to(package.parent).parts)
                origin = resolve_name("." * node.level + (node.module or ""), here)
                names |= {f"{origin}.{alias.name}" for alias in node.names}
        paths = [tuple(rest) for first, *rest in (name.split(".") for name in names) if first == package.name]
        # The rest are names in a module.
        graph[module] = {path if path in files else path[:-1] for path in paths} - {module}
    return graph


def circles(graph: dict[Node, set[Node]]) -> Iterator[list[Node]]:
    """Strongly connected components of more than one node (R. Tarjan)."""
    number: dict[Node, int] = {}
    low: dict[Node, int] = {}
    stack: list[Node] = []
    found: list[list[Node]] = []

    def visit(node: Node) -> None:
        number[node] = low[node] = len(number)
        stack.append(node)
        for other in sorted(graph.get(node, ())):
            if other not in number:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], number[other])
        if low[node] == number[node]:
            component = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(component) > 1:
                found.append(sorted(component))

    for node in sorted(graph):
        if node not in number:
            visit(node)
    yield from found


def siblings(graph: dict[Module, set[Module]], folder: Module) -> dict[str, set[str]]:
    """Which file or folder in a folder imports which other one."""
    among: dict[str, set[str]] = defaultdict(set)
    depth = len(folder)

    def inside(module: Module) -> bool:
        return len(module) > depth and module[:depth] == folder

    for module in filter(inside, graph):
        among[module[depth]] |= {other[depth] for other in graph[module] if inside(other)} - {module[depth]}
    return among


def import_graphs() -> Iterator[tuple[Path, dict[Module, set[Module]]]]:
    """The source folder of every crate and Python package, and its graph of imports."""
    for source in sorted(ROOT.glob("crates/*/src")):
        yield source, Crate(source).imports()
    for initial in sorted(ROOT.glob("crates/*/python/*/__init__.py")):
        yield initial.parent, python_imports(initial.parent)


def import_circles() -> Iterator[str]:
    for source, graph in import_graphs():
        name = source.relative_to(ROOT)
        for circle in circles(graph):
            yield f"{name}: circle of files: {', '.join('/'.join(module) or 'the root' for module in circle)}"
        for folder in sorted({module[:depth] for module in graph for depth in range(len(module))}):
            for parts in circles(siblings(graph, folder)):
                yield f"{name.joinpath(*folder)}: circle: {', '.join(parts)}"


def main() -> int:
    checks = (import_circles, large_folders, words_and_lines, commands_in_texts, unexplained_dependencies)
    problems = [problem for check in checks for problem in check()]
    fine = "no circles, large folders, long lines, retired words, commands in texts or unexplained dependencies"
    print("\n".join(problems) or fine)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.setrecursionlimit(10_000)
    sys.exit(main())
