"""The API reference, generated from the docstrings: `python api.py FOLDER` builds it."""

import importlib
import inspect
import pkgutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pdoc
import pdoc.render

import btr


def public_modules() -> list[ModuleType]:
    """The package and its public submodules."""
    names = [found.name for found in pkgutil.iter_modules(btr.__path__) if not found.name.startswith("_")]
    return [btr, *(importlib.import_module(f"btr.{name}") for name in names)]


def public_names(module: ModuleType) -> Iterator[tuple[str, object]]:
    """The public names of a module with the methods and properties of its classes: the functions and classes in its
    `__all__` or, without one, those defined in it."""
    listed = getattr(module, "__all__", None)
    for name, value in vars(module).items():
        is_own = (
            name in listed
            if listed
            else not name.startswith("_") and getattr(value, "__module__", "") == module.__name__
        )
        if not is_own or not (inspect.isclass(value) or inspect.isroutine(value)):
            continue
        yield name, value
        members = vars(value).items() if inspect.isclass(value) else ()
        yield from ((f"{name}.{key}", member) for key, member in members if not key.startswith("_"))


def build(folder: Path) -> None:
    """Writes one page per module."""
    pdoc.render.configure(show_source=False)
    # The package page includes the names that the package re-exports.
    others = [module.__name__ for module in public_modules() if module.__name__.removeprefix("btr.") not in btr.__all__]
    pdoc.pdoc(*others, output_directory=folder)


if __name__ == "__main__":
    build(Path(sys.argv[1]))
