"""The kernels of a mechanism: their inputs, the terms that enter, and how a term contributes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

from ncgen.program.binding import TermOperands
from ncgen.program.programs import ENERGIES
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.templates import TemplateOutput
from ncgen.symbolic.term import Term


class Axis(NamedTuple):
    """Where a contribution goes along one axis of a kernel's output.

    kind: the term's own row, its coordinate of a number, the energy or the parameter of a number
    """

    kind: Literal["row", "coordinate", "energy", "parameter"]
    number: int = 0


Place: TypeAlias = tuple[Axis, ...]
"""What tells the contributions of a term apart: where each goes, along every axis of the output."""

Nodes: TypeAlias = dict[TemplateOutput, int]
"""{output of a template: its node}."""

Parts: TypeAlias = Callable[[TermOperands, Nodes], Iterable[tuple[Place, int]]]
"""(places, outputs) -> the contributions of a term: pairs (place, node)."""

ROW = Axis("row")


@dataclass(frozen=True, kw_only=True)
class Kernel:
    """What a kernel is: its inputs, which terms enter, and how a term contributes.

    shape: the output's axes, "m" rows, "n" coordinates, "e" energies, "w" the power, "p" parameters; two axes make a sparse matrix
    wants: names of the outputs of templates that contributions are made of
    """

    name: str
    inputs: tuple[str, ...]
    shape: str
    terms: Callable[[Terms], tuple[Term, ...]]
    wants: tuple[str, ...]
    parts: Parts


def _row(name: str) -> Parts:
    def parts(operands: TermOperands, outputs: Nodes) -> Iterator[tuple[Place, int]]:
        yield (ROW,), outputs[TemplateOutput(name)]

    return parts


def chain(name: str, order: int, by_row: bool) -> Parts:
    """Contributions per coordinate (order 1) or pair of coordinates (order 2), by the chain rule."""

    def parts(operands: TermOperands, outputs: Nodes) -> Iterator[tuple[Place, int]]:
        graph = operands.graph
        weights = [operands.weights(c) for c in range(len(operands.bound.coordinates))]
        axes = [Axis("coordinate", c) for c in range(len(weights))]
        head = (ROW,) if by_row else ()
        made: dict[tuple[int, int], int] = {}
        for i, first in enumerate(weights):
            if order == 1:
                pieces = [graph.mul(w, outputs[output]) for k, w in first if (output := TemplateOutput(name, (k,))) in outputs]
                yield (*head, axes[i]), graph.sum(pieces)
                continue
            for j, second in enumerate(weights):
                if i <= j:  # of a symmetric matrix each pair is computed once, so that it is symmetric to the last bit
                    made[i, j] = graph.sum(
                        graph.mul(graph.mul(w, x), outputs[TemplateOutput(name, (k, l))]) for k, w in first for l, x in second
                    )
                yield (*head, axes[i], axes[j]), made[min(i, j), max(i, j)]

    return parts


def _energies(operands: TermOperands, outputs: Nodes) -> Iterator[tuple[Place, int]]:
    for k, name in enumerate(ENERGIES):
        if TemplateOutput(name) in outputs:
            yield (Axis("energy", k),), outputs[TemplateOutput(name)]


def _power(operands: TermOperands, outputs: Nodes) -> Iterator[tuple[Place, int]]:
    if TemplateOutput("power") in outputs:
        yield (Axis("energy"),), outputs[TemplateOutput("power")]


POSITION, VELOCITY = ("t", "q", "p"), ("t", "q", "qd", "p")


def _rows(equations: Terms) -> tuple[Term, ...]:
    return equations.rows


def _masses(equations: Terms) -> tuple[Term, ...]:
    return equations.masses


def with_inertia(equations: Terms) -> tuple[Term, ...]:
    """Terms that carry forces and energies: bodies, too, by velocity-dependent inertia."""
    return equations.masses + equations.forces


KERNELS = {
    kernel.name: kernel
    for kernel in [
        Kernel(name="phi", inputs=POSITION, shape="m", terms=_rows, wants=("phi",), parts=_row("phi")),
        Kernel(name="phi_q", inputs=POSITION, shape="mn", terms=_rows, wants=("phi_q",), parts=chain("phi_q", 1, True)),
        Kernel(name="nu", inputs=POSITION, shape="m", terms=_rows, wants=("nu",), parts=_row("nu")),
        Kernel(name="gamma", inputs=VELOCITY, shape="m", terms=_rows, wants=("gamma",), parts=_row("gamma")),
        Kernel(name="mass", inputs=POSITION, shape="nn", terms=_masses, wants=("mass",), parts=chain("mass", 2, False)),
        Kernel(name="force", inputs=VELOCITY, shape="n", terms=with_inertia, wants=("force",), parts=chain("force", 1, False)),
        Kernel(name="energy", inputs=VELOCITY, shape="e", terms=with_inertia, wants=ENERGIES, parts=_energies),
        Kernel(name="power", inputs=VELOCITY, shape="w", terms=with_inertia, wants=("power",), parts=_power),
    ]
}
