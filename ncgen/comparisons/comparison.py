"""A whole comparison: measured section by section, shown as it comes, kept for the report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ncgen.comparisons import compare
from ncgen.comparisons.rivals import Others, nobody
from ncgen.comparisons.rivals.user import UserFunction
from ncgen.errors import NcgenError
from ncgen.model import Model
from ncgen.report.document import Section, aligned, page
from ncgen.report.machine import machine

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXPLAINED = (
    "Errors are against 50 digits; derivatives of rows against differences of the rows themselves with 50 digits. "
    "error: relative to the largest number; ulps, rms: the largest error and the root mean square, in units of the last place of what is "
    "added up in a number. Times are medians of samples taken in turns, of a batch per state; red: generated; circles: timed inside C."
)


@dataclass(frozen=True, kw_only=True)
class Measured:
    """One section: its kernel or table, its title, its records, and rows of cells, titles first."""

    name: str
    title: str
    records: list[dict]
    rows: list[tuple[str, ...]]
    text: str = ""
    is_drawn: bool = False


class Comparison:
    """What `ncgen compare` does with a model.

    users: see ncgen.comparisons.rivals.user; others: what else is set next to the kernels
    Raises ModelError at once for a function of the user's that cannot be compared.
    """

    def __init__(self, model: Model, users: list[str], others: Others = nobody) -> None:
        for text in users:
            UserFunction.of(text)
        self.model, self.users, self.others = model, users, others
        self.machine = machine()
        self.measured: list[Measured] = []

    def sections(self) -> Iterator[Measured]:
        """Measure one section after the other."""
        for section in self.measurements():
            self.measured.append(section)
            yield section

    def measurements(self) -> Iterator[Measured]:
        """The sections, as they are measured."""
        first = True
        for kernel, records in compare.compare(self.model, self.users, self.others):
            yield Measured(
                name=kernel,
                title=compare.TITLES[kernel],
                records=records,
                rows=compare.table(records),
                text=EXPLAINED * first,
                is_drawn=True,
            )
            first = False

    @property
    def records(self) -> list[dict]:
        """All records, plain data."""
        return [{"model": self.model.name, "section": section.name, **record} for section in self.measured for record in section.records]

    @staticmethod
    def lines(section: Measured) -> list[str]:
        """A section for the terminal."""
        return [section.title, *aligned(section.rows), *([section.text] if section.text else []), ""]

    def html(self) -> str:
        """The report as one file."""
        parts = [Section(s.title, s.text, tuple(s.rows), self._plot([s])) for s in self.measured]
        return page(f"{self.model.name}: derivatives compared", parts, self.machine)

    def csv(self) -> str:
        return compare.as_csv(self.records)

    def save_plot(self, path: str | Path) -> None:
        """Write the plots of all kernels into one SVG or PNG file. Raises NcgenError where nothing can be compared."""
        from ncgen.view.figure import save

        chart = self._plot(self.measured)
        if chart is None:
            raise NcgenError(f"{path}: there is nothing in {self.model.name} to compare, and nothing to draw; choose another model")
        save(chart, path)

    def _plot(self, sections: list[Measured]) -> Figure | None:
        drawn = {s.title: s.records for s in sections if s.is_drawn}
        return compare.figure(drawn) if drawn else None
