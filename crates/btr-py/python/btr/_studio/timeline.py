"""The slider and the button of the time that is shown."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import viser

from btr._studio.player import Player

SPEEDS = ("0.1", "0.25", "0.5", "1", "2")
# Moving the cursor sends all samples of a plot; the robot alone moves with every frame.
CURSOR_S = 0.1


class Timeline:
    """A player with its slider and its button; `shown` is called with each time that is to be shown."""

    def __init__(self, gui: Any, shown: Callable[[float], None]) -> None:
        self.player = Player(shown)
        self._shown = shown
        self._moved = 0.0
        self._slider: Any = gui.add_slider("Time (s)", 0.0, 1.0, 0.01, 0.0)
        self._button = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY)
        self._slider.on_update(self._dragged)
        self._button.on_click(lambda _: self.toggle())

    def add_speed(self, gui: Any) -> None:
        """Lets the speed be chosen."""
        speed = gui.add_dropdown("Speed", SPEEDS, initial_value="1")
        speed.on_update(lambda _: setattr(self.player, "speed", float(speed.value)))

    def end_at(self, end_s: float) -> None:
        """Sets the last time; the present one stays if there is such a time."""
        self.player.end_s = end_s
        self._slider.max = round(end_s, 2)
        self.player.time_s = min(self.player.time_s, end_s)
        self._slider.value = round(self.player.time_s, 3)

    def go_to(self, time_s: float) -> None:
        """Stops at a time, and shows it once something is loaded that has it."""
        if self.player.playing:
            self.toggle()
        self.player.time_s = time_s

    def toggle(self) -> None:
        """Lets the time run or stops it."""
        if self.player.playing:
            self.player.pause()
            self._shown(self.player.time_s)
        else:
            self.player.play()
        self._button.label = "Pause" if self.player.playing else "Play"
        self._button.icon = viser.Icon.PLAYER_PAUSE if self.player.playing else viser.Icon.PLAYER_PLAY

    def follow(self, time_s: float) -> bool:
        """Puts the slider at a time, and says whether plots are to follow: not at every frame while the time runs."""
        now = time.monotonic()
        if now - self._moved < CURSOR_S and self.player.playing:
            return False
        self._moved = now
        self._slider.value = round(time_s, 3)
        return True

    def _dragged(self, event: Any) -> None:
        # What the player shows is no drag.
        if event.client is not None:
            self.player.time_s = float(self._slider.value)
            self._shown(self.player.time_s)
