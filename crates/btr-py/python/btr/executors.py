"""Executors: threads of this process, other processes, other machines.

`executor=` of `coevolve`, `diagnose` and `fit` is `None` (all threads of this machine), a number of threads, `"ray"`,
an object with `submit` as in `concurrent.futures` (a `ProcessPoolExecutor`, a Dask `Client`), or one of the classes
here. Results are bit-identical for all executors: workers draw no random numbers, and each returns a fingerprint that
proves that it computes the same as this process at the model's current values. One result in 100 (`check_one_in`) is
computed again in this process and compared with the worker's bit by bit; a difference ends the work with an error.
So workers are of one kind: another family of processors may give other last bits. Laws that are functions
(`Model.add_law`) are sent as well, by name if they can be imported, else with cloudpickle.
"""

from __future__ import annotations

import numbers
import os
import threading
from collections.abc import Callable, Sequence
from typing import Any, Protocol, Union, runtime_checkable

from btr import _btr
from btr._optional import needed

__all__ = ["ExecutorLike", "Futures", "Executor", "Ray", "executor_of", "serve"]


_MOST_THREADS = 10_000
_MOST_SHARED = 512
_CHECK_ONE_IN = 100

# A fork has none of its parent's threads; it starts its own.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_btr.forked)


def serve(keys: Sequence[int], batch: bytes, *contents: bytes) -> bytes:
    """Computes a batch of simulations in a worker. `contents` are the payloads of these keys."""
    return _btr.serve(list(zip(keys, contents)), batch)


@runtime_checkable
class Executor(Protocol):
    """Sends batches to workers, at most `workers` at once.

    An attribute `check_one_in` says which share of the results this process computes again: one in so many, 100 where
    there is no such attribute; `None` checks none.
    """

    @property
    def workers(self) -> int:
        """Number of batches computed at once."""

    def work(self, payloads: Sequence[_btr.Payload], batch: bytes) -> bytes:
        """Computes a batch with `serve` and returns its answer. Called from `workers` threads at once."""


class Futures:
    """An object with `submit(function, *arguments)` that returns a future: a pool of `concurrent.futures`, a Dask
    `Client`.

    Payloads (model and logs) are sent with every batch, except with Dask, which gets them once (`scatter`).
    """

    def __init__(
        self, executor: Any, workers: int | None = None, *, check_one_in: int | None = _CHECK_ONE_IN
    ) -> None:
        """`workers` is the number of batches computed at once. This process computes one result in `check_one_in`
        again, none if that is `None`. Raises `TypeError` if `workers` is not given and the executor does not state
        it."""
        if not callable(getattr(executor, "submit", None)):
            kind = type(executor).__name__
            raise TypeError(f"an executor has a method submit, as those of concurrent.futures do; {kind} has none")
        self._executor = executor
        self._workers = must_be_some(_workers_of(executor) if workers is None else workers)
        self.check_one_in = share(check_one_in)
        self._shared = _Shared(self._scatter if callable(getattr(executor, "scatter", None)) else None)

    @property
    def workers(self) -> int:
        """Number of batches computed at once."""
        return self._workers

    def _scatter(self, content: bytes) -> Any:
        return self._executor.scatter(content, broadcast=False)

    def work(self, payloads: Sequence[_btr.Payload], batch: bytes) -> bytes:
        """Computes a batch with `serve` and returns its answer."""
        keys = [payload.key for payload in payloads]
        future = self._executor.submit(serve, keys, batch, *map(self._shared, payloads))
        answer: bytes = future.result()
        return answer


def must_be_some(workers: Any, what: str = "workers") -> int:
    """A number of workers or threads. Raises `ValueError` for other values."""
    if not isinstance(workers, numbers.Integral) or isinstance(workers, bool) or not 1 <= int(workers) <= _MOST_THREADS:
        raise ValueError(f"{what}={workers!r}: a whole number from 1 to {_MOST_THREADS}")
    return int(workers)


def share(check_one_in: Any) -> int | None:
    """One in how many results is checked. Raises `ValueError` for what is no whole number above 0, nor `None`."""
    if check_one_in is None:
        return None
    whole = isinstance(check_one_in, numbers.Integral) and not isinstance(check_one_in, bool)
    if not whole or not 1 <= int(check_one_in) < 2**63:
        raise ValueError(f"check_one_in={check_one_in!r}: a whole number above 0, or None to check nothing")
    return int(check_one_in)


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

    Payloads are put into Ray's object store once. If a machine is lost, another one repeats its batch with the same
    answer. A worker takes one processor.
    """

    def __init__(
        self,
        workers: int | None = None,
        *,
        retries: int = 10,
        check_one_in: int | None = _CHECK_ONE_IN,
        **init: Any,
    ) -> None:
        """Uses the cluster that Ray is connected to, or else connects with `ray.init(**init)`. `workers` is the number
        of batches computed at once, by default the number of the cluster's processors. This process computes one
        result in `check_one_in` again, none if that is `None`."""
        given = None if workers is None else must_be_some(workers)
        self.check_one_in = share(check_one_in)
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
        """Number of batches computed at once."""
        return self._workers

    def work(self, payloads: Sequence[_btr.Payload], batch: bytes) -> bytes:
        """Computes a batch with `serve` and returns its answer."""
        keys = [payload.key for payload in payloads]
        answer: bytes = self._ray.get(self._serve.remote(keys, batch, *map(self._shared, payloads)))
        return answer


class _Shared:
    """The form in which payloads are sent: their content, or the reference that `put` returned for it."""

    def __init__(self, put: Callable[[bytes], Any] | None) -> None:
        self._put = put
        self._known: dict[int, Any] = {}
        self._lock = threading.Lock()

    def __call__(self, payload: _btr.Payload) -> Any:
        if self._put is None:
            return payload.content
        with self._lock:
            # Keeps the most recently used: a long run has many real tests.
            shared = self._known.pop(payload.key, None)
            self._known[payload.key] = self._put(payload.content) if shared is None else shared
            while len(self._known) > _MOST_SHARED:
                self._known.pop(next(iter(self._known)))
            return self._known[payload.key]


ExecutorLike = Union[None, int, str, Executor, Any]
"""An executor; see the module."""


def executor_of(executor: ExecutorLike) -> int | Executor | None:
    """The executor that `executor=` selects. Raises `TypeError` or `ValueError` for other values."""
    if executor is None or (isinstance(executor, str) and executor == "threads"):
        return None
    if isinstance(executor, numbers.Real):
        return must_be_some(executor, "executor")
    if isinstance(executor, str):
        if executor == "ray":
            return Ray()
        raise ValueError(f'executor={executor!r}: "threads", "ray", a number of threads, or an object with submit')
    if isinstance(executor, Executor):
        return executor
    return Futures(executor)
