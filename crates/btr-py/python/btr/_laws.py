"""A user's own laws as functions: what they are called in a model's text, and how pickles hold them."""

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
"""A parameter of a law: its value, or bounds between which a fit looks for it."""

_VARIABLES = ("q", "dq", "ddq", "cmd", "tau", "t")


def in_text(name: str) -> str:
    """What stands for a function in the text of a model."""
    return f"python:{name}"


def by_text(laws: Mapping[str, Law]) -> list[tuple[str, Law]]:
    """Functions by what stands for them; raises `TypeError` for what cannot be called."""
    if not isinstance(laws, Mapping):
        raise TypeError(f"laws are functions by name, {{'slip': slip}}, not {type(laws).__name__}")
    for name, law in laws.items():
        if not callable(law):
            raise TypeError(f"the law {name} is to be a function, not {type(law).__name__}")
    return [(in_text(name), law) for name, law in laws.items()]


def name_of(law: Law, among: Mapping[str, Law]) -> str:
    """What a function is called in a model that has others."""
    name = getattr(law, "__name__", type(law).__name__)
    if among.get(name, law) is not law:
        raise BtrError(f"the model has another law called {name}\nhelp: give one of them another name, with `def`")
    return name


def numbers(parameters: Mapping[str, Number]) -> list[tuple[str, float | tuple[float, float]]]:
    """The numbers as floats; raises `TypeError` for what is neither a number nor bounds."""
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
    by_stand_in = {in_text(name): (name, law) for name, law in laws.items()}
    for text, parameters in of_model:
        if text in by_stand_in:
            name, law = by_stand_in[text]
            must_take(law, parameters, f"the law {name}")


def must_take(law: Law, parameters: Iterable[str], what: str = "a law") -> None:
    """Raises `TypeError` for a function that cannot be called with parameters of these names."""
    try:
        signature = inspect.signature(law)
    except ValueError:
        return  # Some that are written in C do not say.
    try:
        signature.bind(*_VARIABLES, **dict.fromkeys(parameters))
    except TypeError as error:
        wanted = ", ".join([*_VARIABLES, *parameters])
        raise TypeError(f"{what} is called with ({wanted}), but this one has {signature}: {error}") from None


class _ByValue:
    """A function that no other program could import, as cloudpickle's bytes."""

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
    """The package, or Ray's copy of it; None where neither is there."""
    for name in ("cloudpickle", "ray.cloudpickle"):
        try:
            return importlib.import_module(name)
        except ImportError:
            continue
    return None


def for_pickles(laws: Mapping[str, Law]) -> dict[str, Law | _ByValue]:
    """Functions as pickles hold them: by their names where they can be imported."""
    return {name: law if _is_importable(law) else _ByValue(law) for name, law in laws.items()}


def packed(laws: Sequence[tuple[str, Law]]) -> bytes:
    """Functions for other processes; raises `BtrError` for one that cannot go there."""
    try:
        return pickle.dumps([(name, _travelling(law)) for name, law in laws])
    except pickle.PicklingError as error:
        raise BtrError(f"a law cannot be called elsewhere: {error}") from None


def _travelling(law: Law) -> Law | _ByValue:
    # What a notebook or script defines is there under its name only in processes that run the same one.
    is_at_home = getattr(law, "__module__", None) == "__main__" and _cloudpickle() is not None
    return law if _is_importable(law) and not is_at_home else _ByValue(law)


def unpacked(content: bytes) -> list[tuple[str, Law]]:
    """What another process packed."""
    laws: list[tuple[str, Law]] = pickle.loads(content)
    return laws


def _is_importable(law: Law) -> bool:
    try:
        pickle.dumps(law)
    except (pickle.PicklingError, AttributeError, TypeError):
        return False
    return True
