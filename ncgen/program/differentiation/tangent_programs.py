"""The tangent kernels: how the equations of motion change with position and velocity.

With the balance of forces b = M q̈ + Φ_qᵀ λ − Q and the second derivative of the rows Φ̈ = Φ_q q̈ − γ,

    stiffness (t, q, qd, qdd, lam, p)   ∂b/∂q        (n, n)
    damping   (t, q, qd, p)             ∂b/∂q̇ = −∂Q/∂q̇  (n, n)
    phidd_q   (t, q, qd, qdd, p)        ∂Φ̈/∂q        (m, n)
    phidd_qd  (t, q, qd, p)             ∂Φ̈/∂q̇ = −∂γ/∂q̇  (m, n)

at constant q̈ and λ. Everything that needs a derivative of the motion follows from these four by linear algebra:
implicit integrators, vibration modes, the Jacobian of the state derivative. They are found by reverse sweeps over the
operations of each term, so terms of equal structure still share a loop.

Derivatives by the parameters are kernels of their own, in one straight line, since few terms have parameters:

    phi_p     (t, q, p)                 ∂Φ/∂p   (m, parameters)
    phid_p    (t, q, qd, p)             ∂Φ̇/∂p with Φ̇ = Φ_q q̇ − ν
    phidd_p   (t, q, qd, qdd, p)        ∂Φ̈/∂p
    balance_p (t, q, qd, qdd, lam, p)   ∂b/∂p   (n, parameters)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Literal, TypeAlias

from ncgen.program.assemble import programs_of
from ncgen.program.binding import Reference, TermOperands
from ncgen.program.ir.angles import share_angles
from ncgen.program.ir.blocks import Pattern, Program
from ncgen.program.ir.derivatives import gradient
from ncgen.program.kernel_table import ROW, Axis, Kernel, Nodes, Parts, Place, chain, with_inertia
from ncgen.program.lines import Lines
from ncgen.program.programs import EMISSIONS, TangentPrograms
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.templates import TemplateOutput
from ncgen.symbolic.term import Term

Quantities: TypeAlias = Callable[[TermOperands, Nodes], dict[Place, int]]
"""(places, outputs) -> {place: node} of what a term adds to the quantities that are differentiated."""


def assemble_tangents(equations: Terms, emission: str = "auto") -> TangentPrograms:
    """The programs of the tangent kernels, loops and straight-line code as in the others."""
    built = programs_of(TANGENTS.values(), equations, EMISSIONS[emission])
    programs = {name: share_angles(program) for name, (program, _) in built.items() if program is not None}
    return TangentPrograms("tangents", programs, {name: kernel.matrix for name, kernel in built.items()})


def _balance(operands: TermOperands, outputs: Nodes) -> dict[Place, int]:
    """{(coordinate,): what a term adds to M q̈ + Φ_qᵀ λ − Q along it}."""
    graph = operands.graph
    sums: dict[Place, int] = {}
    kinds = {key.name for key in outputs}

    def add(position: Place, node: int) -> None:
        sums[position] = graph.add(sums[position], node) if position in sums else node

    if "phi_q" in kinds:
        for position, node in chain("phi_q", 1, False)(operands, outputs):
            add(position, graph.mul(operands.read(Reference("lam", 0)), node))
    if "mass" in kinds:
        for (i, j), node in chain("mass", 2, False)(operands, outputs):
            add((i,), graph.mul(node, operands.read(Reference("qdd", j.number))))
    if "force" in kinds:
        for position, node in chain("force", 1, False)(operands, outputs):
            add(position, graph.neg(node))
    return sums


def _row(operands: TermOperands, outputs: Nodes) -> dict[Place, int]:
    """{(row,): Φ}."""
    return {(ROW,): outputs[TemplateOutput("phi")]}


def _moved(kind: Literal["qd", "qdd"], right: str) -> Quantities:
    """{(row,): Φ_q times velocities or accelerations, less the right-hand side}: Φ̇ = Φ_q q̇ − ν, or Φ̈ = Φ_q q̈ − γ."""

    def rows(operands: TermOperands, outputs: Nodes) -> dict[Place, int]:
        graph = operands.graph
        parts = [graph.mul(node, operands.read(Reference(kind, j.number))) for (j,), node in chain("phi_q", 1, False)(operands, outputs)]
        return {(ROW,): graph.sub(graph.sum(parts), outputs[TemplateOutput(right)])}

    return rows


_row_rate, _row_acceleration = _moved("qd", "nu"), _moved("qdd", "gamma")


def _by(kind: Literal["q", "qd"], function: Quantities) -> Parts:
    """Contributions ∂function/∂q ("q") or ∂function/∂q̇ ("qd") per coordinate of a term."""

    def parts(operands: TermOperands, outputs: Nodes) -> Iterator[tuple[Place, int]]:
        variables = {operands.read(Reference(kind, j)): Axis("coordinate", j) for j in range(len(operands.bound.coordinates))}
        for position, node in function(operands, outputs).items():
            for variable, derivative in gradient(operands.graph, node, variables).items():
                yield (*position, variables[variable]), derivative

    return parts


def _by_parameters(function: Quantities) -> Parts:
    """Contributions ∂function/∂p per parameter."""

    def parts(operands: TermOperands, outputs: Nodes) -> Iterator[tuple[Place, int]]:
        loads = [(node, op.input) for node, op in enumerate(operands.graph.ops) if op.code == "load"]
        variables = {node: Axis("parameter", position) for node, (array, position) in loads if array == "p"}
        for target, node in function(operands, outputs).items():
            for variable, derivative in gradient(operands.graph, node, variables).items():
                yield (*target, variables[variable]), derivative

    return parts


BALANCE, RATES, ACCELERATIONS = ("phi_q", "mass", "force"), ("phi_q", "nu"), ("phi_q", "gamma")
"""Outputs of templates that enter the balance of forces, Φ̇ and Φ̈."""


def _rows(equations: Terms) -> tuple[Term, ...]:
    return equations.rows


def _everything(equations: Terms) -> tuple[Term, ...]:
    return equations.rows + with_inertia(equations)


def _kernels(*entries: tuple[str, str, str, Callable[[Terms], tuple[Term, ...]], tuple[str, ...], Parts]) -> dict[str, Kernel]:
    """{name: kernel} of what `Kernel` has, in its order; inputs with spaces between them."""
    return {
        name: Kernel(name=name, inputs=tuple(inputs.split()), shape=shape, terms=terms, wants=wants, parts=parts)
        for name, inputs, shape, terms, wants, parts in entries
    }


TANGENTS = _kernels(
    ("stiffness", "t q qd qdd lam p", "nn", _everything, BALANCE, _by("q", _balance)),
    ("damping", "t q qd p", "nn", with_inertia, ("force",), _by("qd", _balance)),
    ("phidd_q", "t q qd qdd p", "mn", _rows, ACCELERATIONS, _by("q", _row_acceleration)),
    ("phidd_qd", "t q qd p", "mn", _rows, ACCELERATIONS, _by("qd", _row_acceleration)),
)

PARAMETER_TANGENTS = _kernels(
    ("phi_p", "t q p", "mp", _rows, ("phi",), _by_parameters(_row)),
    ("phid_p", "t q qd p", "mp", _rows, RATES, _by_parameters(_row_rate)),
    ("phidd_p", "t q qd qdd p", "mp", _rows, ACCELERATIONS, _by_parameters(_row_acceleration)),
    ("balance_p", "t q qd qdd lam p", "np", _everything, BALANCE, _by_parameters(_balance)),
)


def assemble_parameter_tangents(equations: Terms) -> TangentPrograms:
    """The programs of the derivatives by the parameters."""
    lengths = {"m": len(equations.model.rows), "n": len(equations.free), "p": len(equations.parameters)}
    programs: dict[str, Program] = {}
    patterns: dict[str, Pattern] = {}
    for kernel in PARAMETER_TANGENTS.values():
        lines = Lines(equations)
        entries = {position: node for position, node in lines.gather(kernel).items() if lines.graph.value(node) != 0.0}
        rows, columns = (lengths[axis] for axis in kernel.shape)
        patterns[kernel.name] = Pattern.of((rows, columns), entries)
        if entries:
            programs[kernel.name] = lines.program(kernel.name, kernel.inputs, [entries[position] for position in sorted(entries)])
    return TangentPrograms("parameter_tangents", programs, patterns)
