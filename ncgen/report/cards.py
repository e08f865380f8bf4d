"""What a model, kernels and a trajectory show of themselves in a notebook: a card of HTML, small, quick and without scripts.

A card is made of parts, and one that cannot be made says why in its place: a model half built has a card, too.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ncgen.compiler import Timings, compile, sources_of
from ncgen.emit.environment import render
from ncgen.errors import counted, shortened
from ncgen.mechanism import recall
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.report.inspection import inspect
from ncgen.solver.groups import CONSISTENT_RESIDUAL
from ncgen.solver.positions.assembly import assemble
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.positions.position import residual
from ncgen.solver.positions.rank import freedom
from ncgen.view.curve_pictures import curves_of_motion
from ncgen.view.scene import scene_of
from ncgen.view.sketch import sketch
from ncgen.view.spots import spots
from ncgen.view.svg import SvgDrawing

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

MAX_UNCOMPILED_ROWS = 40
"""Rows up to which freedoms are found for a model's card where the model was not compiled before: it takes a second at most."""

LISTED = 100
"""Rows of a table."""

MAX_CELL_CHARACTERS = 80
"""Characters of a cell."""

MAX_TIMES = 200
"""Of a motion, that a card looks at."""

LINES = 6
"""Of redundant constraints, and twice as many coordinates, that are shown at once."""


@dataclass(frozen=True)
class CardTable:
    """Rows of cells behind a title that opens them; numbers: cells but the first stand to the right."""

    title: str
    rows: Sequence[Sequence[str]]
    numbers: bool = False
    open: bool = False


@dataclass(frozen=True)
class Picture:
    title: str
    svg: SvgDrawing


@dataclass(kw_only=True)
class Card:
    """What is shown; a part that cannot be made becomes a line that says why."""

    name: str
    kind: str
    lines: list[str] = field(default_factory=list)
    tables: list[CardTable] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)

    def add(self, title: str, parts: Callable[[], Iterable[str | CardTable | Picture]]) -> None:
        """Add lines, tables and pictures; title: for the line that says why it is not there."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                items = list(parts())
        except Exception as error:  # a card is looked at while something is wrong
            items = [f"{title}: {shortened(str(error) or type(error).__name__)}"]
        for item in items:
            kept: list = self.lines if isinstance(item, str) else self.tables if isinstance(item, CardTable) else self.pictures
            kept.append(item)

    def html(self) -> str:
        return render("html/card.html.jinja", **{name: getattr(self, name) for name in ("name", "kind", "lines", "tables", "pictures")})


def of_model(model: Model) -> str:
    """Drawing, degrees of freedom, constraints and numbers of a model as they are now."""
    card = Card(name=model.name, kind="model")
    card.add("counts", lambda: [f"{_free(model)} of {len(model.components)} coordinates free"])
    card.add("bodies", lambda: [counted(len(model.bodies), "body")])
    card.add("degrees of freedom", lambda: _freedoms_of_model(model))
    card.add("constraints", lambda: _rows(model))
    card.add("numbers", lambda: _numbers(model))
    card.add("drawing", lambda: [Picture("", sketch(scene_of(model)))])
    return card.html()


def of_kernels(kernels: Kernels) -> str:
    """Degrees of freedom, operations, and where Φ_q and M have numbers, rows that others imply in red."""
    card = Card(name=kernels.name, kind=f"kernels in {kernels.backend}")
    card.add("counts", lambda: [f"{counted(kernels.n, 'coordinate')}, {counted(kernels.m, 'row')}"])
    card.add("degrees of freedom", lambda: _freedoms(kernels))
    card.add("kernels", lambda: [_operations(kernels)])
    for name, pattern in (("Φ_q", kernels.phi_q_pattern), ("M", kernels.mass_pattern)):
        title = f"{name} {pattern.shape[0]} × {pattern.shape[1]}, {pattern.nonzeros} nonzeros"
        card.add(title, lambda name=name, pattern=pattern, title=title: [Picture(title, spots(pattern, title, _implied(kernels, name)))])
    return card.html()


def of_trajectory(run: Trajectory) -> str:
    """Where a motion ended, how well it was kept, and its curves."""
    card = Card(name=run.name, kind="trajectory")
    thinned = run.thinned(MAX_TIMES) if len(run.t) else run
    card.add("time", lambda: [_time(run)])
    card.add("energy error", lambda: [f"energy error {run.energy_drift if len(run.t) <= 10 * MAX_TIMES else thinned.energy_drift:.1e}"])
    card.add("constraint error", lambda: [f"constraint error {thinned.violation().max():.1e}"])
    card.add("end", lambda: [_end(run)])
    card.add("drawing", lambda: [Picture(f"t = {run.t[-1]:.4g} s", sketch(scene_of(thinned), -1))])
    card.add("curves", lambda: [Picture("", curves_of_motion(thinned))])
    return card.html()


# -- parts of a model's card ---------------------------------------------------------------------------------------------------------------


def _free(model: Model) -> int:
    return sum(not component.fixed for component in model.components)


def _freedoms_of_model(model: Model) -> list[str]:
    """Degrees of freedom where they are known or quickly found, else how many there are at least."""
    sources = None
    if len(model.rows) <= MAX_UNCOMPILED_ROWS:
        sources = sources_of(model, "auto", Timings())
    elif key := recall.key(model, "auto"):
        sources = recall.recall(model, "auto", key)
    if sources is not None:
        kernels = compile(sources, "numpy")
        return _freedoms(kernels)
    least = max(0, _free(model) - len(model.rows))
    return [f"{counted(least, 'degree of freedom')} or more; ncgen.freedom(ncgen.compile(model)) counts them"]


def _freedoms(kernels: Kernels) -> list[str]:
    """Degrees of freedom and the rows that others imply. Raises NcgenError where the mechanism does not close."""
    q = kernels.q0
    if residual(kernels, q, 0.0, refresh_branches(kernels, q, kernels.p0)) > CONSISTENT_RESIDUAL:
        q = assemble(kernels, q)
    freedoms = freedom(kernels, q)
    lines = [counted(freedoms.dof, "degree of freedom")]
    if freedoms.is_singular:
        lines.append("the initial position is singular")
    for redundancy in freedoms.redundant[:LINES]:
        others = ", ".join(str(row + 1) for row in redundancy.implied_by)
        lines.append(f"constraint {redundancy.row + 1} ({kernels.rows[redundancy.row].label}) follows from {others}")
    if len(freedoms.redundant) > LINES:
        lines.append(f"and {len(freedoms.redundant) - LINES} more rows follow from others")
    return lines


def _rows(model: Model) -> list[str | CardTable]:
    if not model.rows:
        return ["no constraints"]
    cells = [(str(number), row.code or "", row.label, str(row.owner)) for number, row in enumerate(model.rows[:LISTED], 1)]
    more = [("…", "", f"{len(model.rows) - LISTED} more", "")] if len(model.rows) > LISTED else []
    return [CardTable(counted(len(model.rows), "constraint"), [_cells(row) for row in [*cells, *more]])]


def _numbers(model: Model) -> list[CardTable]:
    cells = [_cells((name, f"{number.default:g}", number.unit)) for name, number in [*model.numbers.items()][:LISTED]]
    return [CardTable(f"parameters and inputs: {len(model.numbers)}", cells)] if cells else []


# -- parts of the kernels' card ------------------------------------------------------------------------------------------------------------


def _operations(kernels: Kernels) -> CardTable:
    rows = [("kernel", "numbers", "operations", "sin, cos …")]
    for name, record in inspect(kernels)["kernels"].items():
        rows.append((name, str(record["nonzeros"]), str(record["operations"]), str(record["calls"] or "")))
    return CardTable("operations", rows, numbers=True, open=True)


def _implied(kernels: Kernels, name: str) -> set[int]:
    """Rows of a matrix that others imply."""
    return {redundancy.row for redundancy in freedom(kernels).redundant} if name == "Φ_q" else set()


# -- parts of a trajectory's card ----------------------------------------------------------------------------------------------------------


def _time(run: Trajectory) -> str:
    ended = ", ended where it was told to" if run.stopped else ""
    return f"{len(run.t)} instants from {run.t[0]:g} to {run.t[-1]:g} s{ended}; {run.integrator} on {run.formalism}"


def _end(run: Trajectory) -> CardTable:
    names = run.independent
    rows = [("", "end", "velocity")]
    rows += [_cells((name, f"{run[name][-1]:.9g}", f"{run[f'rate({name})'][-1]:.9g}")) for name in names[:LISTED]]
    return CardTable("independent coordinates", rows, numbers=True, open=len(names) <= 2 * LINES)


def _cells(texts: Iterable[object]) -> tuple[str, ...]:
    return tuple(shortened(str(text), MAX_CELL_CHARACTERS) for text in texts)
