"""MkDocs hook: pages that are generated when the book is built, and the attributes of code blocks.

Needs the installed package `btr`, as the reference is made of what it says about itself."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parents[2]
# MkDocs restores the path once this file is imported.
sys.path += [str(ROOT / "tests" / "python"), str(ROOT / "docs" / "_book")]

import api
import cli
import documents
import effects
import schema

# What is said in an info string for the tests of the book alone.
FOR_TESTS = re.compile(r"^( *```\w+)(.*)$", re.M)
# A module of the package, in whose place the book has its reference.
SOURCE = re.compile(r"\]\((?:\.\./)+crates/btr-py/python/btr/(?:__init__|(\w+)(?:/__init__)?)\.py")
TITLE = re.compile(r' title="[^"]*"')
# Files of the root that are pages of the book.
OF_ROOT = {name: f"development/{name.lower()}" for name in ("CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md")}
OF_ROOT["ARCHITECTURE.md"] = "development/architecture.md"


def on_files(files: Any, config: Any) -> Any:
    """Adds what is generated."""
    pages: dict[str, str | bytes] = {}
    for name, page in OF_ROOT.items():
        pages[page] = _from_root((ROOT / name).read_text(encoding="utf-8"))
    pages["reference/model-file.md"] = schema.page(ROOT / "btr.schema.json")
    pages["reference/cli.md"] = cli.page()
    pages["reference/json.md"] = documents.page()
    pages |= effects.pages(ROOT / "robots")
    pages |= _api()
    for path, content in sorted(pages.items()):
        # Below docs/ is a page that says where to find this one without the book.
        if (stands_for := files.get_file_from_path(path)) is not None:
            files.remove(stands_for)
        files.append(File.generated(config, path, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Leaves a block its language and its title, and leads links to files outside docs/ to their pages."""
    up = "../" * page.file.src_uri.count("/")
    for name, of_book in OF_ROOT.items():
        markdown = markdown.replace(f"]({up}../{name}", f"]({up}{of_book}")
    markdown = SOURCE.sub(lambda found: f"]({up}api/btr{'/' + found[1] if found[1] else ''}.html", markdown)
    return FOR_TESTS.sub(lambda found: found[1] + "".join(TITLE.findall(found[2])), markdown)


def _from_root(text: str) -> str:
    """A file of the root, with its links as seen from the folder of its page, and an empty line before each list."""
    text = re.sub(r"\]\(docs/", "](../", text)
    return re.sub(r"^((?!- |\d+\. |  |#).+\n)(?=- |1\. )", r"\1\n", text, flags=re.M)


def _api() -> dict[str, str | bytes]:
    """The API reference of the package."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        api.build(folder)
        found = (path for path in folder.rglob("*") if path.suffix in {".html", ".js"} and path.name != "index.html")
        return {f"api/{os.fspath(path.relative_to(folder))}": path.read_bytes() for path in found}
