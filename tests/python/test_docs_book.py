"""The book builds with all its links, loads nothing from other places, and has a picture of every effect."""

import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import pytest

pytest.importorskip("material", reason="the book needs MkDocs and its theme Material")

import btr

ROOT = Path(__file__).parents[2]
LIST = re.compile(r"(?:-|\d+\.) ")


@pytest.fixture(scope="module")
def book(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built book; strict, so that a link or an anchor that is not there ends the build."""
    folder = tmp_path_factory.mktemp("book")
    command = [sys.executable, "-m", "mkdocs", "build", "--site-dir", str(folder)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=environment, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return folder


def test_nothing_is_loaded_from_other_places(book: Path) -> None:
    loads = re.compile(r"<(?:script|img|iframe|source)[^>]* src=\"([^\"]*)|<link[^>]* href=\"([^\"]*)|url\(([^)]*)")
    for path in [*book.rglob("*.html"), *book.rglob("*.css")]:
        text = path.read_text(encoding="utf-8")
        found = {first or second or third for first, second, third in loads.findall(text)}
        far = {address for address in found if re.match(r"[\"']?(?:https?:)?//", address)}
        assert not far, f"{path.relative_to(book)}: {far}"


def test_links_to_other_places_are_well_formed(book: Path) -> None:
    for path in book.rglob("*.html"):
        for address in re.findall(r'href="([a-z]+:[^"]*)"', path.read_text(encoding="utf-8")):
            parts = urlsplit(address)
            is_fine = parts.scheme == "https" and "." in parts.netloc and " " not in address
            assert is_fine or parts.scheme in {"data", "javascript"}, f"{path.relative_to(book)}: {address}"


def test_every_effect_has_its_section_and_its_picture(book: Path) -> None:
    page = (book / "reference" / "effects.html").read_text(encoding="utf-8")
    for effect in btr.effects().effects:
        assert f'id="{effect.effect}"' in page
        picture = book / "reference" / "effects" / f"{effect.effect}.svg"
        # A formula may be any law.
        assert picture.exists() or effect.effect == "formula", effect.effect
        if picture.exists():
            text = picture.read_text(encoding="utf-8")
            assert text.count("<path") > 10 and "nan" not in text and len(text) < 150_000, effect.effect


def test_the_pages_of_the_package_and_the_command_are_there(book: Path) -> None:
    assert 'id="diagnose"' in (book / "api" / "btr.html").read_text(encoding="utf-8")
    commands = (book / "reference" / "cli.html").read_text(encoding="utf-8")
    assert all(f'id="btr-{verb}"' in commands for verb in ("check", "coevolve", "compare", "diagnose", "fit", "new"))
    assert 'id="actuatorsection"' in (book / "reference" / "model-file.html").read_text(encoding="utf-8")
    assert 'id="effectreport"' in (book / "reference" / "json.html").read_text(encoding="utf-8")


def test_what_generates_the_book_is_typed_strictly(tmp_path: Path) -> None:
    pytest.importorskip("mypy", reason="types are checked with mypy")
    sources = [ROOT / "docs" / "_book", ROOT / "tests" / "python"]
    environment = {**os.environ, "MYPYPATH": os.pathsep.join(map(str, sources))}
    command = [sys.executable, "-m", "mypy", "--strict", str(sources[0]), str(sources[1] / "docs_blocks.py")]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=environment, check=False)
    assert run.returncode == 0, run.stdout


def test_links_of_plain_markdown_lead_to_files() -> None:
    """Pages are read without the book as well, also where the book generates another one in their place."""
    of_root = ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md")
    for page in [*(ROOT / "docs").rglob("*.md"), *(ROOT / name for name in of_root)]:
        for address in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            is_far = urlsplit(address).scheme != ""
            assert is_far or (page.parent / address).exists(), f"{page.relative_to(ROOT)}: {address}"


def test_lists_begin_after_an_empty_line() -> None:
    """Without it, Markdown takes the list for a paragraph."""
    for page in (ROOT / "docs").rglob("*.md"):
        is_code, before = False, ""
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            is_code ^= line.lstrip().startswith("```")
            begins = LIST.match(line) and before.strip() and not LIST.match(before) and not before.startswith("  ")
            assert is_code or not begins, f"{page.relative_to(ROOT)}:{number}"
            before = line
