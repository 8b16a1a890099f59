"""Back-to-Reality: compares a model with measurements, diagnoses which physical effect it lacks, adds it and fits it.

    import btr

    model = btr.load_model("leg.toml")
    answer = btr.diagnose(model, ["monday.mcap"], held_out=["friday.mcap"])
    fitted = btr.fit(model, ["monday.mcap"], held_out=["friday.mcap"], add=answer.names)
    fitted.model.save("fitted.toml")

A log is a path (CSV, MCAP, an episode of a LeRobot data set, a bag), a `Log`, or a pandas or polars frame with a column
`t` in seconds. Results have typed attributes (`btr.documents`). Errors are `BtrError`, with a remedy. Simulations run
on all cores without holding Python's lock; with laws that are functions (`Model.add_law`) this needs several processes
(`btr.executors`).
"""

from btr import distance, documents, executors, mujoco, search
from btr._btr import BtrError, Log, TestFailed, __version__
from btr._studio import studio
from btr.coevolution import coevolve
from btr.controller import Controller
from btr.documents import Iteration
from btr.exported import Exported
from btr.logs import load_log
from btr.model import Model, load_model
from btr.results import CheckResult, CoevolveResult, CompareResult, DiagnoseResult, EffectsResult, FitResult
from btr.verbs import add, check, compare, diagnose, effects, fit

__all__ = [
    "BtrError",
    "CheckResult",
    "CoevolveResult",
    "CompareResult",
    "Controller",
    "DiagnoseResult",
    "EffectsResult",
    "Exported",
    "FitResult",
    "Iteration",
    "Log",
    "Model",
    "TestFailed",
    "__version__",
    "add",
    "check",
    "coevolve",
    "compare",
    "diagnose",
    "distance",
    "documents",
    "effects",
    "executors",
    "fit",
    "load_log",
    "load_model",
    "mujoco",
    "search",
    "studio",
]
