"""What all results have in common."""

from __future__ import annotations

import html
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from btr import _tables
from btr._btr import Page, write_report
from btr._tables import Rows
from btr.documents._record import declared, lookup

if TYPE_CHECKING:
    import pandas


class Result:
    """A result. Every key of its document is an attribute and an item; `document` is all of it."""

    ok: bool
    """Always true: failures are exceptions."""

    def __init__(self, document: dict[str, Any]) -> None:
        self.document = document

    # Hidden from type checkers, which then report attributes that are not declared.
    if not TYPE_CHECKING:

        def __getattr__(self, key: str) -> Any:
            # `document` itself is missing while a pickle is read.
            if key == "document":
                raise AttributeError(key)
            if key == "report":
                raise AttributeError(f"{type(self).__name__} has no report: compare, diagnose and fit have one")
            return lookup(type(self), self.document, key)

    def __getitem__(self, key: str) -> Any:
        if key not in self.document:
            raise KeyError(key)
        return lookup(type(self), self.document, key)

    def __iter__(self) -> Iterator[str]:
        return iter(self.document)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *declared(type(self)), *self.document})

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.document == other.document

    __hash__ = None  # type: ignore[assignment]

    def _headline(self) -> str:
        raise NotImplementedError

    def _table(self) -> Rows:
        """The table that `to_dataframe` gives."""
        raise NotImplementedError

    def to_dataframe(self) -> pandas.DataFrame:
        """The result's table as a pandas frame. Raises `ImportError` without pandas."""
        return _tables.frame(self._table())

    def _shown(self) -> Rows:
        """The rows of the table that are printed."""
        return self._table()

    def __repr__(self) -> str:
        return f"{self._headline()}\n\n{_tables.text(self._shown())}".rstrip()

    def _repr_html_(self) -> str:
        return _tables.markup(self._headline(), self._shown())


class Reported(Result):
    """A result with a report: the page that the command line writes with `--report`."""

    def __init__(self, document: dict[str, Any], page: Page) -> None:
        super().__init__(document)
        self._page: Page | str = page

    def report(self, path: str | os.PathLike[str]) -> None:
        """Writes the report as one self-contained HTML file with plots. The file is written completely or not at all.
        Raises `BtrError` if the name does not end in `.html` or the file cannot be written."""
        write_report(Path(path), self._html())

    def _html(self) -> str:
        # Drawn on first use: this can take as long as the comparison.
        if not isinstance(self._page, str):
            self._page = self._page.html()
        return self._page

    def _repr_html_(self) -> str:
        # A frame separates the page's style from the notebook's.
        page = html.escape(self._html())
        return f'<iframe srcdoc="{page}" title="report" style="width:100%;height:40rem;border:0"></iframe>'

    def __getstate__(self) -> dict[str, Any]:
        self._html()
        return self.__dict__
