"""What a diagnosis suggests, as the page shows it: one card per suspect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Union

from btr._btr import BtrError
from btr._tables import cell
from btr.documents import EffectReport, Estimate, RankedCandidate, RivalProbability, ValueReport
from btr.documents._common import interval
from btr.results import DiagnoseResult
from btr.results._effects import names_of
from btr.results._ladder import entered
from btr.verbs import effects

MOST_OTHERS = 4


@dataclass(frozen=True)
class Candidate:
    """A suspect: an effect, or a value that the model states wrongly."""

    names: tuple[str, ...]
    """Arguments of `fit(add=...)`."""
    law: str
    """Its law, or for a value what the logs say."""
    shows: str
    """How it shows."""
    values: tuple[str, ...]
    """Its parameters with their intervals, as texts."""
    probability: Union[float, None]
    """Posterior probability among the candidates of its round, 0 if it is below 0.01; None where that is not known."""
    established: bool
    """Whether the diagnosis establishes it."""
    alike: tuple[str, ...]
    """What these logs cannot tell it from."""
    rivals: tuple[RivalProbability, ...]
    """Who has the rest of its probability."""
    held_out: Union[float, None]
    """Error on the held-out logs with it, in noise floors; None where that is not known."""
    beside: tuple[str, ...] = ()
    """What the diagnosis had found before it, and had in the model."""
    instead: str = ""
    """The free parameter that may stand in for it; empty for none."""

    @property
    def title(self) -> str:
        """Its name for people."""
        return ", ".join(self.names)


def candidates(found: DiagnoseResult) -> list[Candidate]:
    """The suspects of a diagnosis: what it names, in the order of its ladder, then the best of those that it tried
    beside. None if nothing is missing."""
    if found.verdict == "nothing_missing":
        return []
    suspects = [(names_of([effect]), _effect(effect)) for effect in found.effects]
    suspects += [([f"{value.value}@{value.site}"], _value(value)) for value in found.wrong_values]
    ladder = found.error_ladder
    suspects.sort(key=lambda each: entered(ladder, each[0]) or len(ladder))
    titles = [candidate.title for _, candidate in suspects]
    named = [replace(candidate, beside=tuple(titles[:k])) for k, (_, candidate) in enumerate(suspects)]
    known = {name for candidate in named for name in candidate.names}
    others = [ranked for ranks in found.ranking[:1] for ranked in ranks if ranked.name not in known]
    supports = [*found.effects, *found.wrong_values]
    likely = {rival.name: rival.probability for support in supports for rival in support.rivals}
    ranked = [_other(other, likely) for other in others[:MOST_OTHERS]]
    known.update(name for other in ranked for name in other.names)
    return named + ranked + [other for other in _stood_in(found) if other.title not in known]


def _stood_in(found: DiagnoseResult) -> list[Candidate]:
    """Effects that a free parameter may stand in for."""
    return [replace(plain(name), instead=taken.parameter) for taken in found.stand_ins for name in taken.effects]


def added(names: Sequence[str], diagnoses: Sequence[DiagnoseResult]) -> list[Candidate]:
    """What was added to a model, each by itself, with what it is alike by the last of the diagnoses that named it, or
    something that it is alike."""
    unclear = [suspect for found in reversed(diagnoses) for suspect in candidates(found) if suspect.alike]
    return [_still_open(plain(name), unclear, names) for name in names]


def _still_open(card: Candidate, suspects: Sequence[Candidate], added: Sequence[str]) -> Candidate:
    """A card of something that was added, with what it cannot be told from; that is left out if it was added, too."""
    (name,) = card.names
    for suspect in suspects:
        if name not in (*suspect.names, *suspect.alike):
            continue
        others = [*suspect.names, *suspect.alike] if name in suspect.alike else suspect.alike
        likely = [*suspect.rivals]
        if name in suspect.alike and suspect.probability is not None:
            likely += [RivalProbability(name=other, probability=suspect.probability) for other in suspect.names]
        alike = tuple(other for other in others if other not in added)
        return replace(card, alike=alike, rivals=tuple(rival for rival in likely if rival.name in alike))
    return card


def plain(name: str) -> Candidate:
    """An effect or a value by its name alone."""
    law, shows = _law(name.partition("@")[0])
    return Candidate((name,), law, shows, (), None, False, (), (), None)


def _effect(report: EffectReport) -> Candidate:
    law, shows = _law(report.effect)
    return Candidate(
        names=tuple(names_of([report])),
        law=law,
        shows=shows,
        values=tuple(map(_estimate, report.parameters)),
        probability=report.probability,
        established=report.established,
        alike=tuple(report.alike),
        rivals=tuple(report.rivals),
        held_out=None,
    )


def _value(report: ValueReport) -> Candidate:
    stated = report.parameters
    told = [f"{p.name}: {cell(p.value)} {p.unit} in the logs, {cell(p.in_model)} in the model" for p in stated]
    return Candidate(
        names=tuple(parameter.name for parameter in report.parameters),
        law="; ".join(told),
        shows="the model states another value",
        values=tuple(map(_estimate, report.parameters)),
        probability=report.probability,
        established=report.established,
        alike=tuple(report.alike),
        rivals=tuple(report.rivals),
        held_out=None,
    )


def _other(ranked: RankedCandidate, likely: Mapping[Union[str, None], float]) -> Candidate:
    """A suspect that was not chosen; `likely` are the probabilities from 0.01 on, none where they are not known."""
    probability = likely.get(ranked.name, 0.0) if likely else None
    return replace(plain(ranked.name), held_out=ranked.held_out, probability=probability)


def _law(effect: str) -> tuple[str, str]:
    """Law and symptoms of an effect of the library; empty for anything else."""
    try:
        (known,) = effects(effect).effects[:1]
    except BtrError:
        return "", ""
    return known.law, known.shows


def _estimate(parameter: Estimate) -> str:
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    return f"{parameter.name} = {cell(parameter.value)}{unit}; 95\u00a0%: {interval(parameter)}"
