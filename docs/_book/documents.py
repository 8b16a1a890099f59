"""The reference of the JSON documents, from the types of the package."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import btr

BEGIN = """# JSON documents

`--json` prints one document on the standard output. In Python, results have the same keys as attributes and as items
([btr.documents](../api/btr/documents.html)). Keys may be added in later versions. Pairs are lists of two, and what is
`None` here is `null`.

## Which verb gives what

| verb | document |
|---|---|
"""
VERBS = {
    "check": "CheckResult",
    "compare": "CompareResult",
    "diagnose": "DiagnoseResult",
    "fit": "FitResult",
    "effects": "EffectsResult",
    "coevolve": "CoevolveResult",
}


def page() -> str:
    """The documents of the verbs, then the objects in them."""
    package = Path(btr.__file__).parent
    results, objects = (sorted((package / name).glob("_*.py")) for name in ("results", "documents"))
    classes = {name: text for path in [*results, *objects] for name, text in _classes(path)}
    rows = [f"| `btr {verb} --json` | [{name}](#{name.lower()}) |" for verb, name in VERBS.items()]
    first = [classes[name] for name in VERBS.values()]
    others = [text for name, text in sorted(classes.items()) if name not in VERBS.values()]
    linked = re.compile(r"@@(\w+)@@")
    text = BEGIN + "\n".join([*rows, "", *first, *others])
    return linked.sub(lambda found: _link(found[1], classes), text)


def _link(name: str, classes: dict[str, str]) -> str:
    return f"[{name}](#{name.lower()})" if name in classes else name


def _classes(path: Path) -> Iterator[tuple[str, str]]:
    """The classes of a file that declare keys, as sections."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef):
            rows = list(_keys(node))
            if rows:
                about = " ".join((ast.get_docstring(node) or "").split("\n\n")[0].split())
                head = [f"## {node.name}", "", about.replace("|", "\\|"), *_above(node), ""]
                yield node.name, "\n".join([*head, "| key | type | what |", "|---|---|---|", *rows, ""])


def _above(node: ast.ClassDef) -> list[str]:
    names = [base.id for base in node.bases if isinstance(base, ast.Name)]
    shared = [name for name in names if name not in {"Record", "Result", "Reported"}]
    return [f" Also has the keys of @@{name}@@." for name in shared]


def _keys(node: ast.ClassDef) -> Iterator[str]:
    for key, text in zip(node.body, [*node.body[1:], None]):
        if isinstance(key, ast.AnnAssign) and isinstance(key.target, ast.Name) and not key.target.id.startswith("_"):
            kind = ast.unparse(key.annotation).replace("doc.", "").replace("|", "or").replace("[", "\\[")
            kind = re.sub(r"\b([A-Z]\w+)\b", r"@@\1@@", kind)
            yield f"| `{key.target.id}` | {kind} | {_said(text)} |"


def _said(node: ast.stmt | None) -> str:
    """The text below a key."""
    if not isinstance(node, ast.Expr) or not isinstance(node.value, ast.Constant):
        return ""
    return " ".join(str(node.value.value).split()).replace("|", "\\|")
