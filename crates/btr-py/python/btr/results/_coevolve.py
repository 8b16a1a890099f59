"""Result of `coevolve`."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from btr import documents as doc
from btr import plots
from btr._tables import Rows
from btr.results._base import Result
from btr.results._effects import names_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def _picture(path: Path, what: str) -> str:
    """An SVG file as HTML, empty if the file is missing. It is embedded as an image, whose style does not mix with that
    of the page."""
    try:
        data = base64.b64encode(path.read_bytes()).decode()
    except OSError:
        return ""
    return f'<p><img alt="{what}" style="max-width:100%" src="data:image/svg+xml;base64,{data}"></p>'


class CoevolveResult(Result):
    """Result of a run of the loop: `iterations`, `stop_reason`, `real_tests` and the other keys of `btr coevolve
    --json`. Its key `logs` is `log_scores` here; `logs` are the logs of the real tests."""

    name: str
    """Name of the experiment."""
    seed: int
    """Seed of the run."""
    fitness: dict[str, float]
    """Weights of the fitness by term; empty if controllers are not judged."""
    iterations: list[doc.Iteration]
    """One per closed iteration."""
    stop_reason: doc.StopReason | None
    """Why the run ended; None while it waits for real tests."""
    disengaged: bool
    """Whether the evidence indicates disengagement, with or without a stop."""
    diagnosis: doc.Cause | None
    """Why the populations disengaged; the last answer if this was asked several times. None if it was not asked."""
    augmentations: list[doc.Augmentation]
    """Enlargements of S."""
    drifts: list[doc.Drift]
    """Changes of the robot during the run."""
    suspicion: int | None
    """Number of the last real test if nothing explains it together with those before it and the cause is unknown."""
    real_tests: int
    """Number of real tests, failed ones included."""
    reality_gap: doc.RealityGap | None
    """Real fitness less promised fitness over the real tests; None without such tests."""
    simulated_evaluations: int
    """Number of simulated behaviours."""
    failed_evaluations: int
    """Number of those that diverged."""
    recommended: doc.Recommended | None
    """The tested controller with the best real fitness."""
    revealed: doc.TwinComparison | None
    """The hidden twin and the estimate of it; None if reality was no twin."""
    by_distance: list[doc.ByDistance]
    """The same identification with other distances."""
    map: doc.MapReport | None
    """The map of controllers; None without `quality_diversity`."""
    tests: list[doc.TestEntry]
    """The ledger of real tests."""
    doubts: list[doc.TestDoubt]
    """Findings about the logs of real tests that make the result doubtful."""
    conclusions: list[str]
    """What the run comes to, in the sentences of the command line."""
    generations: list[doc.Generation]
    """Every generation of both populations."""
    files: list[str]
    """Files that the run wrote."""
    waiting_for: str | None
    """The real test that the run waits for; None if it waits for none."""

    def __init__(self, document: dict[str, Any], folder: Path) -> None:
        super().__init__(document)
        self.folder = folder.absolute()

    @property
    def log_scores(self) -> list[doc.LogScore]:
        """Errors on recorded logs, with the first simulation and with the one found: the document's `logs`."""
        return [score if isinstance(score, doc.LogScore) else doc.LogScore(score) for score in self.document["logs"]]

    @property
    def logs(self) -> list[Path]:
        """The log of each real test that gave one, in order."""
        found = (sorted(test.glob("log.*"))[:1] for test in sorted(self.folder.glob("transfers/*")))
        return [log for logs in found for log in logs]

    @property
    def adapted(self) -> Path:
        """The model file with the values found, for `load_model`."""
        return self.folder / "adapted.toml"

    @property
    def missing(self) -> list[str]:
        """Effects that its simulations lack, as `effect@site` for `Model.add`; empty unless it disengaged and its tests
        showed the cause."""
        cause = self.diagnosis if self.stop_reason == "disengaged" else None
        return names_of(cause.effects) if cause and cause.verdict == "effect_missing" else []

    def _headline(self) -> str:
        odd = "".join(f"\n{doubt.severity}: real test {doubt.test}: {doubt.sentence}" for doubt in self.doubts)
        if self.waiting_for:
            return f"waiting for a real test: {self.waiting_for}{odd}"
        simulated = f"{self.real_tests} real tests, {self.simulated_evaluations} simulated"
        failed = [test.verdict.failed.why for test in self.tests if test.verdict.failed]
        why = f"\n{len(failed)} real tests failed, the last one: {failed[-1]}" if failed else ""
        lacks = f"\nmissing: {', '.join(self.missing)}" if self.missing else ""
        return f"stopped: {self.stop_reason}; {simulated}; everything is in {self.folder}{why}{lacks}{odd}"

    def _table(self) -> Rows:
        columns = {"i": "iteration", "real_tests": "tests", "phi": "phi"}
        columns |= {"fitness_sim": "f simulated", "fitness_real": "f real"}
        return [{title: iteration[key] for key, title in columns.items()} for iteration in self.iterations]

    def _repr_html_(self) -> str:
        run = _picture(self.folder / "progress.svg", "fitness, phi and parameters over the run")
        joints = _picture(self.folder / "following.svg", "joints beside their references, before and after")
        return super()._repr_html_() + run + joints

    def plot(self, ax: Sequence[Axes] | None = None) -> Figure:
        """Draws phi per iteration and, if there is one, promised and real fitness, on a pair of Matplotlib's axes or a
        new figure, and returns the figure. Raises `ImportError` without Matplotlib."""
        return plots.coevolve(self, ax)
