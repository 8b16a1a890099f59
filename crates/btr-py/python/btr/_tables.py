"""Tables for people: as text, as HTML, as frames."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Any

from btr._optional import needed

if TYPE_CHECKING:
    import pandas

Rows = list[dict[str, Any]]
"""A table: every row has the same keys, which head its columns."""


def cell(value: Any) -> str:
    """A value for people: four digits, a dash for nothing."""
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def probability(share: float) -> str:
    """A probability with two digits, never certain."""
    return ">0.99" if share > 0.99 else "<0.01" if share < 0.01 else f"{share:.2f}"


def text(rows: Rows) -> str:
    """The rows in columns of equal width."""
    if not rows:
        return ""
    cells = [list(rows[0]), *([cell(value) for value in row.values()] for row in rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(cells[0]))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in cells)


def markup(headline: str, rows: Rows) -> str:
    """A headline and the rows as HTML."""
    head = "".join(f"<th>{html.escape(key)}</th>" for key in (rows[0] if rows else {}))
    body = "".join(f"<tr>{''.join(f'<td>{html.escape(cell(x))}</td>' for x in row.values())}</tr>" for row in rows)
    lines = html.escape(headline).replace("\n", "<br>")
    return f"<p>{lines}</p><table><tr>{head}</tr>{body}</table>"


def frame(columns: Any) -> pandas.DataFrame:
    """Rows, or columns by name, as a pandas frame."""
    table: pandas.DataFrame = needed("pandas", "pandas").DataFrame(columns)
    return table
