"""The page: its panels, and what its buttons do. Nothing is computed on the server's own thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import viser

from btr._btr import BtrError
from btr._studio import panels
from btr._studio.cause import Candidates, LogDoubts, Names, NextExperiment
from btr._studio.frozen import Frozen, StandIns
from btr._studio.notices import Notices, by_hand, changed, diagnosed, frozen, previewed
from btr._studio.robot import Robot
from btr._studio.saved import python, shell
from btr._studio.server import Server
from btr._studio.session import Session
from btr._studio.sliders import Sliders
from btr._studio.step import Step
from btr._studio.view import View
from btr._studio.work import Cancelled, Latest

GHOST_PARTS = 10
GHOST_S = 3.0
NARROW_PX = 1000
IDLE_S = 0.8


class Page:
    """A session in the browser."""

    def __init__(self, server: Server, session: Session, robot: Robot) -> None:
        self._server, self._session = server, session
        self._changes: dict[str, float] = {}
        self._lock = threading.Lock()
        self._job: threading.Thread | None = None
        self._status = ""
        self._was_set = False
        self._is_busy = False
        self._showing = threading.RLock()
        self._notices = Notices(server)
        self._checks = threading.Thread(target=self._check, name="btr studio check", daemon=True)
        self._redraws = Latest(self._draw)
        self._comparisons = Latest(self._compare)
        server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(124, 58, 237))
        self._add_cause()
        self._view = View(server, session, robot, self._redraws.ask)
        self._place()
        server.guard.clicked = self._on_failure
        server.guard.title = f"{session.model.name} - btr studio"
        self._redraws.ask()
        self._checks.start()

    def end(self) -> None:
        """Ends what runs, and the page's threads."""
        self._session.cancel()
        self._view.player.end()
        self._redraws.end()
        self._comparisons.end()
        for thread in (self._job, self._checks):
            if thread is not None:
                thread.join(timeout=5.0)

    def _place(self) -> None:
        """The cause to the right and the error to the left; one below the other where the newest window is narrow."""
        cause = self._server.gui.main_panel
        cause.dock_right()
        cause.set_width(400)
        self._place_left()

        @self._server.on_client_connect
        def _(client: viser.ClientHandle) -> None:
            if client.camera.image_width < NARROW_PX:
                self._view.panel.dock_below(cause)
            else:
                self._place_left()

    def _place_left(self) -> None:
        self._view.panel.dock_left()
        # Below the other panel it had that one's width.
        self._view.panel.set_width(400)

    def _add_cause(self) -> None:
        gui = self._server.gui
        gui.add_html(panels.WIDER)
        self._head = gui.add_html(panels.head(self._session.model.name, self._session.step.title, None, None))
        self._ask = gui.add_button("What is missing?", color="violet", icon=viser.Icon.SEARCH)
        self._cancel = gui.add_button("Cancel", color="red", icon=viser.Icon.X, visible=False)
        self._told = gui.add_html("")
        self._verdict = gui.add_html("")
        self._stand_ins = StandIns(self._server, self._on_freeze_at)
        self._doubts = LogDoubts(self._server)
        self._undo = gui.add_button("Undo", color="gray", icon=viser.Icon.ARROW_BACK_UP, disabled=True)
        self._redo = gui.add_button("Redo", color="gray", icon=viser.Icon.ARROW_FORWARD_UP, visible=False)
        self._candidates = Candidates(self._server, self._on_add, self._on_remove, self._on_preview)
        self._next = NextExperiment(self._server, self._on_motion, self._on_end)
        self._sliders = Sliders(self._server, self._on_value, self._notices.done)
        self._fit = gui.add_button("Fit all", color="gray", icon=viser.Icon.ADJUSTMENTS)
        self._bounds = gui.add_html("")
        self._frozen = Frozen(self._server, self._on_freeze)
        self._frozen.load(self._session)
        self._save = gui.add_button("Save model, report and scripts", color="gray", icon=viser.Icon.DEVICE_FLOPPY)
        self._saved = gui.add_html("")
        with gui.add_folder("The same without this page", expand_by_default=False):
            self._commands = gui.add_html("")
        self._ask.on_click(lambda _: self._start("simulating suspects", self._diagnose))
        self._cancel.on_click(lambda _: self._session.cancel())
        self._undo.on_click(lambda _: self._on_move(self._session.undo, "Undone"))
        self._redo.on_click(lambda _: self._on_move(self._session.redo, "Done again"))
        self._fit.on_click(lambda _: self._start("fitting", lambda: self._fitted(self._session.fit)))
        self._save.on_click(lambda _: self._start("saving", self._write))

    # What the buttons do.

    def _on_add(self, names: Names) -> None:
        self._start("fitting", lambda: self._fitted(lambda told: self._session.add(names, told)))

    def _on_remove(self, names: Names) -> None:
        self._start("fitting", lambda: self._fitted(lambda told: self._session.remove(names, told)))

    def _on_preview(self, names: Names) -> None:
        if not names:
            self._on_end()
            return
        self._start("fitting", lambda: self._previewed(names))

    def _on_motion(self) -> None:
        self._start("simulating", self._shown_motion)

    def _on_end(self) -> None:
        """Ends a preview or a shown motion."""
        self._session.show_step()
        self._changed(self._session.step)

    def _on_failure(self, number: int) -> None:
        """Shows where a cell of the map is worst."""
        if self._session.motion is not None:
            self._on_end()
        self._view.go_to(number)

    def _on_move(self, move: Callable[[], Step], told: str) -> None:
        """Goes to another step of the history."""
        if self._is_busy:
            return
        step = move()
        self._changed(step)
        self._notices.done(f"{told}. The model now: {step.title}.")

    def _on_freeze(self, name: str, is_frozen: bool) -> None:
        if self._is_busy:
            # A click just before the boxes were disabled.
            self._frozen.load(self._session)
            return
        self._set_values()
        step = self._session.freeze(name) if is_frozen else self._session.free(name)
        self._changed(step)
        self._notices.done(frozen(name, step, self._session.history[0].model))

    def _on_freeze_at(self, name: str, value: float) -> None:
        """Freezes a parameter at a value that the present model may not have."""
        if self._session.model.values[name] != value and not self._is_busy:
            self._session.set_values({name: value})
        self._on_freeze(name, True)

    def _on_value(self, name: str, value: float) -> None:
        with self._lock:
            self._changes[name] = value
        self._saved.content = ""
        self._redraws.ask()

    # Each says what was done.

    def _diagnose(self) -> str:
        self._session.diagnose(self._tell)
        self._changed(self._session.step)
        return diagnosed(self._session.diagnosis)

    def _previewed(self, names: Names) -> str:
        preview, step = self._session.preview(names, self._tell), self._session.step
        self._changed(step)
        return previewed(names, self._session.errors(step), self._session.errors(preview))

    def _shown_motion(self) -> str:
        self._session.show_motion()
        self._changed(self._session.step)
        return "Shown: the motion of the next experiment."

    def _fitted(self, work: Callable[[Callable[[], None]], Step]) -> str:
        """Fits, then moves the ghost to where the fit has it, and the errors with it."""
        before = self._session.step
        step = work(self._tell)
        until = time.monotonic() + GHOST_S
        for model in self._session.between(before, GHOST_PARTS):
            if time.monotonic() < until:
                replays = self._session.replays_of(model)
                self._view.load(replays[self._view.run])
                self._head.content = self._told_errors(step, *self._session.errors_of(replays))
        self._changed(step)
        return changed(step, self._session.errors(before), self._session.errors(step))

    def _write(self) -> str:
        was_preview = self._session.previewed is not None
        saved = self._session.save()
        self._changed(self._session.step)
        head = "saved, without the preview, which has ended" if was_preview else "saved"
        files = [path for path in (saved.model, saved.report, saved.shell, saved.python) if path is not None]
        self._saved.content = panels.note(f"{head}:\n" + "\n".join(str(path) for path in files))
        return f"Saved as {saved.model.name}, with {len(files) - 1} files beside it."

    # How work runs.

    def _start(self, status: str, work: Callable[[], str]) -> None:
        """Does work on a thread of its own, unless something runs."""
        with self._lock:
            if self._job is not None and self._job.is_alive():
                return
            self._is_busy = True
            self._job = threading.Thread(target=self._run, args=(status, work), name="btr studio job", daemon=True)
            self._job.start()

    def _run(self, status: str, work: Callable[[], str]) -> None:
        self._busy(True)
        ended = threading.Event()
        ticker = threading.Thread(target=self._tick, args=(status, ended), daemon=True)
        ticker.start()
        try:
            done, told = work(), panels.ladder(self._session.ladder, "")
        except Cancelled:
            done, told = "Stopped. The model is as it was.", panels.stopped(self._session.stopped)
        except (BtrError, OSError) as error:
            done, told = str(error), panels.ladder(self._session.ladder, str(error))
        finally:
            ended.set()
            ticker.join()
            self._busy(False)
        self._told.content = told
        self._notices.done(done)

    def _tick(self, status: str, ended: threading.Event) -> None:
        """Says how far the work is, until it ends."""
        begun = time.monotonic()
        while not ended.wait(0.25):
            batches = self._session.batches
            count = "" if batches is None else f", {batches} batches of simulations"
            self._status = f"{status}{count}, {time.monotonic() - begun:.0f} s"
            self._notices.running(self._status)
            self._tell()

    def _tell(self) -> None:
        self._told.content = panels.ladder(list(self._session.ladder), self._status)

    def _busy(self, busy: bool) -> None:
        self._is_busy = self._cancel.visible = busy
        cards = (*self._candidates.buttons, *self._stand_ins.buttons)
        for button in (self._ask, self._fit, self._save, self._redo, *cards, *self._frozen.boxes.values()):
            button.disabled = busy
        self._show_undo()

    # What is shown.

    def _changed(self, step: Step) -> None:
        """Shows another step."""
        with self._lock:
            self._changes.clear()
            self._was_set = False
        with self._showing:
            self._saved.content = ""
            self._sliders.load(self._session)
            self._show_cause()
            self._frozen.load(self._session)
            self._show_undo()
        self._redraws.ask()

    def _show_undo(self) -> None:
        self._undo.disabled = self._is_busy or len(self._session.history) == 1
        self._redo.visible = self._session.can_redo

    def _show_cause(self) -> None:
        """Shows what the diagnosis says of the present step, and the steps of its ladder."""
        with self._showing:
            found, is_current = self._session.diagnosis, self._session.is_diagnosed
            self._verdict.content = "" if found is None else panels.verdict(found._finding(), is_current=is_current)
            self._told.content = panels.ladder(list(self._session.ladder), "")
            self._doubts.load(self._session)
            self._bounds.content = panels.at_bounds(self._session.at_bounds)
            self._stand_ins.load(self._session)
            self._candidates.load(self._session)
            self._next.load(self._session)

    def _draw(self, is_stale: Callable[[], bool]) -> None:
        """Shows the chosen log, then the errors if nothing newer is asked for."""
        try:
            was_preview = self._session.previewed is not None or self._session.motion is not None
            steps = len(self._session.history)
            changes = self._set_values()
            if changes:
                self._show_undo()
                self._bounds.content = panels.at_bounds(self._session.at_bounds)
                if was_preview or len(self._session.history) != steps:
                    self._sliders.tell(self._session)
                    self._show_cause()
            number = self._view.run
            part = self._session.part(number, self._view.player.time_s) if changes else None
            if part is not None:
                self._view.load(part)
                if is_stale():
                    # A slider that moves on does not wait for the rest.
                    return
            self._view.load(self._session.motion or self._session.replay(number))
            # The other logs are simulated one by one, so that a slider that moves on does not wait for them.
            if all(not is_stale() and self._session.replay(number) for number in range(len(self._session.runs))):
                self._show_errors()
        except BtrError as error:
            self._told.content = panels.ladder(self._session.ladder, str(error))
        self._comparisons.ask()

    def _set_values(self) -> dict[str, float]:
        """Sets the values of sliders that were moved since, and returns them."""
        with self._lock:
            changes, self._changes = self._changes, {}
            self._was_set |= bool(changes)
        if changes:
            self._session.set_values(changes)
        return changes

    def _check(self) -> None:
        """Shows what is doubtful about the logs, before anything is asked."""
        try:
            self._session.check()
        except BtrError:
            # The comparison of the same logs tells why.
            return
        self._doubts.load(self._session)

    def _compare(self, is_stale: Callable[[], bool]) -> None:
        """Shows where the model fails, once nothing has changed for a while: this takes longer than a redraw."""
        until = time.monotonic() + (IDLE_S if self._session.floors else 0.0)
        while time.monotonic() < until:
            time.sleep(0.02)
            if is_stale():
                return
        self._view.rest()
        try:
            self._tell_by_hand()
            self._show_comparison()
        except BtrError as error:
            self._told.content = panels.ladder(self._session.ladder, str(error))

    def _tell_by_hand(self) -> None:
        """Says what the error is where values were set by hand: the errors at the top may be scrolled away."""
        with self._lock:
            was_set, self._was_set = self._was_set, False
        if was_set and self._session.floors and not self._is_busy:
            self._notices.done(by_hand(self._session.errors()))

    def _show_errors(self) -> None:
        step = self._session.shown
        self._head.content = self._told_errors(step, *self._session.errors())

    def _told_errors(self, step: Step, learn: float | None, held_out: float | None) -> str:
        tails, left_out = self._session.holds_out_tails, self._session.left_out
        return panels.head(step.model.name, step.title, learn, held_out, tails=tails, left_out=left_out)

    def _show_comparison(self) -> None:
        session, is_first = self._session, not self._session.floors
        session.compare()
        self._view.load_comparison()
        journey = session.journey
        in_memory = panels.note("no scripts: the model, a log or a law is in memory only")
        is_of_files = journey.is_of_files
        self._commands.content = panels.commands(shell(journey), python(journey)) if is_of_files else in_memory
        if is_first:
            self._sliders.load(self._session)
            self._view.choose_worst()
            self._redraws.ask()
