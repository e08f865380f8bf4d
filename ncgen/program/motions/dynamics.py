"""The state derivative as two programs: a Newton step of the position problem, and the accelerations.

Both are one straight line of operations with the factorisation of Φ_q^d emitted into it:

    newton(t, q, p)            -> Δq of the dependent coordinates, Φ; in closed form the dependent coordinates themselves
    acceleration(t, q, zd, p)  -> q̇, z̈, power, amplification

with q̇ = R ż + S ν, (RᵀMR) z̈ = Rᵀ(Q − M S γ) (the paper's eqs 51-54). `amplification` is ‖R‖², in natural units: how
much an error of the independent coordinates grows in the others, and more where pivots are smaller than they usually are: infinite
where the fixed order of elimination breaks down.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, MutableSequence, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from ncgen.errors import SingularError
from ncgen.program.algebra.elimination import (
    EliminationError,
    Factors,
    dot,
    solve,
    solve_positive,
    solve_refined,
    solve_transposed,
    times,
)
from ncgen.program.algebra.growth import with_pivots
from ncgen.program.differentiation.differentiated import adjoint_of, tangent_of
from ncgen.program.differentiation.prepared import take_out
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.cost import cost
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.sampling import Sample, Sampling
from ncgen.program.ir.verify import verify
from ncgen.program.kernel_table import KERNELS
from ncgen.program.lines import Lines
from ncgen.program.motions.motion import RecursiveMotions, among_projected, derivative_of, in_order_of_runs
from ncgen.program.motions.sliding_derivatives import with_friction
from ncgen.program.newton import dependent_factors, newton_program, newton_step
from ncgen.program.programs import ENERGIES, Split
from ncgen.program.tree.closed_positions import ClosedPositions, assemble_closed_positions, is_described
from ncgen.program.tree.composite import massless
from ncgen.program.tree.rates import NoRecursion
from ncgen.program.tree.recursion import assemble_recursions
from ncgen.symbolic.numbering import Terms

Sizes: TypeAlias = Sequence[float] | np.ndarray


MAX_ENTRIES_OF_R = 2000
"""Numbers of R from which recursions are the only ways that are made."""


@dataclass(frozen=True)
class DynamicsPrograms:
    """newton gives Δq in the order of split.dependent, then Φ, or the dependent coordinates; acceleration [q̇ (n), z̈ (nz), power,
    amplification]."""

    newton: Program
    acceleration: Program
    split: Split

    @property
    def closes(self) -> bool:
        """Whether newton gives the dependent coordinates, in closed form."""
        return self.newton.size == len(self.split.dependent)

    def close(self, q: MutableSequence[Any], results: Sequence[Any]) -> list[Any]:
        """Move the dependent coordinates of q as newton's results say; by how much each has moved."""
        steps = [x - q[c] if self.closes else x for c, x in zip(self.split.dependent, results, strict=False)]
        for c, step in zip(self.split.dependent, steps, strict=True):
            q[c] += step
        return steps


@dataclass(frozen=True, kw_only=True)
class MotionPrograms:
    """derivative gives [q̇ (n), q̈ (n), power, growth], velocities [q̇ (n), growth], q̇ as the joints allow, closing [Δq (n), Φ], or Δq
    alone where positions close at once.

    projected: gives what velocities gives, and the accelerations there: [q̈ (n), q̇ (n), power, growth], in phases of which derivative and
        velocities consist; None where forces of others act
    prepare: gives what depends on parameters alone, which the others read behind p; None where nothing does
    is_general: whether all of their numbers come from the equations, and none from samples of positions
    follow_from_angles: whether closing leaves nothing but the angles of hinges, from which all positions follow
    """

    derivative: Program
    velocities: Program
    closing: Program
    projected: Program | None = None
    prepare: Program | None = None
    is_general: bool = False
    follow_from_angles: bool = False

    @property
    def prepared(self) -> int:
        """How many numbers follow the parameters in p."""
        return self.prepare.size if self.prepare else 0

    @property
    def all(self) -> tuple[Program, ...]:
        parts = (self.derivative, self.velocities, self.closing)
        return (*parts, self.prepare) if self.prepare else parts

    @property
    def emitted(self) -> tuple[Program, ...]:
        """The programs that a motion is printed from: `projected` contains others, and all write where it does."""
        moving = (self.projected,) if self.projected else (in_order_of_runs(self.derivative), among_projected(self.velocities))
        parts = (*moving, self.closing)
        return (*parts, self.prepare) if self.prepare else parts


def assemble_dynamics(equations: Terms, split: Split, samples: Sequence[Sample], sizes: Sizes, refine: bool = False) -> DynamicsPrograms:
    """Both programs for one choice of independent coordinates.

    samples: typical positions, for the choice of pivots and for what vanishes in all of them
    sizes: natural size of every coordinate
    refine: one step of iterative refinement of R and of the accelerations' particular solution (Newton's method refines itself)
    """
    correction = closing(equations, split, samples, sizes).program
    ways = accelerations(equations, split, samples, sizes, refine)
    acceleration = ways[cheapest(ways)]
    lengths = {"t": 1, "q": len(equations.free), "zd": len(split.independent), "p": len(equations.parameters)}
    for program in (correction, acceleration):
        verify(program, lengths)
    return DynamicsPrograms(correction, acceleration, split)


def accelerations(equations: Terms, split: Split, samples: Sequence[Sample], sizes: Sizes, refine: bool = False) -> dict[str, Program]:
    """The program `acceleration` in every way that applies: by recursions over the tree of bodies, and by R of all coordinates.

    R is not even made where its numbers alone are many: such a mechanism has bodies, and a recursion is cheaper. Where digits count
    more than operations (refine) it is the only way: recursions have nothing that could be refined.
    """
    is_large = len(equations.free) * len(split.independent) > MAX_ENTRIES_OF_R
    programs: dict[str, Program] = {}
    if is_large or not refine:
        with suppress(NoRecursion, EliminationError):
            programs = assemble_recursions(equations, split, samples, np.asarray(sizes))
    if not (programs and is_large):
        programs["all coordinates"] = by_all_coordinates(equations, split, samples, sizes, refine)
    return programs


def assemble_motion(equations: Terms, split: Split, samples: Sequence[Sample], sizes: Sizes, forced: bool = False) -> MotionPrograms | None:
    """The motion of all coordinates by the cheapest recursion; None where there is none. Arguments as for `assemble_dynamics`, the split
    of the positions; forced: as of `RecursiveMotions`."""
    try:
        motions, n = RecursiveMotions(equations, samples, np.asarray(sizes), forced), len(equations.free)
        ways = motions.derivatives()
        way = cheapest(ways)
        moving = (ways[way], motions.velocities(way)) if forced else (motions.projected(way),)
        positions = closing(equations, split, samples, sizes, range(n))
        parts = (*moving, positions.program)
    except (NoRecursion, EliminationError, SingularError):
        return None
    prepare, (*made, closed) = take_out(parts, equations)
    motion = MotionPrograms(
        derivative=made[0] if forced else derivative_of(made[0]),
        velocities=made[1] if forced else replace(made[0].beginning, name="velocities"),
        closing=closed,
        projected=None if forced else made[0],
        prepare=prepare,
        is_general=is_described(equations, samples[0]),
        follow_from_angles=positions.follow_from_angles,
    )
    for program in (*motion.all, motion.emitted[0]):
        verify(program, {"t": 1, "q": n, "qd": n, "forces": n, "p": len(equations.parameters) + motion.prepared})
    return motion


def differentiated(programs: MotionPrograms, equations: Terms, kind: str, friction: Mapping[str, Program] | None = None) -> MotionPrograms:
    """A motion's programs, power and growth left out, along a direction (kind "tangent") or transposed ("adjoint").

    friction: of a forced motion, as of `with_friction`
    """
    made, n, more = {"tangent": tangent_of, "adjoint": adjoint_of}[kind], len(equations.free), programs.prepared
    return MotionPrograms(
        derivative=with_friction(programs.derivative, friction, equations, kind, more)
        if friction
        else made(programs.derivative, equations, 2 * n, more),
        velocities=made(programs.velocities, equations, n, more),
        closing=made(programs.closing, equations, n, more),
        prepare=made(programs.prepare, equations, more) if programs.prepare else None,
    )


def cheapest(programs: dict[str, Program]) -> str:
    """The name of the program with the fewest operations."""
    return min(programs, key=lambda name: cost(programs[name]).total)


def closing(equations: Terms, split: Split, samples: Sequence[Sample], sizes: Sizes, moved: Sequence[int] | None = None) -> ClosedPositions:
    """What closes positions: from the angles of hinges at once, as far as these reach, else by a step of Newton's method.

    moved: coordinates whose Δq is wanted; None for the dependent ones
    """
    try:
        return assemble_closed_positions(equations, split, samples, np.asarray(sizes), moved)
    except (NoRecursion, EliminationError):
        return ClosedPositions(newton(equations, split, samples, moved), False)


def newton(equations: Terms, split: Split, samples: Sequence[Sample], moved: Sequence[int] | None = None) -> Program:
    """The program newton(t, q, p) -> Δq of the coordinates `moved` (as for `closing`), Φ."""
    lines = Lines(equations)
    phi = lines.vector(KERNELS["phi"])
    steps = newton_step(lines, phi, lines.matrix(KERNELS["phi_q"]), split, samples)
    return newton_program(lines, split, moved, steps, phi)


def by_all_coordinates(equations: Terms, split: Split, samples: Sequence[Sample], sizes: Sizes, refine: bool = False) -> Program:
    """The accelerations by R of all coordinates."""
    lines = Lines(equations)
    graph = lines.graph
    zero, one = graph.const(0.0), graph.const(1.0)
    n, nz = len(equations.free), len(split.independent)
    jacobian = lines.matrix(KERNELS["phi_q"])
    matrix, factors = dependent_factors(lines, jacobian, split, samples)

    def particular(right: dict[int, int]) -> dict[int, int]:
        """S·right: {coordinate: node}."""
        kept = {i: right[r] for i, r in enumerate(split.rows) if r in right}
        solution = solve_refined(graph, matrix, factors, kept) if refine else solve(graph, factors, kept)
        return {split.dependent[j]: node for j, node in solution.items()}

    R: list[dict[int, int]] = []
    for c in split.independent:
        column = {r: graph.neg(node) for (r, k), node in jacobian.items() if k == c}
        R.append({c: one, **particular(column)})

    nu = lines.vector(KERNELS["nu"])
    lines.rates = [zero] * n
    for c, node in particular(nu).items():
        lines.rates[c] = node
    for k, column in enumerate(R):
        speed = graph.load("zd", k)
        for c, node in column.items():
            lines.rates[c] = graph.add(lines.rates[c], graph.mul(node, speed))

    bias = particular(lines.vector(KERNELS["gamma"]))
    mass = lines.matrix(KERNELS["mass"])
    force = lines.vector(KERNELS["force"])

    MR = [times(graph, mass, column) for column in R]
    reduced = {(i, j): dot(graph, R[i], MR[j]) for i in range(nz) for j in range(i + 1)}
    right = [
        graph.sub(dot(graph, column, force), dot(graph, momentum, bias)) for column, momentum in zip(R, MR, strict=True)
    ]  # M is symmetric
    try:
        zdd = solve_positive(graph, reduced, nz, right)
    except ZeroDivisionError:  # an entry is nothing by its structure
        raise massless(equations.model.name) from None
    applied = lines.vector(KERNELS["energy"]).get(ENERGIES.index("power"))
    power = applied if applied is not None else zero
    if nu:
        left = _unbalanced(graph, force, times(graph, mass, bias), MR, zdd)
        power = _less_driving(graph, split, factors, nu, left, power)
    amplification = with_pivots(graph, Sampling(graph, samples), _amplification(graph, split, R, sizes), factors.reciprocal)
    return lines.program("acceleration", ("t", "q", "zd", "p"), [*lines.rates, *zdd, power, amplification])


def _amplification(graph: Graph, split: Split, R: list[dict[int, int]], sizes: Sizes) -> int:
    """‖R‖² in natural units, coordinate by coordinate."""
    squares: dict[int, list[int]] = defaultdict(list)
    unit = sizes[split.independent[0]] if split.independent else 1.0  # mostly that of all: then nothing is multiplied here
    for z, column in zip(split.independent, R, strict=True):
        for c, node in column.items():
            grown = graph.mul(graph.const(float(sizes[z] / unit)), node)
            squares[c].append(graph.mul(grown, grown))
    return graph.sum(graph.mul(graph.const(float((unit / sizes[c]) ** 2)), graph.sum(nodes)) for c, nodes in sorted(squares.items()))


def _unbalanced(
    graph: Graph, force: dict[int, int], momentum: dict[int, int], MR: Sequence[dict[int, int]], zdd: Sequence[int]
) -> dict[int, int]:
    """Q − M q̈ with q̈ = R z̈ + S γ: {coordinate: node}. momentum: M S γ"""
    zero = graph.const(0.0)
    left = {c: graph.sub(force.get(c, zero), momentum.get(c, zero)) for c in sorted(force.keys() | momentum.keys())}
    for column, acceleration in zip(MR, zdd, strict=True):
        for c, node in column.items():
            left[c] = graph.sub(left.get(c, zero), graph.mul(node, acceleration))
    return left


def _less_driving(graph: Graph, split: Split, factors: Factors, nu: dict[int, int], left: dict[int, int], power: int) -> int:
    """The power of applied forces without that of drivers, P − νᵀλ with (Φ_q^d)ᵀ λ = (Q − M q̈)_d, which is `left`."""
    right = {j: left[c] for j, c in enumerate(split.dependent) if c in left}
    lam = solve_transposed(graph, factors, right)
    for i, r in enumerate(split.rows):
        if r in nu and i in lam:
            power = graph.sub(power, graph.mul(nu[r], lam[i]))
    return power
