"""Doubts about the logs: what `check` finds, or what a diagnosis or a fit leaves of that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Union

from btr.documents import Doubt
from btr.results import CheckResult, DiagnoseResult, FitResult


@dataclass(frozen=True)
class Doubts:
    """Findings about the logs that make results doubtful."""

    of: str
    """Whose findings these are, and what is left out."""
    findings: Sequence[tuple[str, str, str]]
    """Severity, name of the log and sentence, the worst first."""
    remedies: Sequence[str] = ()
    """What several joints have in common, with the lines that mend it."""


def of_check(found: CheckResult) -> Doubts:
    """All that `check` finds to be more than fine."""
    findings = [(log.log, finding) for log in found.logs for finding in log.findings if finding.severity != "fine"]
    lines = [(finding.severity, log, finding.sentence) for log, finding in findings]
    remedies = [f"{common.sentence}\n{common.fix}" for common in found.in_common if common.severity != "fine"]
    of = "Found in the logs before any fit, as by btr check; a fit leaves out what its model explains."
    return Doubts(of, _worst_first(lines), remedies)


def of_result(found: Union[DiagnoseResult, FitResult]) -> Doubts:
    """What a diagnosis or a fit is left with: as many findings as its report and the terminal count."""
    which = "diagnosis" if isinstance(found, DiagnoseResult) else "fit"
    of = f"Of the {which}, as its report and the terminal count them: what its model explains is left out."
    return Doubts(of, _worst_first([_line(doubt) for doubt in found.doubts]))


def _line(doubt: Doubt) -> tuple[str, str, str]:
    return doubt.severity, doubt.log, doubt.sentence


def _worst_first(lines: Sequence[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
    named = [(severity, PurePath(log).name or log, sentence) for severity, log, sentence in lines]
    return sorted(named, key=lambda line: line[0] != "bad")
