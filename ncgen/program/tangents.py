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
from dataclasses import dataclass

from ncgen.program.angles import share_angles
from ncgen.program.assemble import EMISSIONS, Kernel, chain, programs_of, with_inertia
from ncgen.program.binding import Places
from ncgen.program.blocks import Pattern, Program
from ncgen.program.derivatives import gradient
from ncgen.program.lines import Lines
from ncgen.symbolic.equations import Equations


@dataclass(frozen=True)
class TangentPrograms:
    """programs, patterns: by kernel name; what a mechanism does not need has a pattern without nonzeros and no program.

    kind: "tangents" or "parameter_tangents", as in ncgen.h
    """

    kind: str
    programs: dict[str, Program]
    patterns: dict[str, Pattern]


def assemble_tangents(equations: Equations, emission: str = "auto") -> TangentPrograms:
    """The programs of the tangent kernels, loops and straight-line code as in the others."""
    built = programs_of(TANGENTS.values(), equations, EMISSIONS[emission])
    programs = {name: share_angles(program) for name, (program, _) in built.items() if program is not None}
    return TangentPrograms("tangents", programs, {name: pattern for name, (_, pattern) in built.items()})


def _balance(places: Places, outputs: dict) -> dict[tuple, int]:
    """{(coordinate,): what a term adds to M q̈ + Φ_qᵀ λ − Q along it}."""
    graph = places.graph
    sums: dict[tuple, int] = {}

    def add(place: tuple, node: int) -> None:
        sums[place] = graph.add(sums[place], node) if place in sums else node

    if any(key[0] == "phi_q" for key in outputs):
        for place, node in chain("phi_q", 1, False)(places, outputs):
            add(place, graph.mul(places.read(("lam", 0)), node))
    if any(key[0] == "mass" for key in outputs):
        for (i, j), node in chain("mass", 2, False)(places, outputs):
            add((i,), graph.mul(node, places.read(("qdd", j))))
    if any(key[0] == "force" for key in outputs):
        for place, node in chain("force", 1, False)(places, outputs):
            add(place, graph.neg(node))
    return sums


def _row(places: Places, outputs: dict) -> dict[tuple, int]:
    """{("row",): Φ}."""
    return {("row",): outputs["phi"]}


def _row_rate(places: Places, outputs: dict) -> dict[tuple, int]:
    """{("row",): Φ̇ = Φ_q q̇ − ν}."""
    graph = places.graph
    parts = [graph.mul(node, places.read(("qd", j))) for (j,), node in chain("phi_q", 1, False)(places, outputs)]
    return {("row",): graph.sub(graph.sum(parts), outputs["nu"])}


def _row_acceleration(places: Places, outputs: dict) -> dict[tuple, int]:
    """{("row",): Φ̈ = Φ_q q̈ − γ}."""
    graph = places.graph
    parts = [graph.mul(node, places.read(("qdd", j))) for (j,), node in chain("phi_q", 1, False)(places, outputs)]
    return {("row",): graph.sub(graph.sum(parts), outputs["gamma"])}


def _by(kind: str, function) -> Callable[[Places, dict], Iterator[tuple[tuple, int]]]:
    """Contributions ∂function/∂q ("q") or ∂function/∂q̇ ("qd") per coordinate of a term."""

    def parts(places: Places, outputs: dict):
        variables = {places.read((kind, j)): j for j in range(len(places.bound.coordinates))}
        for place, node in function(places, outputs).items():
            for variable, slope in gradient(places.graph, node, variables).items():
                yield (*place, variables[variable]), slope

    return parts


def _by_parameters(function) -> Callable[[Places, dict], Iterator[tuple[tuple, int]]]:
    """Contributions ∂function/∂p per parameter."""

    def parts(places: Places, outputs: dict):
        variables = {node: op.leaf[1] for node, op in enumerate(places.graph.ops) if op.code == "load" and op.leaf[0] == "p"}
        for place, node in function(places, outputs).items():
            for variable, slope in gradient(places.graph, node, variables).items():
                yield (*place, ("p", variables[variable])), slope

    return parts


def _enters_balance(key) -> bool:
    return key[0] in ("phi_q", "mass", "force")


def _is_force(key) -> bool:
    return key[0] == "force"


def _enters_rows(key) -> bool:
    return key == "gamma" or key[0] == "phi_q"


def _enters_rates(key) -> bool:
    return key == "nu" or key[0] == "phi_q"


def _rows(equations: Equations) -> tuple:
    return equations.rows


def _everything(equations: Equations) -> tuple:
    return equations.rows + with_inertia(equations)


TANGENTS = {
    kernel.name: kernel
    for kernel in [
        Kernel("stiffness", ("t", "q", "qd", "qdd", "lam", "p"), "nn", _everything, _enters_balance, _by("q", _balance)),
        Kernel("damping", ("t", "q", "qd", "p"), "nn", with_inertia, _is_force, _by("qd", _balance)),
        Kernel("phidd_q", ("t", "q", "qd", "qdd", "p"), "mn", _rows, _enters_rows, _by("q", _row_acceleration)),
        Kernel("phidd_qd", ("t", "q", "qd", "p"), "mn", _rows, _enters_rows, _by("qd", _row_acceleration)),
    ]
}

PARAMETER_TANGENTS = {
    kernel.name: kernel
    for kernel in [
        Kernel("phi_p", ("t", "q", "p"), "mp", _rows, lambda key: key == "phi", _by_parameters(_row)),
        Kernel("phid_p", ("t", "q", "qd", "p"), "mp", _rows, _enters_rates, _by_parameters(_row_rate)),
        Kernel("phidd_p", ("t", "q", "qd", "qdd", "p"), "mp", _rows, _enters_rows, _by_parameters(_row_acceleration)),
        Kernel("balance_p", ("t", "q", "qd", "qdd", "lam", "p"), "np", _everything, _enters_balance, _by_parameters(_balance)),
    ]
}


def assemble_parameter_tangents(equations: Equations) -> TangentPrograms:
    """The programs of the derivatives by the parameters."""
    lengths = {"m": len(equations.model.rows), "n": len(equations.free), "p": len(equations.parameters)}
    programs, patterns = {}, {}
    for kernel in PARAMETER_TANGENTS.values():
        lines = Lines(equations)
        entries = {place: node for place, node in lines.gather(kernel).items() if lines.graph.value(node) != 0.0}
        patterns[kernel.name] = Pattern.of(tuple(lengths[axis] for axis in kernel.shape), entries)
        if entries:
            programs[kernel.name] = lines.program(kernel.name, kernel.inputs, [entries[place] for place in sorted(entries)])
    return TangentPrograms("parameter_tangents", programs, patterns)
