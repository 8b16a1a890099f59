"""Who does the work: threads of this process, other processes, other machines.

`executor=` of `coevolve`, `diagnose` and `fit` is `None` (all threads of this machine), a number of threads, `"ray"`,
anything with `submit` as in `concurrent.futures` (a `ProcessPoolExecutor`, a Dask `Client`), or one of the classes here. What
comes out is the same, bit by bit, whoever does the work: no random number is drawn by workers, and each of them proves that
it computes what is computed here. Laws that are functions (`Model.add_law`) go along, by their names where they can be
imported, else with cloudpickle's help.
"""

from __future__ import annotations

import numbers
import os
import threading
from collections.abc import Callable, Sequence
from typing import Any, Protocol, Union, runtime_checkable

from btr import _btr
from btr._optional import needed

__all__ = ["ExecutorLike", "Futures", "Hands", "Ray", "hands_of", "serve"]


_MOST_THREADS = 10_000
_MOST_SHARED = 512

# A fork has none of its parent's threads: it works with its own.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_btr.forked)


def serve(keys: Sequence[int], batch: bytes, *contents: bytes) -> bytes:
    """Answers a batch of simulations; called wherever the work is done. `contents` are the payloads of these keys."""
    return _btr.serve(list(zip(keys, contents)), batch)


@runtime_checkable
class Hands(Protocol):
    """Hands out batches, as many at once as there are `workers`."""

    @property
    def workers(self) -> int:
        """How many batches are worked on at once."""

    def work(self, payloads: Sequence[_btr.Payload], batch: bytes) -> bytes:
        """What `serve` answers to a batch; waits for it. Called from `workers` threads at once."""


class Futures:
    """Anything with `submit(function, *arguments)` that gives a future: a pool of `concurrent.futures`, a Dask `Client`.

    What a worker must know (model and logs) goes along with every batch, but with Dask, which is told once (`scatter`).
    """

    def __init__(self, executor: Any, workers: int | None = None) -> None:
        """`workers` is how many batches are worked on at once; raises `TypeError` where that is not given and cannot be found
        out."""
        if not callable(getattr(executor, "submit", None)):
            kind = type(executor).__name__
            raise TypeError(f"an executor has a method submit, as those of concurrent.futures do; {kind} has none")
        self._executor = executor
        self._workers = must_be_some(_workers_of(executor) if workers is None else workers)
        self._shared = _Shared(self._scatter if callable(getattr(executor, "scatter", None)) else None)

    @property
    def workers(self) -> int:
        """How many batches are worked on at once."""
        return self._workers

    def _scatter(self, content: bytes) -> Any:
        return self._executor.scatter(content, broadcast=False)

    def work(self, payloads: Sequence[_btr.Payload], batch: bytes) -> bytes:
        """What `serve` answers to a batch."""
        keys = [payload.key for payload in payloads]
        future = self._executor.submit(serve, keys, batch, *map(self._shared, payloads))
        answer: bytes = future.result()
        return answer


def must_be_some(workers: Any, what: str = "workers") -> int:
    """A number of workers or threads; raises `ValueError` for what is none."""
    if not isinstance(workers, numbers.Integral) or isinstance(workers, bool) or not 1 <= int(workers) <= _MOST_THREADS:
        raise ValueError(f"{what}={workers!r}: a whole number from 1 to {_MOST_THREADS}")
    return int(workers)


def _workers_of(executor: Any) -> int:
    known = getattr(executor, "_max_workers", None)
    if known is None and callable(getattr(executor, "ncores", None)):
        known = sum(executor.ncores().values())
    if not isinstance(known, int):
        kind = type(executor).__name__
        raise TypeError(f"how many workers does this {kind} have? btr.executors.Futures(executor, workers=8)")
    return known


class Ray:
    """The machines of a Ray cluster (`pip install btr[ray]`), with btr of the same version on each.

    What workers must know lies in Ray's object store, once. A batch whose machine was lost is done again by another one, with
    the same answer. A worker takes one processor.
    """

    def __init__(self, workers: int | None = None, *, retries: int = 10, **init: Any) -> None:
        """Uses the cluster that Ray is connected to, or else connects with `ray.init(**init)`. `workers` is how many batches
        are worked on at once: as many as the cluster has processors, unless given."""
        given = None if workers is None else must_be_some(workers)
        ray = needed("ray", "ray")
        if not ray.is_initialized():
            ray.init(**{"log_to_driver": False, **init})
        self._ray = ray
        self._serve = ray.remote(num_cpus=1, max_retries=retries)(serve)
        processors = int(ray.cluster_resources().get("CPU", 1))
        self._workers = max(1, processors) if given is None else given
        self._shared = _Shared(ray.put)

    @property
    def workers(self) -> int:
        """How many batches are worked on at once."""
        return self._workers

    def work(self, payloads: Sequence[_btr.Payload], batch: bytes) -> bytes:
        """What `serve` answers to a batch."""
        keys = [payload.key for payload in payloads]
        answer: bytes = self._ray.get(self._serve.remote(keys, batch, *map(self._shared, payloads)))
        return answer


class _Shared:
    """What payloads are handed over as: their content, or what `put` made of it, once."""

    def __init__(self, put: Callable[[bytes], Any] | None) -> None:
        self._put = put
        self._known: dict[int, Any] = {}
        self._lock = threading.Lock()

    def __call__(self, payload: _btr.Payload) -> Any:
        if self._put is None:
            return payload.content
        with self._lock:
            # The last ones used stay: a long run has many real tests.
            shared = self._known.pop(payload.key, None)
            self._known[payload.key] = self._put(payload.content) if shared is None else shared
            while len(self._known) > _MOST_SHARED:
                self._known.pop(next(iter(self._known)))
            return self._known[payload.key]


ExecutorLike = Union[None, int, str, Hands, Any]
"""Who does the work; see the module."""


def hands_of(executor: ExecutorLike) -> int | Hands | None:
    """What `executor=` means; raises `TypeError` or `ValueError` where that is nothing."""
    if executor is None or (isinstance(executor, str) and executor == "threads"):
        return None
    if isinstance(executor, numbers.Real):
        return must_be_some(executor, "executor")
    if isinstance(executor, str):
        if executor == "ray":
            return Ray()
        raise ValueError(f'executor={executor!r}: "threads", "ray", a number of threads, or an object with submit')
    if isinstance(executor, Hands):
        return executor
    return Futures(executor)
