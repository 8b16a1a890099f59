"""Work that takes long: simulations that can be stopped, and redraws of which only the latest counts."""

from __future__ import annotations

import os
import threading
import traceback
from collections.abc import Callable, Sequence

from btr import _btr


class Cancelled(Exception):
    """The work was stopped on request."""


class Batches:
    """An executor (`btr.executors`) on the threads of this process, which stops between two batches of simulations."""

    check_one_in = None

    def __init__(self) -> None:
        self.done = 0
        """Number of batches computed so far."""
        self._stopped = threading.Event()

    @property
    def workers(self) -> int:
        """Number of batches computed at once."""
        return os.cpu_count() or 1

    def work(self, payloads: Sequence[_btr.Payload], batch: bytes) -> bytes:
        """Computes a batch. Raises `Cancelled` after `stop`."""
        self.must_go_on()
        answer = _btr.serve([(payload.key, payload.content) for payload in payloads], batch)
        self.done += 1
        return answer

    def stop(self) -> None:
        """Lets no further batch begin."""
        self._stopped.set()

    def must_go_on(self) -> None:
        """Raises `Cancelled` after `stop`."""
        if self._stopped.is_set():
            raise Cancelled


class Latest:
    """A thread that draws what was asked for last. Requests that came while it was drawing are left out but for the
    newest."""

    def __init__(self, draw: Callable[[Callable[[], bool]], None]) -> None:
        """`draw(is_stale)` draws; `is_stale()` says whether a newer request waits."""
        self._draw = draw
        self._asked = threading.Event()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="btr studio redraw", daemon=True)
        self._thread.start()

    def ask(self) -> None:
        """Has it drawn soon."""
        self._asked.set()

    def end(self) -> None:
        """Ends the thread."""
        self._ended = True
        self._asked.set()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while True:
            self._asked.wait()
            self._asked.clear()
            if self._ended:
                return
            try:
                self._draw(self._asked.is_set)
            except Exception:
                # The next request may do better; this one is told where the programmer looks.
                traceback.print_exc()
