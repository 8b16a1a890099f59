"""The time that is shown, and a clock that moves it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

FRAME_S = 1 / 25


class Player:
    """A time between 0 and `end_s`, which runs while `playing`. `shown` is called with each new time, on one thread."""

    def __init__(self, shown: Callable[[float], None]) -> None:
        self.time_s = 0.0
        """The present time, in s."""
        self.end_s = 1.0
        """The last time, in s."""
        self.speed = 1.0
        """Seconds of the log per second."""
        self.loops = True
        """Whether it begins again at the end."""
        self._shown = shown
        self._playing = threading.Event()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="btr studio player", daemon=True)
        self._thread.start()

    @property
    def playing(self) -> bool:
        """Whether the time runs."""
        return self._playing.is_set()

    def play(self) -> None:
        """Lets the time run, from the beginning if it is at its end."""
        if self.time_s >= self.end_s:
            self.time_s = 0.0
        self._playing.set()

    def pause(self) -> None:
        """Stops the time."""
        self._playing.clear()

    def end(self) -> None:
        """Ends the thread."""
        self._ended.set()
        self._playing.set()
        self._thread.join(timeout=5.0)

    def step(self, elapsed_s: float) -> float:
        """Moves the time by so much of the wall clock, and returns it."""
        later = self.time_s + self.speed * elapsed_s
        if later > self.end_s:
            later = later % self.end_s if self.loops and self.end_s > 0 else self.end_s
            if not self.loops:
                self.pause()
        self.time_s = later
        return later

    def _run(self) -> None:
        while self._playing.wait() and not self._ended.is_set():
            begun = time.monotonic()
            self._shown(self.step(FRAME_S))
            # A slow page shows fewer pictures, not a slower robot.
            spent = time.monotonic() - begun
            if spent > FRAME_S:
                self.step(spent - FRAME_S)
            else:
                time.sleep(FRAME_S - spent)
