"""`ncgen compare` next to other people's generators, with ∂ẏ/∂y, and with the paper's tables."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks import paper_tables
from benchmarks.rivals import differentiating
from benchmarks.state_jacobian import StateJacobian
from ncgen.comparisons import compare
from ncgen.comparisons.comparison import Comparison, Measured
from ncgen.compiler import compile
from ncgen.mechanism.library import CompiledKernels
from ncgen.model import Model
from ncgen.report.clock import measure

STATE = "∂ẏ/∂y of the state derivative"
ELSEWHERE = "As printed in 2007, on a Pentium IV of 3 GHz with Matlab: other hardware, so only the ratios can be compared."


class WiderComparison(Comparison):
    """tables: whether the paper's Tables 9 and 10 are wanted, too."""

    def __init__(self, model: Model, users: list[str], tables: bool = False) -> None:
        super().__init__(model, users, differentiating)
        self.tables = tables

    def measurements(self) -> Iterator[Measured]:
        yield from super().measurements()
        if records := state_records(compile(self.model, "c")):
            yield Measured(name="state", title=STATE, records=records, rows=compare.table(records), is_drawn=True)
        if self.tables:
            yield from self._of_the_paper()

    def _of_the_paper(self) -> Iterator[Measured]:
        printed = paper_tables.paper_rows(compile(self.model, "c"))
        for number, title, run in (
            ("9", "integrators by source of the derivatives of the rows", paper_tables.table_9),
            ("10", "implicit integrators by source of ∂ẏ/∂y", paper_tables.table_10),
        ):
            records = list(run(self.model))
            if records:
                yield Measured(
                    name=f"table {number}",
                    title=f"The paper's Table {number} again: {title}",
                    records=records,
                    rows=paper_tables.table(records),
                )
            if number in printed:
                yield Measured(
                    name=f"printed {number}", title=f"The paper's Table {number}", records=[], rows=printed[number], text=ELSEWHERE
                )
        if slopes := list(paper_tables.first_slopes(self.model)):
            yield Measured(
                name="slopes",
                title="∂ẏ/∂y by differences at the start, in the steps SciPy takes first",
                records=slopes,
                rows=paper_tables.slope_table(slopes),
            )


def state_records(kernels: CompiledKernels) -> list[dict]:
    """Records of ∂ẏ/∂y, the quickest first; empty where the state derivative is not emitted."""
    state = StateJacobian(kernels)
    if not state.possible:
        return []
    found = state.rivals()
    spent = measure({r.name: r.runs["state"] for r in found}, rounds=9)
    reference = state.exact()
    size = np.max(np.abs(reference), axis=1, keepdims=True) + np.finfo(float).tiny
    records = [compare.record_of(r, "state", spent[r.name], [compare.errors(r, r.values("state"), reference, size)]) for r in found]
    return sorted(records, key=lambda record: record["seconds"])
