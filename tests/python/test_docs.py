"""Every public name has a docstring, and the API reference contains it."""

import inspect
from pathlib import Path
from types import ModuleType

import pytest

pytest.importorskip("pdoc", reason="the API reference needs pdoc")

import api


def test_every_public_name_has_a_docstring() -> None:
    documented = {
        f"{module.__name__}.{name}": inspect.getdoc(value) or ""
        for module in api.public_modules()
        for name, value in api.public_names(module)
    }
    assert {"btr.diagnose", "btr.Log.read", "btr.Log.clock_s", "btr.results.Reported.report"} <= documented.keys()
    silent = [name for name, text in documented.items() if len(text.split()) < 3]
    assert not silent, f"without a docstring: {silent}"


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("api")
    api.build(folder)
    return folder


@pytest.mark.parametrize("module", api.public_modules(), ids=lambda module: module.__name__)
def test_the_reference_has_every_public_name(module: ModuleType, pages: Path) -> None:
    page = (pages / f"{module.__name__.replace('.', '/')}.html").read_text()
    missing = [name for name, _ in api.public_names(module) if f'id="{name}"' not in page]
    assert not missing
