"""The reference of effects, from what the library says of itself."""

from __future__ import annotations

from pathlib import Path

import pictures

import btr

SITES = {
    "joint": "On a joint",
    "link": "On a link",
    "base": "On the base",
    "ground": "On the floor",
    "robot": "On the whole robot",
}
BEGIN = """# Effects

These are the physical effects that btr can add to a model, fit, and diagnose. Each has an *off* value, at which the
model is unchanged. `btr effects` lists them, `btr effects NAME` describes one. In a model file, a known effect is a
table `[[effects]]`; `effect.parameter@site` in `[parameters]` makes a value free
([how to add an effect](../howto/effects.md)). Parameters that only shape an effect do not switch it on.

The pictures are made by btr. A robot is simulated with and without the effect, at its typical values; what is drawn is
the error of a model that lacks it, measured minus model. On the left is the error of each joint over time. On the right
is that of one joint over what it follows, or the channel as measured and as simulated. Where torques are drawn, the
joints follow the same motion with and without the effect.
"""


def pages(robots: Path) -> dict[str, str | bytes]:
    """The page and its pictures."""
    specs = list(btr.effects().effects)
    drawn = pictures.pictures(specs, robots)
    parts = [BEGIN]
    for site, title in SITES.items():
        parts.append(f"\n## {title}\n")
        parts += [_section(spec, spec.effect in drawn) for spec in specs if spec.site == site]
    page: dict[str, str | bytes] = {"reference/effects.md": "\n".join(parts)}
    return page | {f"reference/effects/{name}.svg": text for name, text in drawn.items()}


def _section(spec: btr.documents.EffectSpec, is_drawn: bool) -> str:
    lines = [f"### {spec.effect}", "", f"Law: {_plain(spec.law)}", "", f"How it shows: {_plain(spec.shows)}.", ""]
    if spec.parameters:
        lines += ["| parameter | unit | bounds | off | typical | |", "|---|---|---|---|---|---|"]
        lines += [_row(parameter) for parameter in spec.parameters]
        lines.append("")
    if spec.alike:
        others = ", ".join(f"[{name}](#{name})" for name in spec.alike)
        lines += [f"Most motions cannot tell it from {others}.", ""]
    lines += [f"Source: {_plain(spec.source)}.", ""]
    if is_drawn:
        lines += [f"![The error of a model without {spec.effect}](effects/{spec.effect}.svg){{ loading=lazy }}", ""]
    return "\n".join(lines)


def _row(parameter: btr.documents.EffectParameter) -> str:
    most = "∞" if parameter.max is None else f"{parameter.max:g}"
    off = "none" if parameter.off is None else f"{parameter.off:g}"
    kind = "shapes the effect" if parameter.shape else ""
    bounds = f"{parameter.min:g} to {most}"
    return f"| `{parameter.name}` | {parameter.unit} | {bounds} | {off} | {parameter.typical:g} | {kind} |"


def _plain(text: str) -> str:
    """Text in which stars, bars and underscores are themselves."""
    return "".join(f"\\{letter}" if letter in "*_|<[`" else letter for letter in text)
