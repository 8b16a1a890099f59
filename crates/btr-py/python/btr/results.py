"""What the verbs answer: the documents of the command line's `--json`, as objects that read well."""

from __future__ import annotations

import html
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas

    from btr.verbs import Model


class Result:
    """An answer. Every key of its document is an attribute; `document` is all of it."""

    def __init__(self, document: dict[str, Any]) -> None:
        self.document = document

    def __getattr__(self, key: str) -> Any:
        # `document` itself is missing while a pickle is read.
        if key == "document" or key not in self.document:
            raise AttributeError(f"{type(self).__name__} has no {key}")
        return self.document[key]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.document]

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.document == other.document  # type: ignore[attr-defined]

    __hash__ = None  # type: ignore[assignment]

    def _headline(self) -> str:
        raise NotImplementedError

    def _table(self) -> list[dict[str, Any]]:
        """What `to_dataframe` shows."""
        raise NotImplementedError

    def to_dataframe(self) -> pandas.DataFrame:
        """The answer's table; needs pandas."""
        import pandas

        return pandas.DataFrame(self._table())

    def __repr__(self) -> str:
        return "\n".join([self._headline(), "", *_lines(self._table())])

    def _repr_html_(self) -> str:
        rows = self._table()
        head = "".join(f"<th>{html.escape(key)}</th>" for key in (rows[0] if rows else {}))
        body = "".join(f"<tr>{''.join(f'<td>{html.escape(_cell(x))}</td>' for x in row.values())}</tr>" for row in rows)
        return f"<p>{html.escape(self._headline())}</p><table><tr>{head}</tr>{body}</table>"


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _lines(rows: list[dict[str, Any]]) -> list[str]:
    """The rows as text in columns."""
    if not rows:
        return []
    cells = [list(rows[0]), *([_cell(value) for value in row.values()] for row in rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(cells[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in cells]


def _ladder(steps: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{"step": s["step"], "error (x noise floor)": s["train"], "held out": s["held_out"]} for s in steps]


class CheckResult(Result):
    """What logs are worth."""

    def _headline(self) -> str:
        return "\n".join(f"{log['log']}: {log['verdict']}" for log in self.logs)

    def _table(self) -> list[dict[str, Any]]:
        return [
            {"log": log["log"], "severity": finding["severity"], "finding": finding["sentence"]}
            for log in self.logs
            for finding in log["findings"]
        ]


class CompareResult(Result):
    """How far a model is off, in multiples of the noise floor (`chi`), and where (`failures`)."""

    def _headline(self) -> str:
        if not self.failures:
            return "no joint fails in any regime: what is left is noise"
        return "where it fails: " + "; ".join(failure["hint"] for failure in self.failures[:3])

    def _table(self) -> list[dict[str, Any]]:
        keys = ["name", "unit", "rmse", "fit_percent", "bias", "lag_s", "noise_floor", "chi", "white"]
        return [{key: channel[key] for key in keys} for channel in self.channels]


class DiagnoseResult(Result):
    """Which effect is missing: `verdict`, `effects`, `error_ladder` and all else that `btr diagnose --json` tells."""

    @property
    def names(self) -> list[str]:
        """What was found, as `effect@site`: for `add` and `fit`."""
        sites = [(e["effect"], e["site"] if isinstance(e["site"], list) else [e["site"]]) for e in self.effects]
        return [f"{effect}@{site}" for effect, all_sites in sites for site in all_sites]

    def _headline(self) -> str:
        found = ", ".join(self.names)
        if self.verdict == "effect_missing":
            return f"missing: {found}"
        if self.verdict == "nothing_missing":
            return "nothing is missing: what remains is noise"
        share = f"{100 * self.unexplained_share:.0f} % of the squared error is not noise"
        return f"unexplained: {found + ' helps and does not explain' if found else 'no effect of the library helps'}; {share}"

    def _table(self) -> list[dict[str, Any]]:
        return _ladder(self.error_ladder)


class CoevolveResult(Result):
    """What a run of the loop found: `iterations`, `stop_reason`, `real_tests` and all else that `btr coevolve --json` tells."""

    def __init__(self, document: dict[str, Any], folder: Path) -> None:
        super().__init__(document)
        self.folder = folder

    @property
    def logs(self) -> list[Path]:
        """What the robot did in each real test that gave a log, in their order."""
        found = (sorted(test.glob("log.*"))[:1] for test in sorted((self.folder / "transfers").iterdir()))
        return [log for logs in found for log in logs]

    @property
    def adapted(self) -> Path:
        """The model with what was found written in, for `load_model`."""
        return self.folder / "adapted.toml"

    def _headline(self) -> str:
        if self.waiting_for:
            return f"waiting for a real test: {self.waiting_for}"
        simulated = f"{self.real_tests} real tests, {self.simulated_evaluations} simulated"
        return f"stopped: {self.stop_reason}; {simulated}; everything is in {self.folder}"

    def _table(self) -> list[dict[str, Any]]:
        columns = {"i": "iteration", "real_tests": "tests", "phi": "phi", "fitness_sim": "f simulated", "fitness_real": "f real"}
        return [{title: iteration[key] for key, title in columns.items()} for iteration in self.iterations]


class FitResult(Result):
    """The numbers in doubt at their best (`parameters`), and the fitted `model`."""

    def __init__(self, document: dict[str, Any], model: Model) -> None:
        super().__init__(document)
        self.model = model

    @property
    def values(self) -> dict[str, float]:
        """The numbers by name."""
        return {parameter["name"]: parameter["value"] for parameter in self.parameters}

    def _headline(self) -> str:
        ladder = "; ".join(f"{s['step']}: {_cell(s['train'])}, {_cell(s['held_out'])} held out" for s in self.error_ladder)
        why = f"\nno intervals: {self.withheld}" if self.withheld else ""
        return f"error in noise floors: {ladder}{why}"

    def _table(self) -> list[dict[str, Any]]:
        def interval(parameter: dict[str, Any]) -> str:
            if parameter["at_bound"]:
                return "at its bound"
            ci95 = parameter["ci95"]
            return "withheld" if ci95 is None else f"{_cell(ci95[0])} .. {_cell(ci95[1])}"

        return [
            {"parameter": p["name"], "value": p["value"], "unit": p["unit"], "95 % interval": interval(p)}
            for p in self.parameters
        ]
