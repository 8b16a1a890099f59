"""Whether a result has the keys that it declares, each with a value of its declared type."""

import copy
import json
import pickle
from collections.abc import Iterator
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

import btr
from btr import documents
from btr.documents import Record
from btr.documents._record import declared

# The document's `logs` are `log_scores` of the result, whose `logs` are paths.
RENAMED = {"logs": "log_scores"}


def mismatches(value: Any, hint: Any, where: str) -> Iterator[str]:
    """Paths of values that do not have their declared type, and of objects with other keys than declared."""
    origin, arguments = get_origin(hint), get_args(hint)
    if hint is Any or origin is Literal and value in arguments:
        return
    if origin in (Union, UnionType):
        if all(list(mismatches(value, arm, where)) for arm in arguments):
            arms = (arm for arm in arguments if arm is not NoneType)
            yield from (found for arm in arms for found in mismatches(value, arm, where))
    elif origin is list and isinstance(value, list):
        for k, item in enumerate(value):
            yield from mismatches(item, arguments[0], f"{where}[{k}]")
    elif origin is tuple and isinstance(value, list) and len(value) == len(arguments):
        for k, (item, kind) in enumerate(zip(value, arguments)):
            yield from mismatches(item, kind, f"{where}[{k}]")
    elif origin is dict and isinstance(value, dict):
        for key, item in value.items():
            yield from mismatches(item, arguments[1], f"{where}[{key!r}]")
    elif isinstance(hint, type) and issubclass(hint, Record) and type(value) is hint:
        yield from undeclared(hint, value, where)
        for key in value:
            yield from mismatches(getattr(value, key), declared(hint).get(key, Any), f"{where}.{key}")
    elif not (origin is None and type(value) in ((float, int) if hint is float else (hint,))):
        yield f"{where} is {value!r}, declared as {hint}"


def undeclared(kind: type, document: dict[str, Any], where: str, renamed: dict[str, str] = {}) -> Iterator[str]:
    """Undeclared keys, and missing required keys."""
    hints = declared(kind)
    yield from (f"{where}.{key} is not declared" for key in document if key not in hints and key not in renamed)
    missing = (key for key, hint in hints.items() if key not in document)
    yield from (f"{where}.{key} is missing" for key in missing if not (may_be_missing(hints[key])))


def may_be_missing(hint: Any) -> bool:
    return NoneType in get_args(hint) or get_origin(hint) is list


def must_be_typed(result: btr.results.Result) -> None:
    kind, document = type(result), json.loads(json.dumps(result.document))
    renamed = RENAMED if kind is btr.CoevolveResult else {}
    found = list(undeclared(kind, document, kind.__name__, renamed))
    for key in document:
        hint = list[documents.LogScore] if key in renamed else declared(kind)[key]
        value = getattr(result, renamed.get(key, key))
        found += mismatches(value, hint, f"{kind.__name__}.{key}")
        assert value == document[key] == result.document[key]
    assert not found, "\n".join(found)
    assert set(document) - set(renamed) <= set(dir(result)) and set(result) == set(document)
    again = pickle.loads(pickle.dumps(result.document))
    assert again == result.document == document and copy.deepcopy(result.document) == document
