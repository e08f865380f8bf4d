"""A whole comparison: measured section by section, shown as it comes, kept for the report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ncgen.comparisons import compare, paper_tables
from ncgen.comparisons.bench import aligned
from ncgen.comparisons.rivals.user import UserFunction
from ncgen.compiler import compile
from ncgen.errors import NcgenError
from ncgen.model import Model
from ncgen.report.document import Section, page
from ncgen.report.machine import machine

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXPLAINED = (
    "Errors are against 50 digits; derivatives of rows against differences of the rows themselves with 50 digits. "
    "error: relative to the largest number; ulps, rms: the largest error and the root mean square, in units of the last place of what is "
    "added up in a number. Times are medians of samples taken in turns, of a batch per state; red: generated; circles: timed inside C."
)
ELSEWHERE = "As printed in 2007, on a Pentium IV of 3 GHz with Matlab: other hardware, so only the ratios can be compared."


@dataclass(frozen=True)
class Measured:
    """One section: its kernel or table, its title, its records, and rows of cells, titles first."""

    name: str
    title: str
    records: list[dict]
    rows: list[tuple[str, ...]]
    text: str = ""


class Comparison:
    """What `ncgen compare` does with a model.

    users: see ncgen.comparisons.rivals.user; tables: whether the paper's Tables 9 and 10 are wanted, too
    Raises ModelError at once for a function of the user's that cannot be compared.
    """

    def __init__(self, model: Model, users: list[str], tables: bool = False) -> None:
        for text in users:
            UserFunction.of(text)
        self.model, self.users, self.tables = model, users, tables
        self.machine = machine()
        self.measured: list[Measured] = []

    def sections(self) -> Iterator[Measured]:
        """Measure one section after the other."""
        for section in self._sections():
            self.measured.append(section)
            yield section

    def _sections(self) -> Iterator[Measured]:
        first = True
        for kernel, records in compare.compare(self.model, self.users):
            yield Measured(kernel, compare.TITLES[kernel], records, compare.table(records), EXPLAINED * first)
            first = False
        if not self.tables:
            return
        printed = paper_tables.paper_rows(compile(self.model, "c"))
        for number, title, run in (
            ("9", "integrators by source of the derivatives of the rows", paper_tables.table_9),
            ("10", "implicit integrators by source of ∂ẏ/∂y", paper_tables.table_10),
        ):
            records = list(run(self.model))
            if records:
                yield Measured(f"table {number}", f"The paper's Table {number} again: {title}", records, paper_tables.table(records))
            if number in printed:
                yield Measured(f"printed {number}", f"The paper's Table {number}", [], printed[number], ELSEWHERE)
        if slopes := list(paper_tables.first_slopes(self.model)):
            yield Measured(
                "slopes", "∂ẏ/∂y by differences at the start, in the steps SciPy takes first", slopes, paper_tables.slope_table(slopes)
            )

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
        drawn = {s.name: s.records for s in sections if s.name in compare.TITLES}
        return compare.figure(drawn) if drawn else None
