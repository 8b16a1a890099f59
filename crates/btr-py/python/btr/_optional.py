"""Libraries that only some of btr needs."""

import importlib
from typing import Any


def needed(library: str, extra: str) -> Any:
    """The library, imported; raises `ImportError` with what to install where it is missing."""
    try:
        return importlib.import_module(library)
    except ImportError as error:
        raise ImportError(f"this needs {library}: pip install 'btr[{extra}]'") from error
