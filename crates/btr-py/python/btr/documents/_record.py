"""Typed JSON objects: dictionaries whose declared keys are attributes."""

from __future__ import annotations

from functools import cache
from types import NoneType
from typing import TYPE_CHECKING, Any, get_args, get_origin, get_type_hints


class Record(dict[str, Any]):
    """A JSON object. Its declared keys are typed attributes; all keys, also undeclared ones, are items as in any
    dictionary."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """Takes what `dict` takes; nested objects become records of their declared types."""
        super().__init__(*args, **kwargs)
        hints = declared(type(self))
        for key in self.keys() & hints.keys():
            self[key] = typed(hints[key], self[key])

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *declared(type(self)), *self})

    # Hidden from type checkers, which then report attributes that are not declared.
    if not TYPE_CHECKING:

        def __getattr__(self, key: str) -> Any:
            return lookup(type(self), self, key)

        def __setattr__(self, key: str, value: Any) -> None:
            self[key] = value


def declared(kind: type) -> dict[str, Any]:
    """The type of each key that a class declares."""
    return _hints(kind)


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def lookup(kind: type, document: dict[str, Any], key: str) -> Any:
    """The value of a key, as the type that `kind` declares for it. A declared key that is missing from the document is
    None or empty if its type allows that. Raises `AttributeError` for other missing keys."""
    hint = declared(kind).get(key)
    if key not in document:
        if NoneType in get_args(hint):
            return None
        if get_origin(hint) is list:
            return []
        raise AttributeError(f"{kind.__name__} has no {key}")
    document[key] = typed(hint, document[key])
    return document[key]


def typed(hint: Any, value: Any) -> Any:
    """A JSON value with its objects as records of the declared types. Lists and dictionaries are converted in place. A
    value of another shape than declared is left as it is."""
    record, inner = _records(hint)
    if record is not None:
        return record(value) if isinstance(value, dict) and not isinstance(value, record) else value
    if inner is not None and isinstance(value, list):
        value[:] = [typed(inner, item) for item in value]
    elif inner is not None and isinstance(value, dict):
        value.update({key: typed(inner, item) for key, item in value.items()})
    return value


@cache
def _records(hint: Any) -> tuple[type[Record] | None, Any]:
    """Where a type has records: itself (or the optional value), or its elements; (None, None) for a type without
    any."""
    if isinstance(hint, type) and get_origin(hint) is None:
        return (hint, None) if issubclass(hint, Record) else (None, None)
    for argument in get_args(hint):
        record, inner = _records(argument)
        if record is not None or inner is not None:
            return (None, argument) if get_origin(hint) in (list, dict) else (record, inner)
    return None, None
