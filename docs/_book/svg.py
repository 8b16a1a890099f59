"""A small writer of plots as SVG, on a light ground that is readable beside light and dark pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]
WIDTH, HEIGHT = 690, 230
TOP, BOTTOM, GAP = 30, 44, 62
COLOURS = ("#0f766e", "#c2410c", "#6d28d9", "#475569")


@dataclass(frozen=True)
class Curve:
    """Points of one name, in the colour of this number."""

    name: str
    x: Values
    y: Values
    colour: int = 0


@dataclass(frozen=True)
class Panel:
    """A plot: lines, or dots where the points have no order."""

    title: str
    x_label: str
    y_label: str
    curves: Sequence[Curve]
    dots: bool = False
    width: float = 1.0


@dataclass
class _Axes:
    left: float
    right: float
    x: tuple[float, float]
    y: tuple[float, float]
    parts: list[str] = field(default_factory=list)

    def at(self, x: float, y: float) -> tuple[float, float]:
        share_x = (x - self.x[0]) / (self.x[1] - self.x[0])
        share_y = (y - self.y[0]) / (self.y[1] - self.y[0])
        return self.left + share_x * (self.right - self.left), HEIGHT - BOTTOM - share_y * (HEIGHT - BOTTOM - TOP)


def drawn(panels: Sequence[Panel], alt: str) -> str:
    """The panels beside each other."""
    style = "font-family:system-ui,sans-serif;font-size:11px;fill:#334155"
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" role="img"'
    parts = [f'{head} style="{style}"><title>{escape(alt)}</title>']
    parts.append(f'<rect width="{WIDTH}" height="{HEIGHT}" rx="6" fill="#fbfbfa"/>')
    free = WIDTH - 14 - GAP * len(panels)
    left = 0.0
    for panel in panels:
        left += GAP
        right = left + free * panel.width / sum(other.width for other in panels)
        parts += _panel(panel, left, right)
        left = right
    return "\n".join([*parts, "</svg>\n"])


def _panel(panel: Panel, left: float, right: float) -> list[str]:
    axes = _Axes(left, right, _range([c.x for c in panel.curves]), _range([c.y for c in panel.curves], 0.06))
    _grid(axes, panel)
    for curve in panel.curves:
        _curve(axes, curve, COLOURS[curve.colour], panel.dots)
    if len(panel.curves) > 1:
        _legend(axes, panel.curves)
    return axes.parts


def _range(series: Sequence[Values], margin: float = 0.0) -> tuple[float, float]:
    together = np.concatenate(series)
    low, high = float(together.min()), float(together.max())
    # What only differs in the last bits is a constant.
    constant = high - low < 1e-9 * max(abs(high), abs(low), 1e-9)
    spread = max(abs(high), 1e-3) if constant else (high - low) * margin
    return low - spread, high + spread


def _grid(axes: _Axes, panel: Panel) -> None:
    bottom = HEIGHT - BOTTOM
    for tick in ticks(*axes.y, 5):
        y = axes.at(axes.x[0], tick)[1]
        colour = "#94a3b8" if tick == 0 else "#e2e8f0"
        axes.parts.append(f'<path d="M{axes.left:.1f} {y:.1f}H{axes.right:.1f}" stroke="{colour}"/>')
        axes.parts.append(f'<text x="{axes.left - 5:.1f}" y="{y + 4:.1f}" text-anchor="end">{tick:.4g}</text>')
    for tick in ticks(*axes.x, 6 if panel.width > 1 else 4):
        x = axes.at(tick, axes.y[0])[0]
        axes.parts.append(f'<path d="M{x:.1f} {bottom}v4" stroke="#94a3b8"/>')
        axes.parts.append(f'<text x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{tick:.4g}</text>')
    middle = (axes.left + axes.right) / 2
    axes.parts.append(f'<path d="M{axes.left:.1f} {bottom}H{axes.right:.1f}" stroke="#94a3b8"/>')
    axes.parts.append(f'<text x="{middle:.1f}" y="{HEIGHT - 10}" text-anchor="middle">{escape(panel.x_label)}</text>')
    axes.parts.append(
        f'<text transform="translate({axes.left - 48:.1f} {(TOP + bottom) / 2:.1f}) rotate(-90)" '
        f'text-anchor="middle">{escape(panel.y_label)}</text>'
    )
    axes.parts.append(f'<text x="{axes.left:.1f}" y="18" style="font-weight:600">{escape(panel.title)}</text>')


def _curve(axes: _Axes, curve: Curve, colour: str, dots: bool) -> None:
    points = [axes.at(x, y) for x, y in zip(curve.x, curve.y)]
    if dots:
        path = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in points)
        stroke = 'stroke-width="2.4" stroke-linecap="round" stroke-opacity="0.55"'
    else:
        path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
        stroke = 'stroke-width="1.4" stroke-linejoin="round"'
    axes.parts.append(f'<path d="{path}" fill="none" stroke="{colour}" {stroke}/>')


def _legend(axes: _Axes, curves: Sequence[Curve]) -> None:
    right = axes.right
    for curve in reversed(curves):
        right -= 6.2 * len(curve.name) + 27
        colour = COLOURS[curve.colour]
        axes.parts.append(f'<path d="M{right:.1f} 14h12" stroke="{colour}" stroke-width="2.4"/>')
        axes.parts.append(f'<text x="{right + 16:.1f}" y="18">{escape(curve.name)}</text>')


def ticks(low: float, high: float, most: int) -> list[float]:
    """Round numbers in a range, about as many as stated."""
    base = 10.0 ** np.floor(np.log10((high - low) / most))
    step = base * next((factor for factor in (1.0, 2.0, 2.5, 5.0) if (high - low) / (factor * base) <= most), 10.0)
    return [round(k * step, 12) for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]
