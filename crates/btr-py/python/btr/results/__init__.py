"""Results of the verbs: the documents of the command line's `--json` as objects with typed attributes."""

from btr.results._base import Reported, Result
from btr.results._coevolve import CoevolveResult
from btr.results._diagnose import DiagnoseResult
from btr.results._effects import EffectsResult
from btr.results._fit import FitResult
from btr.results._logs import CheckResult, CompareResult

__all__ = [
    "CheckResult",
    "CoevolveResult",
    "CompareResult",
    "DiagnoseResult",
    "EffectsResult",
    "FitResult",
    "Reported",
    "Result",
]
