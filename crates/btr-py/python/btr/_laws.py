"""User-defined laws that are Python functions: their names in a model's text, and how they are pickled."""

from __future__ import annotations

import importlib
import inspect
import pickle
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Union

from btr._btr import BtrError

Law = Callable[..., float]
"""`law(q, dq, ddq, cmd, tau, t, **parameters)` in SI units; see `Model.add_law`."""
Number = Union[float, tuple[float, float]]
"""A parameter of a law: its value, or the bounds of a fit."""

_VARIABLES = ("q", "dq", "ddq", "cmd", "tau", "t")


def in_text(name: str) -> str:
    """The name of a function in the text of a model."""
    return f"python:{name}"


def by_text(laws: Mapping[str, Law]) -> list[tuple[str, Law]]:
    """Functions by their names in a model's text. Raises `TypeError` for a value that is not callable."""
    if not isinstance(laws, Mapping):
        raise TypeError(f"laws are functions by name, {{'slip': slip}}, not {type(laws).__name__}")
    for name, law in laws.items():
        if not callable(law):
            raise TypeError(f"the law {name} must be a function, not {type(law).__name__}")
    return [(in_text(name), law) for name, law in laws.items()]


def name_of(law: Law, among: Mapping[str, Law]) -> str:
    """The name of a function in a model with the laws `among`. Raises `BtrError` if another law has that name."""
    name = getattr(law, "__name__", type(law).__name__)
    if among.get(name, law) is not law:
        raise BtrError(f"the model has another law called {name}\nhelp: give one of them another name, with `def`")
    return name


def numbers(parameters: Mapping[str, Number]) -> list[tuple[str, float | tuple[float, float]]]:
    """Values or bounds as floats. Raises `TypeError` for a value that is neither a number nor bounds."""
    return [(name, _number(name, given)) for name, given in parameters.items()]


def _number(name: str, given: Number) -> float | tuple[float, float]:
    try:
        if isinstance(given, (tuple, list)):
            least, most = given
            return float(least), float(most)
        return float(given)
    except (TypeError, ValueError):
        raise TypeError(f"{name} is a number or (least, most), not {given!r}") from None


def must_fit(laws: Mapping[str, Law], of_model: Sequence[tuple[str, Sequence[str]]]) -> None:
    """Raises `TypeError` for a function that cannot be called with the parameters that the model's text gives it."""
    by_name = {in_text(name): (name, law) for name, law in laws.items()}
    for text, parameters in of_model:
        if text in by_name:
            name, law = by_name[text]
            must_take(law, parameters, f"the law {name}")


def must_take(law: Law, parameters: Iterable[str], what: str = "a law") -> None:
    """Raises `TypeError` for a function that cannot be called with parameters of these names."""
    try:
        signature = inspect.signature(law)
    except ValueError:
        return  # Some functions written in C have no signature.
    try:
        signature.bind(*_VARIABLES, **dict.fromkeys(parameters))
    except TypeError as error:
        arguments = ", ".join([*_VARIABLES, *parameters])
        raise TypeError(f"{what} is called with ({arguments}), but this one has {signature}: {error}") from None


class _ByValue:
    """Pickles a function that other processes cannot import, as cloudpickle's bytes."""

    def __init__(self, law: Law) -> None:
        self._law = law

    def __reduce__(self) -> tuple[Any, tuple[bytes]]:
        cloudpickle = _cloudpickle()
        if cloudpickle is None:
            raise pickle.PicklingError(
                f"{self._law!r} cannot be imported by its name: put it in a module, or install cloudpickle"
            )
        return pickle.loads, (cloudpickle.dumps(self._law),)


def _cloudpickle() -> Any:
    """The package cloudpickle, or Ray's copy of it; None if neither is installed."""
    for name in ("cloudpickle", "ray.cloudpickle"):
        try:
            return importlib.import_module(name)
        except ImportError:
            continue
    return None


def for_pickles(laws: Mapping[str, Law]) -> dict[str, Law | _ByValue]:
    """Functions in a form that can be pickled: by name if importable, otherwise by value."""
    return {name: law if _is_importable(law) else _ByValue(law) for name, law in laws.items()}


def packed(laws: Sequence[tuple[str, Law]]) -> bytes:
    """Pickles functions for other processes. Raises `BtrError` for a function that cannot be pickled."""
    try:
        return pickle.dumps([(name, _portable(law)) for name, law in laws])
    except pickle.PicklingError as error:
        raise BtrError(f"a law cannot be sent to another process: {error}") from None


def _portable(law: Law) -> Law | _ByValue:
    # A function defined in a notebook or script is importable by name only in processes that run the same one.
    is_in_main = getattr(law, "__module__", None) == "__main__" and _cloudpickle() is not None
    return law if _is_importable(law) and not is_in_main else _ByValue(law)


def unpacked(content: bytes) -> list[tuple[str, Law]]:
    """The functions that another process packed with `packed`."""
    laws: list[tuple[str, Law]] = pickle.loads(content)
    return laws


def _is_importable(law: Law) -> bool:
    try:
        pickle.dumps(law)
    except (pickle.PicklingError, AttributeError, TypeError):
        return False
    return True
