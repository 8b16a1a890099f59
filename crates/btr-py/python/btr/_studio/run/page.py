"""The page of a run: what its folder says, polled, and its real tests in space. Nothing is computed on the server's own
thread."""

from __future__ import annotations

import threading
from collections.abc import Callable

import viser

from btr._btr import BtrError
from btr._studio.replay import BASE
from btr._studio.robot import robot_of
from btr._studio.run import panels
from btr._studio.run.curves import Curves
from btr._studio.run.session import RunSession
from btr._studio.run.view import RunView
from btr._studio.server import Server
from btr._studio.work import Latest
from btr.model import Model

POLL_S = 0.5
NARROW_PX = 1000
PANEL_PX = 400


class RunPage:
    """A run in the browser."""

    def __init__(self, server: Server, session: RunSession) -> None:
        """Raises `BtrError` if the robot cannot be drawn."""
        self._server, self._session = server, session
        self._lock = threading.Lock()
        self._failed = ""
        self._ended = threading.Event()
        robot, model = robot_of(session.model), session.model
        server.guard.title = f"{session.folder.absolute().name} - btr studio"
        server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(124, 58, 237))
        self._head = server.gui.add_html("")
        with server.gui.add_folder("Conclusions", visible=False) as self._end:
            self._conclusions = server.gui.add_html("")
        self._curves = Curves(server.gui)
        with server.gui.add_folder("Parameters"):
            self._parameters = server.gui.add_html("")
        with server.gui.add_folder("Iterations"):
            self._iterations = server.gui.add_html("")
        with server.gui.add_folder("Real tests", expand_by_default=False):
            self._tests = server.gui.add_html("")
        self._redraws = Latest(self._draw)
        self._view = RunView(server, session, robot, self._redraws.ask, floats=_floats(model))
        self._place()
        self._tell()
        self._redraws.ask()
        self._watcher = threading.Thread(target=self._watch, name="btr studio run", daemon=True)
        self._watcher.start()

    def end(self) -> None:
        """Ends the page's threads."""
        self._ended.set()
        self._view.player.end()
        self._redraws.end()
        self._watcher.join(timeout=5.0)

    def _place(self) -> None:
        """The run to the right and its tests to the left; one below the other where the newest window is narrow."""
        run, tests = self._server.gui.main_panel, self._view.panel
        run.dock_right()
        run.set_width(PANEL_PX)
        tests.dock_left()
        tests.set_width(PANEL_PX)

        @self._server.on_client_connect
        def _(client: viser.ClientHandle) -> None:
            wide, high = client.camera.image_width, max(1, client.camera.image_height)
            is_narrow = wide < NARROW_PX
            if is_narrow:
                tests.dock_below(run)
            else:
                tests.dock_left()
            # The browser has laid out nothing yet: its picture is what the panels will leave.
            self._view.look_of(client, (wide - PANEL_PX * (1 if is_narrow else 2)) / high)

    def _watch(self) -> None:
        """Shows what is new, until the page ends."""
        while not self._ended.wait(POLL_S):
            is_new, before = False, self._failed
            try:
                with self._lock:
                    is_new = self._session.refresh()
                self._failed = ""
            except BtrError as error:
                # The folder may be back, or whole, at the next look.
                self._failed = str(error).partition("\n")[0]
            if is_new or self._failed != before:
                self._tell()
                self._redraws.ask()
            self._tell_head()

    def _tell(self) -> None:
        """Writes all texts and curves."""
        session = self._session
        self._tell_head()
        self._conclusions.content = panels.conclusions(session.conclusions)
        self._end.visible = len(session.conclusions) > 0
        self._curves.load(session.now)
        self._parameters.content = panels.parameters(session.courses, session.truth)
        self._iterations.content = panels.iterations(session.now)
        self._tests.content = panels.tests(session.now.tests)

    def _tell_head(self) -> None:
        session = self._session
        told = panels.head(session.name, session.now, session.age_s, self._failed)
        if told != self._head.content:
            self._head.content = told

    def _draw(self, _: Callable[[], bool]) -> None:
        with self._lock:
            self._view.load()


def _floats(model: Model) -> bool:
    """Whether the robot has a floating base."""
    try:
        return BASE[0] in model.simulate()
    except BtrError:
        return False
