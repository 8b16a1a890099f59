"""Effects of the library, and effects that were found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Union

from btr import documents as doc
from btr._tables import Rows
from btr.results._base import Result


def names_of(effects: Sequence[Union[doc.EffectReport, doc.MissingEffect]]) -> list[str]:
    """The effects as `effect@site`."""
    sites = [(e.effect, e.site if isinstance(e.site, list) else [e.site]) for e in effects]
    return [f"{effect}@{site}" for effect, all_sites in sites for site in all_sites]


class EffectsResult(Result):
    """Physical effects (`effects`), each with its law, parameters and bounds."""

    effects: list[doc.EffectSpec]
    """The effects."""

    def _headline(self) -> str:
        if len(self.effects) > 1:
            return f"{len(self.effects)} effects; btr.effects(name) tells all about one"
        (effect,) = self.effects
        alike = f"\nalike: {', '.join(effect.alike)}" if effect.alike else ""
        about = f"{effect.effect}: {effect.law}\nsite: {effect.site}\nshows: {effect.shows}\nsource: {effect.source}"
        return about + alike

    def _table(self) -> Rows:
        if len(self.effects) > 1:
            listed = ((effect, ", ".join(parameter.name for parameter in effect.parameters)) for effect in self.effects)
            return [{"effect": effect.effect, "site": effect.site, "parameters": names} for effect, names in listed]
        keys = {"name": "parameter", "unit": "unit", "min": "min", "max": "max", "off": "off", "typical": "typical"}
        return [{title: parameter[key] for key, title in keys.items()} for parameter in self.effects[0].parameters]


def removable(idle: Sequence[str]) -> str:
    """That effects, as `effect@site`, do nothing, and how to be rid of them; nothing if there are none."""
    if not idle:
        return ""
    does, them = ("does", "it") if len(idle) == 1 else ("do", "them")
    return f"\n{', '.join(idle)} {does} nothing in these logs; to remove {them}, leave {them} out of `add`"
