"""The panel of the real tests, and the scene: which test, what it measured, and the time that is shown."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Union

import viser

from btr._studio.panels import note
from btr._studio.robot import Robot
from btr._studio.run import panels
from btr._studio.run.curves import TestPlot
from btr._studio.run.folder import best_of, fitness_of, test_name
from btr._studio.run.motion import Motion, motion_of
from btr._studio.run.scene import RunScene
from btr._studio.run.session import RunSession, Tested
from btr._studio.run.strip import Walker, merits
from btr._studio.timeline import Timeline
from btr.documents import TestEntry
from btr.model import Model

SIDE_BY_SIDE = "all side by side"
MOST_WALKERS = 12


class RunView:
    """The real tests. `load` is called on one thread, the others on any."""

    def __init__(
        self,
        server: viser.ViserServer,
        session: RunSession,
        robot: Robot,
        asked: Callable[[], None],
        *,
        floats: bool,
    ) -> None:
        """`asked` is called when another test or channel was chosen."""
        self._session, self._robot, self._asked = session, robot, asked
        self._lock = threading.RLock()
        self._test: Union[Tested, None] = None
        self._shown: tuple[Any, ...] = ()
        self._motions: dict[int, Motion] = {}
        self._model: Union[Model, None] = None
        self._scene = RunScene(server, robot, session.model.joints, floats=floats)
        self.panel = server.gui.add_panel()
        with self.panel.add_tab("Real tests", viser.Icon.ROBOT):
            self._add(server.gui)

    def _add(self, gui: Any) -> None:
        self._choice: Any = gui.add_dropdown("Shown", [SIDE_BY_SIDE], initial_value=SIDE_BY_SIDE)
        self._time = Timeline(gui, self._at)
        self.player = self._time.player
        self._time.add_speed(gui)
        gui.add_html(panels.legend())
        self._told = gui.add_html("")
        self._channel: Any = gui.add_dropdown("Channel", ["none"], initial_value="none", visible=False)
        self._plot = TestPlot(gui)
        self._plot.show(False)
        self._controller = gui.add_html("")
        self._choice.on_update(lambda _: self._asked())
        self._channel.on_update(lambda _: self._asked())

    def load(self) -> None:
        """Shows the chosen test, or all of them, as the session has them now."""
        tests = self._session.now.done
        names = {SIDE_BY_SIDE: None, **{_name(test): test for test in tests}}
        if list(self._choice.options) != list(names):
            chosen = self._choice.value
            self._choice.options = list(names)
            self._choice.value = chosen if chosen in names else SIDE_BY_SIDE
        if self._model is not self._session.model:
            self._model, self._motions = self._session.model, {}
        chosen_test = names.get(self._choice.value)
        if chosen_test is None:
            self._load_strip(tests)
        else:
            self._load_test(chosen_test)
        self._show_controller(chosen_test or best_of(tests))

    def _show_controller(self, test: Union[TestEntry, None]) -> None:
        """Shows what the controller of a test is: of the chosen one, or of the best one."""
        dims = self._session.model.controllers
        self._controller.content = "" if test is None else panels.controller(_name(test), dims, test.trial.controller)

    def _load_strip(self, tests: list[TestEntry]) -> None:
        shown = chosen(tests)
        motions = {test.trial.number: motion for test in shown if (motion := self._motion(test)) is not None}
        if not self._is_new(("strip", *motions)):
            return
        rank = merits({test.trial.number: fitness_of(test) for test in tests})
        numbers = [test for test in shown if test.trial.number in motions]
        walkers = [Walker(_lane(t), motions[t.trial.number], rank[t.trial.number]) for t in numbers]
        with self._lock:
            self._test = None
            self._scene.show_strip(walkers)
            self._began(self._scene.strip.end_s)
        self._channel.visible = False
        self._plot.show(False)
        left_out = len(tests) - len(walkers)
        few = f"the best one and the latest; {left_out} of {len(tests)} are not shown" if left_out else ""
        self._told.content = note(few if walkers else "no real test with a log so far")

    def _load_test(self, entry: TestEntry) -> None:
        test = self._session.tested(entry)
        if test is None:
            self._told.content = note("the log of this test is not in the folder")
            return
        self._choose_channels(test)
        with self._lock:
            if self._is_new(("test", entry.trial.number, test.after is None, self._channel.value, id(self._model))):
                is_other = self._test is None or self._test.entry.trial.number != entry.trial.number
                self._test = test
                self._plot.load(test, self._channel.value, self.player.time_s)
                self._scene.show_test(test)
                self._began(float(test.run.clock_s[-1]), look=is_other)
        self._plot.show(True)
        failed = [f"{when}: {replay.failed}" for when, replay in _simulations(test) if replay.failed]
        waits = [] if test.after is not None else ["its iteration is not closed: no simulation after it so far"]
        self._told.content = note("\n".join([*failed, *waits]))

    def _is_new(self, shown: tuple[Any, ...]) -> bool:
        """Whether something else was shown before."""
        before, self._shown = self._shown, shown
        return before != shown

    def _began(self, end_s: float, *, look: bool = True) -> None:
        self._time.end_at(max(0.01, end_s))
        if look:
            self._scene.look()
        self._at(self.player.time_s)

    def _choose_channels(self, test: Tested) -> None:
        channels = test.channels
        if list(self._channel.options) != channels:
            before = self._channel.value
            self._channel.options = channels
            self._channel.value = before if before in channels else channels[0]
        self._channel.visible = True

    def _motion(self, test: TestEntry) -> Union[Motion, None]:
        number = test.trial.number
        if number not in self._motions:
            known = self._session.tested(test)
            if known is None:
                return None
            self._motions[number] = motion_of(self._robot, self._session.model.joints, known.after or known.before)
        return self._motions[number]

    def look_of(self, client: viser.ClientHandle, aspect: float) -> None:
        """Lets a browser look at what is shown; its picture has this width per height."""
        with self._lock:
            self._scene.look_of(client, aspect)

    def _at(self, time_s: float) -> None:
        """Shows a time."""
        with self._lock:
            self._scene.at(time_s)
            if self._time.follow(time_s) and self._test is not None:
                self._plot.at(time_s)


def chosen(tests: list[TestEntry]) -> list[TestEntry]:
    """The tests that are shown side by side: the best one and the latest, in their order."""
    if len(tests) <= MOST_WALKERS:
        return tests
    best, latest = best_of(tests), tests[-MOST_WALKERS:]
    return latest if best is None or best in latest else [best, *latest[1:]]


def _name(test: TestEntry) -> str:
    return f"{test_name(test.trial.number)} (iteration {test.trial.iteration})"


def _lane(test: TestEntry) -> str:
    fitness = fitness_of(test)
    return test_name(test.trial.number) + ("" if fitness is None else f": {fitness:.4g}")


def _simulations(test: Tested) -> list[tuple[str, Any]]:
    after = [] if test.after is None else [("after", test.after)]
    return [("before", test.before), *after]
