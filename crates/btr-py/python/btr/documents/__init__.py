"""Types of the JSON documents that verbs give: what `answer.effects[0]` or `fitted.parameters[0]` is.

Each class is a dictionary with the keys of the command line's `--json`. Declared keys are typed attributes as well:
`answer.effects[0].site` is `answer.effects[0]["site"]`. Keys that a later version adds are items, and attributes
without a type. A declared key that a document does not have is None if its type allows that. Pairs such as `ci95` are
typed as tuples and are lists of two at run time, as in JSON.
"""

from btr.documents._common import (
    Dimension,
    Doubt,
    Estimate,
    Finding,
    FitStop,
    LadderStep,
    NoiseFloor,
    NullDirection,
    Severity,
    Topic,
    Verdict,
)
from btr.documents._check import CheckedLog, ClockReport, CommandLag, CommandResponse, Sensitivity, SensorReport
from btr.documents._compare import ChannelError, Clue, Regime, RegimeFailure
from btr.documents._diagnose import (
    EffectReport,
    LawReport,
    NextExperiment,
    RankedCandidate,
    RivalExplanation,
    StatedLow,
)
from btr.documents._effects import EffectParameter, EffectSpec
from btr.documents._run import (
    Augmentation,
    Belief,
    ByDistance,
    Cause,
    Change,
    ChannelScore,
    Drift,
    EstimateRecord,
    Evidence,
    Iteration,
    LogScore,
    MissingEffect,
    OpenDirection,
    RealityGap,
    Recommended,
    StopReason,
    TwinComparison,
)
from btr.documents._tests import Done, Failed, Generation, MapReport, Promise, TestDoubt, TestEntry, TestVerdict, Trial
from btr.documents._record import Record

__all__ = [
    "Augmentation",
    "Belief",
    "ByDistance",
    "Cause",
    "Change",
    "ChannelError",
    "ChannelScore",
    "CheckedLog",
    "ClockReport",
    "Clue",
    "CommandLag",
    "CommandResponse",
    "Dimension",
    "Done",
    "Doubt",
    "Drift",
    "EffectParameter",
    "EffectReport",
    "EffectSpec",
    "Estimate",
    "EstimateRecord",
    "Evidence",
    "Failed",
    "Finding",
    "FitStop",
    "Generation",
    "Iteration",
    "LadderStep",
    "LawReport",
    "LogScore",
    "MapReport",
    "MissingEffect",
    "NextExperiment",
    "NoiseFloor",
    "NullDirection",
    "OpenDirection",
    "Promise",
    "RankedCandidate",
    "RealityGap",
    "Recommended",
    "Record",
    "Regime",
    "RegimeFailure",
    "RivalExplanation",
    "Sensitivity",
    "SensorReport",
    "Severity",
    "StatedLow",
    "StopReason",
    "TestDoubt",
    "TestEntry",
    "TestVerdict",
    "Topic",
    "Trial",
    "TwinComparison",
    "Verdict",
]
