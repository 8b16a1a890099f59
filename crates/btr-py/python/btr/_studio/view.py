"""What is seen of one log: the robot and its ghost in space, a channel over time, and the time that both show."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import viser

from btr._studio import panels
from btr._studio.failures import KINDS, covered, place
from btr._studio.plots import Plots
from btr._studio.replay import BASE, Replay, Run
from btr._studio.robot import Robot
from btr._studio.scene import Scene
from btr._studio.session import Session
from btr._studio.timeline import Timeline
from btr.results import CompareResult

MAGNIFIED = {"as it is": 1.0, "5 times as large": 5.0, "20 times as large": 20.0}


class View:
    """The panel of the error, and the scene. Methods may be called on any thread."""

    def __init__(self, server: viser.ViserServer, session: Session, robot: Robot, asked: Callable[[], None]) -> None:
        """`asked` is called when another log or channel was chosen."""
        self._server, self._session, self._asked = server, session, asked
        self._lock = threading.RLock()
        self._replay: Replay | None = None
        self._comparison: CompareResult | None = None
        self._scene = Scene(server, robot, floats=BASE[0] in session.replay(0).simulated)
        self._runs, self._names = session.runs, labels(session.runs)
        self.panel = server.gui.add_panel()
        with self.panel.add_tab("The error", viser.Icon.CHART_LINE):
            self._add_log()
            self._add_time()
            self._add_channel()
            self._sentence = server.gui.add_html(panels.sentence(None, ""))
            self._regimes = server.gui.add_html("")

    @property
    def run(self) -> int:
        """Number of the chosen run."""
        return self._names.index(self._log.value)

    def load(self, replay: Replay) -> None:
        """Shows a replay of the chosen run at the present time."""
        with self._lock:
            self._replay = replay
            self._scene.load(replay, self._session.model.joints, self._session.floors)
            self._time.end_at(float(replay.run.clock_s[-1]))
            channel = self._channel.value
            self._plots.load(replay, channel, self._session.floors.get(channel), self.player.time_s)
            self._scene.at(self._sample())
            proposed = "the next experiment, as the diagnosed model does it" if replay.run not in self._runs else ""
            self._failed.content = panels.note(replay.failed or proposed)

    def rest(self) -> None:
        """Shows all samples of the plots, once nothing changes."""
        with self._lock:
            if not self.player.playing:
                self._plots.at(self.player.time_s, moving=False)

    def load_comparison(self) -> None:
        """Shows where the present model fails."""
        comparison = self._session.shown.comparison
        if comparison is not self._comparison:
            self._comparison = comparison
            self._sentence.content = panels.sentence(comparison, covered(self._runs))
            self._show_map(None)
        channels = self._session.channels
        if list(self._channel.options) != channels:
            chosen = self._channel.value
            self._channel.options = channels
            self._channel.value = chosen if chosen in channels else channels[0]

    def choose_worst(self) -> None:
        """Chooses a channel of the joint that the model fails most, or else the worst channel."""
        comparison = self._session.step.comparison
        if comparison is None or not comparison.channels:
            return
        worst = {f"{kind}_{failure.joint}" for failure in comparison.failures[:1] for kind in KINDS}
        channels = [channel for channel in comparison.channels if channel.name in worst] or comparison.channels
        self._channel.value = max(channels, key=lambda channel: channel.chi or 0.0).name

    def go_to(self, number: int) -> None:
        """Shows the log, the channel and the time where a cell of the map is worst."""
        comparison = self._session.shown.comparison
        if comparison is None or number >= len(comparison.failures):
            return
        failure = comparison.failures[number]
        run, time_s = place(failure, [self._session.replay(k) for k in range(len(self._runs))])
        channels = [f"{kind}_{failure.joint}" for kind in KINDS]
        with self._lock:
            self._log.value = self._names[run]
            self._channel.value = next(filter(self._channel.options.__contains__, channels), self._channel.value)
            self._time.go_to(time_s)
        self._show_map(number)
        self._asked()

    def _show_map(self, chosen: int | None) -> None:
        joints, of = self._session.model.joints, covered(self._runs)
        self._regimes.content = panels.regimes(self._session.shown.comparison, joints, of, chosen)

    def _add_log(self) -> None:
        self._log: Any = self._server.gui.add_dropdown("Log", self._names, initial_value=self._names[0])
        self._log.on_update(lambda _: self._asked())

    def _add_time(self) -> None:
        gui = self._server.gui
        self._time = Timeline(gui, self._at)
        self.player = self._time.player
        magnify = gui.add_dropdown("Error shown", list(MAGNIFIED), initial_value="as it is")
        with gui.add_folder("Playback", expand_by_default=False):
            self._time.add_speed(gui)
            loop = gui.add_checkbox("Loop", True)
            robot, model = gui.add_checkbox("Measured", True), gui.add_checkbox("Model", True)
        gui.add_html(panels.legend())
        magnify.on_update(lambda _: self._magnify(MAGNIFIED[magnify.value]))
        loop.on_update(lambda _: setattr(self.player, "loops", bool(loop.value)))
        for box in (robot, model):
            box.on_update(lambda _: self._scene.show(robot=robot.value, model=model.value))

    def _magnify(self, factor: float) -> None:
        self._scene.magnified = factor
        self._at(self.player.time_s)

    def _add_channel(self) -> None:
        channels = self._session.channels or ["none"]
        self._channel: Any = self._server.gui.add_dropdown("Channel", channels, initial_value=channels[0])
        self._plots = Plots(self._server)
        self._failed = self._server.gui.add_html("")
        self._channel.on_update(lambda _: self._asked())

    def _sample(self) -> int:
        clock = np.zeros(1) if self._replay is None else self._replay.run.clock_s
        return int(np.clip(np.searchsorted(clock, self.player.time_s), 0, len(clock) - 1))

    def _at(self, time_s: float) -> None:
        """Shows a time."""
        with self._lock:
            if self._replay is None:
                return
            self._scene.at(self._sample())
            if self._time.follow(time_s):
                self._plots.at(time_s, moving=self.player.playing)


def labels(runs: Sequence[Run]) -> list[str]:
    """Short names of the runs, the held-out ones marked, each unique."""
    short = [run.name.replace("\\", "/").rpartition("/")[2] or run.name for run in runs]
    names = [run.name if short.count(name) > 1 else name for name, run in zip(short, runs)]
    marked = [f"{name} (held out)" if run.held_out else name for name, run in zip(names, runs)]
    return [name if marked.count(name) == 1 else f"{k + 1}: {name}" for k, name in enumerate(marked)]
