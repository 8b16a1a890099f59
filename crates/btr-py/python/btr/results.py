"""What the verbs answer: the documents of the command line's `--json`, as objects that read well."""

from __future__ import annotations

import base64
import html
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from btr import _tables, plots
from btr._btr import Log, Page, write_report
from btr._tables import Rows, cell, interval

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

    from btr.model import Model


class Result:
    """An answer. Every key of its document is an attribute; `document` is all of it."""

    def __init__(self, document: dict[str, Any]) -> None:
        self.document = document

    def __getattr__(self, key: str) -> Any:
        # `document` itself is missing while a pickle is read.
        if key == "document" or key not in self.document:
            which = ": compare, diagnose and fit have one" if key == "report" else ""
            raise AttributeError(f"{type(self).__name__} has no {key}{which}")
        return self.document[key]

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.document})

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.document == other.document

    __hash__ = None  # type: ignore[assignment]

    def _headline(self) -> str:
        raise NotImplementedError

    def _table(self) -> Rows:
        """What `to_dataframe` shows."""
        raise NotImplementedError

    def to_dataframe(self) -> pandas.DataFrame:
        """The answer's table as a pandas frame; raises `ImportError` without pandas."""
        return _tables.frame(self._table())

    def __repr__(self) -> str:
        return f"{self._headline()}\n\n{_tables.text(self._table())}"

    def _repr_html_(self) -> str:
        return _tables.markup(self._headline(), self._table())


class Reported(Result):
    """An answer with a report: the page that the command line writes with `--report`."""

    def __init__(self, document: dict[str, Any], page: Page) -> None:
        super().__init__(document)
        self._page: Page | str = page

    def report(self, path: str | os.PathLike[str]) -> None:
        """Writes the report, one HTML file with plots that needs no other, whole or not at all. Raises `BtrError` where the
        name does not end in `.html` or the file cannot be written."""
        write_report(Path(path), self._html())

    def _html(self) -> str:
        # Drawn when it is first looked at: that can take as long as the comparison.
        if not isinstance(self._page, str):
            self._page = self._page.html()
        return self._page

    def _repr_html_(self) -> str:
        # A frame of its own keeps the page's style from the notebook's.
        page = html.escape(self._html())
        return f'<iframe srcdoc="{page}" title="report" style="width:100%;height:40rem;border:0"></iframe>'

    def __getstate__(self) -> dict[str, Any]:
        self._html()
        return self.__dict__


def _ladder(steps: list[dict[str, Any]]) -> Rows:
    return [{"step": s["step"], "error (x noise floor)": s["train"], "held out": s["held_out"]} for s in steps]


def _names(effects: list[dict[str, Any]]) -> list[str]:
    """Effects that were found, as `effect@site`."""
    sites = [(e["effect"], e["site"] if isinstance(e["site"], list) else [e["site"]]) for e in effects]
    return [f"{effect}@{site}" for effect, all_sites in sites for site in all_sites]


def _picture(path: Path, what: str) -> str:
    """An SVG file in HTML; nothing where it is not there. As an image, whose style is not that of the page around it."""
    try:
        data = base64.b64encode(path.read_bytes()).decode()
    except OSError:
        return ""
    return f'<p><img alt="{what}" style="max-width:100%" src="data:image/svg+xml;base64,{data}"></p>'


class CheckResult(Result):
    """What logs are worth."""

    def _headline(self) -> str:
        return "\n".join(f"{log['log']}: {log['verdict']}" for log in self.logs)

    def _table(self) -> Rows:
        return [
            {"log": log["log"], "severity": finding["severity"], "finding": finding["sentence"]}
            for log in self.logs
            for finding in log["findings"]
        ]


class CompareResult(Reported):
    """How far a model is off, in multiples of the noise floor (`chi` of each of the `channels`), and where (`failures`)."""

    def _headline(self) -> str:
        if not self.failures:
            return "no joint fails in any regime: what is left is noise"
        return "where it fails: " + "; ".join(failure["hint"] for failure in self.failures[:3])

    def _table(self) -> Rows:
        keys = ["name", "unit", "rmse", "fit_percent", "bias", "lag_s", "noise_floor", "chi", "white"]
        return [{key: channel[key] for key in keys} for channel in self.channels]

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draws the error of every channel in noise floors, on Matplotlib's `ax` or a new figure; returns the axes. Raises
        `ImportError` without Matplotlib."""
        return plots.compare(self, ax)


class DiagnoseResult(Reported):
    """Which effect is missing: `verdict`, `effects`, `error_ladder` and all else that `btr diagnose --json` tells."""

    def __init__(self, document: dict[str, Any], page: Page, next_commands: Log | None) -> None:
        super().__init__(document, page)
        self.next_commands = next_commands
        """The commands of `next_experiment` for the robot: `cmd_<joint>`, each held until the next, NaN where the joint's
        motor is off; None where there are none."""

    @property
    def noise_stated_low(self) -> list[dict[str, Any]]:
        """Where nothing explains the error and it is white: channels whose readings show more noise (`shown`) than the model
        says (`stated`), both as standard deviations in `unit`."""
        rough: list[dict[str, Any]] = self.document.get("noise_stated_low", [])
        return rough

    @property
    def residual_law(self) -> dict[str, Any] | None:
        """What the error looks like where no effect explains it, as a formula: `law`, `site` and `on` are what
        `Model.add_law` takes, of a model that has the effects in `beside`. None where there is nothing to tell."""
        return self.document.get("residual_law")

    @property
    def next_experiment(self) -> dict[str, Any] | None:
        """What to do on the robot to tell what was found from its `rivals`, and how far these would be apart, in noise
        floors. None where there is nothing to tell apart, or no motion that does it."""
        return self.document.get("next_experiment")

    @property
    def names(self) -> list[str]:
        """What was found, as `effect@site`: for `add` and `fit`."""
        return _names(self.effects)

    def _headline(self) -> str:
        found = ", ".join(self.names)
        if self.verdict == "effect_missing":
            return f"missing: {found}{self._further()}"
        if self.verdict == "nothing_missing":
            return "nothing is missing: what remains is noise"
        share = f"{100 * self.unexplained_share:.0f} % of the squared error is not noise"
        helps = f"{found} helps and does not explain" if found else "no effect of the library helps"
        return f"unexplained: {helps}; {share}{self._further()}"

    def _further(self) -> str:
        """What is known beyond the verdict, a line each."""
        unsure = [effect for effect in self.effects if effect["alike"]]
        alike = [f"\nthese logs cannot tell {', '.join(_names([e]))} from {', '.join(e['alike'])}" for e in unsure]
        law, following, rough = self.residual_law, self.next_experiment, self.noise_stated_low
        like = f"\nthe error looks like {law['law']} on the {law['on']} of {law['site']}" if law else ""
        beside = f", beside {', '.join(law['beside'])}" if law and law["beside"] else ""
        low = ", ".join(f"{one['channel']} shows {one['shown']:.2g} {one['unit']} of {one['stated']:.2g}" for one in rough)
        noise = f"\nwhat is left is white: is [noise] stated too low? {low}" if low else ""
        return noise + "".join(alike) + like + beside + (f"\nnext experiment: {following['sentence']}" if following else "")

    def _table(self) -> Rows:
        return _ladder(self.error_ladder)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draws how the error fell, learnt from and held out, in noise floors, on Matplotlib's `ax` or a new figure; returns
        the axes. Raises `ImportError` without Matplotlib."""
        return plots.diagnose(self, ax)


class EffectsResult(Result):
    """Physical effects (`effects`), each with its law, parameters and bounds."""

    def _headline(self) -> str:
        if len(self.effects) > 1:
            return f"{len(self.effects)} effects; btr.effects(name) tells all about one"
        (effect,) = self.effects
        alike = f"\nalike: {', '.join(effect['alike'])}" if effect["alike"] else ""
        return f"{effect['effect']}: {effect['law']}\nsite: {effect['site']}\nshows: {effect['shows']}\nsource: {effect['source']}{alike}"

    def _table(self) -> Rows:
        if len(self.effects) > 1:
            told = ((effect, ", ".join(number["name"] for number in effect["parameters"])) for effect in self.effects)
            return [{"effect": effect["effect"], "site": effect["site"], "parameters": numbers} for effect, numbers in told]
        keys = {"name": "parameter", "unit": "unit", "min": "min", "max": "max", "off": "off", "typical": "typical"}
        return [{title: number[key] for key, title in keys.items()} for number in self.effects[0]["parameters"]]


class CoevolveResult(Result):
    """What a run of the loop found: `iterations`, `stop_reason`, `real_tests` and all else that `btr coevolve --json` tells."""

    def __init__(self, document: dict[str, Any], folder: Path) -> None:
        super().__init__(document)
        self.folder = folder.absolute()

    @property
    def logs(self) -> list[Path]:
        """What the robot did in each real test that gave a log, in their order."""
        found = (sorted(test.glob("log.*"))[:1] for test in sorted(self.folder.glob("transfers/*")))
        return [log for logs in found for log in logs]

    @property
    def adapted(self) -> Path:
        """The model with what was found written in, for `load_model`."""
        return self.folder / "adapted.toml"

    @property
    def missing(self) -> list[str]:
        """What its simulations lack, as `effect@site` for `Model.add`; empty unless it disengaged and its tests told why."""
        cause = self.diagnosis if self.stop_reason == "disengaged" else None
        return _names(cause["effects"]) if cause and cause["verdict"] == "effect_missing" else []

    def _headline(self) -> str:
        odd = "".join(f"\n{doubt['severity']}: real test {doubt['test']}: {doubt['sentence']}" for doubt in self.doubts)
        if self.waiting_for:
            return f"waiting for a real test: {self.waiting_for}{odd}"
        simulated = f"{self.real_tests} real tests, {self.simulated_evaluations} simulated"
        failed = [test["verdict"]["failed"]["why"] for test in self.tests if "failed" in test["verdict"]]
        why = f"\n{len(failed)} real tests failed, the last one: {failed[-1]}" if failed else ""
        lacks = f"\nmissing: {', '.join(self.missing)}" if self.missing else ""
        return f"stopped: {self.stop_reason}; {simulated}; everything is in {self.folder}{why}{lacks}{odd}"

    def _table(self) -> Rows:
        columns = {"i": "iteration", "real_tests": "tests", "phi": "phi"}
        columns |= {"fitness_sim": "f simulated", "fitness_real": "f real"}
        return [{title: iteration[key] for key, title in columns.items()} for iteration in self.iterations]

    def _repr_html_(self) -> str:
        run = _picture(self.folder / "figure3.svg", "fitness, phi and parameters over the run")
        following = _picture(self.folder / "figure5.svg", "joints beside their references, before and after")
        return super()._repr_html_() + run + following

    def plot(self, ax: Sequence[Axes] | None = None) -> list[Axes]:
        """Draws phi per iteration, and fitness as it was promised and as it was where there is one, on a pair of Matplotlib's
        axes or a new figure; returns what it drew on. Raises `ImportError` without Matplotlib."""
        return plots.coevolve(self, ax)


class FitResult(Reported):
    """The numbers in doubt at their best (`parameters`), and the fitted `model`. `space` has the numbers as they were before,
    each with its `name`, `unit`, bounds (`min`, `max`), `scale` between these (`linear` or `log`) and `nominal` value (None
    where there was none)."""

    def __init__(self, document: dict[str, Any], page: Page, space: list[dict[str, Any]], model: Model) -> None:
        super().__init__(document, page)
        self.space = space
        self.model = model

    @property
    def values(self) -> dict[str, float]:
        """The numbers by name."""
        return {parameter["name"]: parameter["value"] for parameter in self.parameters}

    @property
    def x(self) -> NDArray[np.float64]:
        """The numbers in their order, of shape (len(parameters),), in their units; as SciPy calls them."""
        return np.array([parameter["value"] for parameter in self.parameters])

    @property
    def nfev(self) -> int:
        """How many logs were simulated; as SciPy calls it."""
        rollouts: int = self.rollouts
        return rollouts

    @property
    def success(self) -> bool:
        """Whether the search ended because there was nothing more to win; `stop_reason` says why it did. As SciPy calls it."""
        return bool(self.stop_reason == "converged")

    def _headline(self) -> str:
        ladder = "; ".join(f"{s['step']}: {cell(s['train'])}, {cell(s['held_out'])} held out" for s in self.error_ladder)
        why = f"\nno intervals: {self.withheld}" if self.withheld else ""
        bounded = any(p["by_bounds"] and not p["at_bound"] for p in self.parameters)
        by = "\nby its bounds: that is what the bounds leave; the logs tell less" if bounded else ""
        return f"error in noise floors: {ladder}{why}{by}"

    def _table(self) -> Rows:
        return [
            {"parameter": p["name"], "value": p["value"], "unit": p["unit"], "95 % interval": interval(p)}
            for p in self.parameters
        ]

    def to_dataframe(self) -> pandas.DataFrame:
        """The numbers as a pandas frame: `parameter`, `value`, `unit`, the ends of the 95 % interval (`low`, `high`: NaN where
        there is none), and whether the value is `at_bound` and the interval `by_bounds`. Raises `ImportError` without
        pandas."""
        def row(p: dict[str, Any]) -> dict[str, Any]:
            low, high = p["ci95"] or (np.nan, np.nan)
            known = {"parameter": p["name"], "value": p["value"], "unit": p["unit"], "low": low, "high": high}
            return {**known, "at_bound": p["at_bound"], "by_bounds": p["by_bounds"]}

        return _tables.frame([row(p) for p in self.parameters])

    def plot(self, ax: Sequence[Axes] | None = None) -> list[Axes]:
        """Draws every value with its 95 % interval between its bounds, and how the error fell, on a pair of Matplotlib's axes
        or a new figure; returns the pair. Raises `ImportError` without Matplotlib."""
        return plots.fit(self, ax)
