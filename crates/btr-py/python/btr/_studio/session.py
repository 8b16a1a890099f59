"""The state of the studio, without its page: a model, logs, what is known of the error, what was done about it."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Union

from btr import _warnings
from btr._btr import Log
from btr._inputs import wrong
from btr._sources import LogLike
from btr._studio.candidates import Candidate, added, candidates
from btr._studio.doubts import Doubts, of_check, of_result
from btr._studio.reading import runs
from btr._studio.replay import Errors, Replay, Run, begun, learn_and_held_out, replayed
from btr._studio.saved import Journey, Saved, moved_from, save
from btr._studio.step import BY_HAND, FITTED, PREVIEW, Ladder, Step, ladder_of
from btr._studio.work import Batches, Cancelled
from btr.documents import Dimension
from btr.model import Model, loaded
from btr.results import CompareResult, DiagnoseResult
from btr.verbs import Tell, check, compare, diagnose, fit

PART_TAKES_S = 0.01
"""How long the beginning of a simulation may take that is shown before the whole."""
SHOWN_S = 1.0
"""How much of a simulation is shown after the time that is shown, at least."""
MOST_FITS = 20
"""How many fits are kept: one that is asked for again is not computed again."""
MOST_OF_RUN = 0.7
"""Share of a run from which on the whole is simulated at once."""


class Session:
    """A model and its logs. Every change of the model is a step; `history` has them all, the present one last.

    Methods that take long may be called on any thread, one at a time: another one raises `BtrError` in the meantime.
    After `cancel` they raise `Cancelled` and leave everything as it was.
    """

    def __init__(
        self,
        model: Union[Model, str, os.PathLike[str]],
        logs: Union[LogLike, Iterable[LogLike]],
        held_out: Union[LogLike, Iterable[LogLike], None] = None,
        *,
        folder: Union[str, os.PathLike[str]] = ".",
    ) -> None:
        """Reads the model and the logs. `folder` is where `save` writes. Raises `BtrError` if none of the logs can be
        replayed; a single one is left out with a warning."""
        first = loaded(model)
        self.folder = Path(folder)
        self.left_out: list[str] = []
        """Why logs are left out, each with its name."""
        learn = list(runs(first, logs, self.left_out, held_out=False))
        if not learn:
            why = "".join(f": {reason}" for reason in self.left_out[:1])
            raise wrong(f"no log is left to learn from{why}", "name at least one log that the model can replay")
        self.runs = [*learn, *runs(first, held_out, self.left_out, held_out=True)]
        for reason in self.left_out:
            _warnings.warn(f"left out: {reason}")
        self.history = [Step("model as it stands", first)]
        self.floors: dict[str, float] = {}
        """Noise floors of the compared channels, in their units, 0 where there is no noise; empty until `compare`."""
        self.previewed: Union[Step, None] = None
        """What a suspect would make of the model; None while the present step is shown."""
        self.motion: Union[Replay, None] = None
        """The next experiment as the diagnosed model does it; None while logs are shown."""
        self.stopped: Ladder = []
        """The steps of the work that was cancelled last, as far as it came."""
        self._checked: Union[Doubts, None] = None
        self._took_s: dict[int, float] = {}
        self._fits: dict[tuple[tuple[str, ...], tuple[tuple[str, float], ...]], Step] = {}
        self._undone: list[Step] = []
        self._stepping = threading.RLock()
        self._running: Ladder = []
        self._diagnosing: Union[Step, None] = None
        self._work: Union[Batches, None] = None
        self._one_at_a_time = threading.Lock()

    @property
    def step(self) -> Step:
        """The present step."""
        return self.history[-1]

    @property
    def shown(self) -> Step:
        """The step that errors and replays are of: the previewed one, or the present one."""
        return self.step if self.previewed is None else self.previewed

    @property
    def model(self) -> Model:
        """The present model."""
        return self.step.model

    @property
    def batches(self) -> Union[int, None]:
        """Number of batches of simulations that the running work has computed; None while nothing runs."""
        return None if self._work is None else self._work.done

    @property
    def channels(self) -> list[str]:
        """The compared channels; before `compare`, measured positions of the joints."""
        positions = [f"q_{joint}" for joint in self.model.joints]
        return list(self.floors) or [name for name in positions if any(name in run.log for run in self.runs)]

    @property
    def ladder(self) -> Ladder:
        """The steps of the diagnosis or fit that runs, or else of the shown step."""
        return self.shown.ladder if self._work is None else self._running

    @property
    def diagnosed(self) -> Union[Step, None]:
        """The step whose diagnosis counts: that of the present model, or else the last one, if possible of a model to
        which the same was added. None before a diagnosis."""
        known = [step for step in reversed(self.history) if step.diagnosis is not None]
        return max(known, key=lambda step: (self._is_of(step), step.added == self.step.added), default=None)

    @property
    def diagnosis(self) -> Union[DiagnoseResult, None]:
        """The diagnosis that counts, of the present model or of an earlier one; see `is_diagnosed`."""
        return None if self.diagnosed is None else self.diagnosed.diagnosis

    @property
    def is_diagnosed(self) -> bool:
        """Whether `diagnosis` is of the present model, with the same parameters frozen."""
        return self.diagnosed is not None and self._is_of(self.diagnosed)

    def _is_of(self, step: Step) -> bool:
        return step.model is self.model and step.frozen == self.step.frozen

    @property
    def can_redo(self) -> bool:
        """Whether `redo` has a step to return to."""
        return bool(self._undone)

    @property
    def candidates(self) -> list[Candidate]:
        """What the diagnosis suspects and the present model lacks; empty before one."""
        suspects = [] if self.diagnosis is None else candidates(self.diagnosis)
        return [suspect for suspect in suspects if not set(suspect.names) <= set(self.step.added)]

    @property
    def added(self) -> list[Candidate]:
        """What was added to the first model, each by itself, with what the diagnoses so far cannot tell it from."""
        return added(self.step.added, [step.diagnosis for step in self.history if step.diagnosis is not None])

    @property
    def at_bounds(self) -> list[tuple[Dimension, float]]:
        """Parameters that the fit of the shown model left at a bound, each with that bound; none once values were set
        since: the model is no longer that of the fit."""
        step = self.shown
        if step.fit is None or step.by_hand:
            return []
        ended = {p.name: p.value for p in step.fit.parameters if p.at_bound}
        dims = [dim for dim in step.model.parameters if dim.name in ended]
        return [(dim, min(dim.min, dim.max, key=lambda bound: abs(bound - ended[dim.name]))) for dim in dims]

    @property
    def holds_out_tails(self) -> bool:
        """Whether the last 30 % of each log are held out, as no log is."""
        return not any(run.held_out for run in self.runs)

    @property
    def journey(self) -> Journey:
        """How the present model came about."""
        step, fitted = self.step, self.step.fit
        # What was frozen in the fit counts, not what was since.
        kept, model = (step.frozen, step.model) if fitted is None else (fitted.frozen, fitted.model)
        frozen = {name: model.values[name] for name in kept}
        return Journey(self.history[0].model, self.runs, step.added, fitted is not None, step.by_hand, frozen)

    def replay(self, number: int, of: Union[Step, None] = None) -> Replay:
        """What the shown model, or that of a step, does with the commands of a run."""
        step = of or self.shown
        known = step.replays.get(number)
        if known is None:
            before = time.perf_counter()
            known = step.replays[number] = replayed(step.model, self.runs[number])
            self._took_s[number] = time.perf_counter() - before
        return known

    def part(self, number: int, time_s: float) -> Union[Replay, None]:
        """The beginning of `replay`, up to a time at least, where the whole takes long; None where it does not."""
        run, took_s = self.runs[number], self._took_s.get(number, 0.0)
        end_s = float(run.clock_s[-1])
        until_s = max(end_s * PART_TAKES_S / max(took_s, PART_TAKES_S), time_s + SHOWN_S)
        if number in self.shown.replays or until_s > MOST_OF_RUN * end_s:
            return None
        return begun(self.shown.model, run, until_s)

    def replays_of(self, model: Model) -> list[Replay]:
        """What another model does with the commands of every run."""
        return [replayed(model, run) for run in self.runs]

    def errors(self, of: Union[Step, None] = None) -> Errors:
        """Errors of the shown model, or that of a step, whatever was asked or fitted; see `errors_of`. Those of a
        ladder differ a little: a diagnosis and a fit estimate where each log begins."""
        return self.errors_of([self.replay(number, of) for number in range(len(self.runs))])

    def errors_of(self, replays: Sequence[Replay]) -> Errors:
        """Errors of replays of all runs, in multiples of the noise floors of the first model; None before `compare`."""
        return learn_and_held_out(replays, self.floors) if self.floors else (None, None)

    def check(self) -> None:
        """Checks the logs, for `doubts`."""
        self._checked = of_check(check(self.history[0].model, [run.log for run in self.runs]))

    @property
    def doubts(self) -> Union[Doubts, None]:
        """Doubts about the logs: those of the diagnosis or the fit of the shown model, or else those of `check`; None
        before it."""
        step = self.shown
        found = step.diagnosis or (None if step.by_hand else step.fit)
        return self._checked if found is None else of_result(found)

    def compare(self) -> CompareResult:
        """Where the shown model fails, over all logs."""
        return self._compared(self.shown)

    def _compared(self, step: Step) -> CompareResult:
        if step.comparison is None:
            step.comparison = compare(step.model, [run.log for run in self.runs])
            # Readings without any noise have no floor.
            known = {channel.name: channel.noise_floor or 0.0 for channel in step.comparison.channels}
            self.floors = self.floors or known
        return step.comparison

    def diagnose(self, tell: Union[Callable[[], None], None] = None) -> list[Candidate]:
        """Asks what the present model lacks. `tell` is called with every step of `ladder`, on another thread."""
        with self._work_on(tell) as (work, told):
            learn, held = self._logs()
            executor = self._executor(work)
            step = self._diagnosing = self.step
            try:
                frozen = list(step.frozen)
                found = diagnose(step.model, learn, held_out=held, freeze=frozen, tell=told, executor=executor)
            finally:
                self._diagnosing = None
            work.must_go_on()
            step.diagnosis, step.ladder = found, ladder_of(found)
            self.show_step()
        return self.candidates

    def add(self, names: Sequence[str], tell: Union[Callable[[], None], None] = None) -> Step:
        """Adds effects or values to those that were added before, and fits all."""
        return self._fitted("+ " + ", ".join(names), (*self.step.added, *names), tell)

    def preview(self, names: Sequence[str], tell: Union[Callable[[], None], None] = None) -> Step:
        """Shows what `add` would make of the model, which stays as it is. Adding it then is no more work."""
        previewed = self._fit_of(f"{PREVIEW}+ {', '.join(names)}", (*self.step.added, *names), tell)
        self.show_step()
        self.previewed = previewed
        return previewed

    def show_motion(self) -> Replay:
        """Shows the motion that the diagnosis proposes. Raises `BtrError` if it proposes none."""
        commands = None if self.diagnosis is None else self.diagnosis.next_commands
        if self.diagnosis is None or commands is None:
            raise wrong("there is no next experiment", "ask what is missing; one is proposed where suspects are alike")
        self.previewed = None
        self.motion = replayed(self.diagnosis.model, Run("next experiment", commands, False, None))
        return self.motion

    def show_step(self) -> None:
        """Shows the present step on the logs, after `preview` or `show_motion`."""
        self.previewed = self.motion = None

    def remove(self, names: Sequence[str], tell: Union[Callable[[], None], None] = None) -> Step:
        """Takes what was added out again, and fits the rest. Raises `BtrError` for what was not added."""
        missing = [name for name in names if name not in self.step.added]
        if missing:
            raise wrong(f"{missing[0]} was not added", f"added: {', '.join(self.step.added) or 'nothing'}")
        rest = tuple(name for name in self.step.added if name not in names)
        label = "- " + ", ".join(names)
        if rest or set(self.history[0].model.values) > set(self.step.frozen):
            return self._fitted(label, rest, tell)
        # Without a fit, values of what is frozen are values that were set by hand.
        kept = self._kept()
        moved = moved_from(self.history[0].model, kept)
        return self._push(Step(label, self._first(kept), by_hand=moved, frozen=self.step.frozen))

    def fit(self, tell: Union[Callable[[], None], None] = None) -> Step:
        """Fits the free parameters with what was added, from the values of the first model."""
        return self._fitted(FITTED, self.step.added, tell)

    def set_values(self, values: Mapping[str, float]) -> Step:
        """Sets values of free parameters, in their units. A series of changes of the same ones is one step."""
        with self._stepping:
            before = self.step
            others = {name: value for name, value in before.by_hand.items() if name not in values}
            by_hand = {**others, **values}
            step = Step(BY_HAND, before.model.at(values), before.added, before.fit, by_hand, before.frozen)
            is_series = before.label == BY_HAND and list(before.by_hand)[len(others) :] == list(values)
            # A diagnosis keeps the model that it is about.
            if not is_series or before.diagnosis is not None or before is self._diagnosing:
                return self._push(step)
            self.show_step()
            self._forget_undone()
            self.history[-1] = step
            return step

    def freeze(self, name: str) -> Step:
        """Has fits and diagnoses keep a parameter at its present value. Raises `BtrError` if it is not `freezable`."""
        if name not in self.freezable:
            raise wrong(f"{name} cannot be frozen", "freeze a free parameter of the model that has a value of its own")
        return self._with_frozen(f"{name} frozen", {*self.step.frozen, name})

    def free(self, name: str) -> Step:
        """Has fits and diagnoses estimate a parameter again that was frozen."""
        return self._with_frozen(f"{name} free", {*self.step.frozen} - {name})

    @property
    def freezable(self) -> list[str]:
        """Free parameters of the first model that have a value to keep: one shared by sites may have none."""
        return [dim.name for dim in self.history[0].model.parameters if dim.nominal is not None]

    def _with_frozen(self, label: str, names: set[str]) -> Step:
        """The present model, of which a new diagnosis is another one."""
        with self._stepping:
            step, frozen = self.step, tuple(name for name in self.freezable if name in names)
            if frozen == step.frozen:
                return step
            ladder = [] if step.fit is None or step.by_hand else ladder_of(step.fit)
            replays = dict(step.replays)
            return self._push(replace(step, label=label, frozen=frozen, diagnosis=None, ladder=ladder, replays=replays))

    def undo(self) -> Step:
        """Returns to the step before; the first one stays."""
        with self._stepping:
            self.show_step()
            if len(self.history) > 1:
                for undone in self._undone:
                    undone.replays.clear()
                self._undone.append(self.history.pop())
            return self.step

    def redo(self) -> Step:
        """Returns to the step that `undo` left last; none is left once something else was done."""
        with self._stepping:
            self.show_step()
            if self._undone:
                self.history.append(self._undone.pop())
            return self.step

    def _forget_undone(self) -> None:
        for undone in self._undone:
            undone.replays.clear()
        self._undone.clear()

    def between(self, earlier: Step, parts: int) -> Iterator[Model]:
        """Models on the straight way from an earlier step's values to the present ones, `parts` of them, the present
        one last. Parameters that the earlier one lacks come from the end of their bounds that is nearest to 0."""
        here, before = self.model.values, earlier.model.values
        off = {dim.name: min(dim.min, dim.max, key=abs) for dim in self.model.parameters}
        start = {name: before.get(name, off[name]) for name in here}
        for part in range(1, parts):
            share = part / parts
            yield self.model.at({name: start[name] + share * (value - start[name]) for name, value in here.items()})
        yield self.model

    def save(self) -> Saved:
        """Shows the present step, and writes its model, its report, and scripts that do the same into `folder`, under
        names that are free. Raises `BtrError` if they cannot be written."""
        self.show_step()
        step = self.step
        report = step.fit if step.fit is not None and not step.by_hand else self._compared(step)
        return save(self.folder, step.model, self.journey, report)

    def cancel(self) -> None:
        """Ends what runs: its method raises `Cancelled` before the next batch of simulations."""
        if self._work is not None:
            self._work.stop()

    def _fitted(self, label: str, added: tuple[str, ...], tell: Union[Callable[[], None], None]) -> Step:
        return self._push(self._fit_of(label, added, tell))

    def _fit_of(self, label: str, added: tuple[str, ...], tell: Union[Callable[[], None], None]) -> Step:
        """The first model with what was added, fitted. The same is fitted once."""
        frozen, kept = self.step.frozen, self._kept()
        what = (added, tuple(kept.items()))
        with self._work_on(tell) as (work, told):
            if what not in self._fits:
                learn, held = self._logs()
                first, executor = self._first(kept), self._executor(work)
                found = fit(first, learn, held_out=held, add=added, freeze=list(frozen), tell=told, executor=executor)
                work.must_go_on()
                self._fits[what] = Step(label, found.model, added, found, frozen=frozen, ladder=ladder_of(found))
            fitted = replace(self._fits[what], label=label)
            if len(self._fits) > MOST_FITS:
                self._fits.pop(next(iter(self._fits)))
            return fitted

    def _kept(self) -> dict[str, float]:
        """Values of what is frozen."""
        return {name: self.model.values[name] for name in self.step.frozen}

    def _first(self, kept: Mapping[str, float]) -> Model:
        """The first model, with the values of what is frozen."""
        first = self.history[0].model
        moved = moved_from(first, kept)
        return first.at(moved) if moved else first

    def _push(self, step: Step) -> Step:
        with self._stepping:
            self.show_step()
            self._forget_undone()
            self.history.append(step)
            # What is two steps back is simulated again where it is needed: there may be any number of steps.
            for earlier in self.history[1:-2]:
                earlier.replays.clear()
            return step

    def _logs(self) -> tuple[list[Log], list[Log]]:
        """The training and the held-out logs."""
        return [run.log for run in self.runs if not run.held_out], [run.log for run in self.runs if run.held_out]

    def _executor(self, work: Batches) -> Union[Batches, None]:
        # Functions would have to be pickled for an executor; such work stops only between steps of the ladder.
        return None if self.history[0].model.laws else work

    @contextmanager
    def _work_on(self, tell: Union[Callable[[], None], None]) -> Iterator[tuple[Batches, Tell]]:
        """The work of one call, and its listener."""
        if not self._one_at_a_time.acquire(blocking=False):
            raise wrong("something else is running", "wait for it, or cancel it")
        work = self._work = Batches()
        self._running = []

        def told(step: str, train: float, held_out: Union[float, None]) -> None:
            work.must_go_on()
            self._running.append((step, train, held_out))
            if tell is not None:
                tell()

        try:
            yield work, told
        except Cancelled:
            self.stopped = self._running
            raise
        finally:
            self._work = None
            self._one_at_a_time.release()
