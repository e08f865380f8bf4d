"""From bound terms to programs: one program a kernel.

Terms of equal structure become a loop over index tables when there are enough of them, straight-line
code otherwise; contributions that turn out to be plain numbers are added up here and become data.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from ncgen.errors import shown
from ncgen.model.values import text_of
from ncgen.program.accumulation import combine, take_constants
from ncgen.program.binding import BoundTerm, Derived, Reference, Structure, TermOperands, bind
from ncgen.program.ir import passes
from ncgen.program.ir.angles import share_angles
from ncgen.program.ir.blocks import Block, Column, Loop, Pattern, Program, Slot, Store, Straight, TableStore
from ncgen.program.ir.finishing import finish
from ncgen.program.ir.fused import FusedPart, fuse
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.lower import lower_value
from ncgen.program.ir.verify import verify
from ncgen.program.kernel_table import KERNELS, VELOCITY, Axis, Kernel, Place, with_inertia
from ncgen.program.labels import labelled_errors, reference_name, term_comment
from ncgen.program.programs import EMISSIONS, ENERGIES, Programs
from ncgen.symbolic.equations import Equations
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.term import Term


class Built(NamedTuple):
    """A kernel's program, None where the mechanism does not need it, and the pattern of its output where that is a matrix."""

    program: Program | None
    pattern: Pattern | None

    @property
    def matrix(self) -> Pattern:
        """The pattern of a kernel whose output is a matrix."""
        assert self.pattern is not None, "the output is no matrix"
        return self.pattern


@dataclass
class Contribution:
    """One group of equal terms in one kernel: a body of operations and where its results go."""

    members: list[BoundTerm]
    graph: Graph
    parts: list[tuple[Place, int]]
    slots: list[tuple[Reference, Slot | Column]] = field(default_factory=list)


def assemble(equations: Equations, emission: str = "auto") -> Programs:
    """Build the programs of every kernel the mechanism needs."""
    omitted = list(equations.omitted)
    built = programs_of(KERNELS.values(), equations, EMISSIONS[emission])
    if (power := built["power"].program) and _is_zero(power):
        built["power"] = Built(None, None)
    for name, (program, _) in built.items():
        if program is None and name != "power":  # which says no more than "energy" does
            omitted.append(f"kernel {name}: nothing in this mechanism contributes to it")
    omitted += _folded(equations)
    programs = {name: program for name, (program, _) in built.items() if program is not None}
    pattern = built["phi_q"].matrix
    if "phi_q" in programs:
        length = sum(programs[name].length for name in CONSTRAINT_KERNELS)
        if length <= MOST_FUSED:
            programs["constraints"] = _constraints(programs, pattern, equations)
        else:
            words = "operations of phi, phi_q and gamma are emitted once, and not once more in one function"
            omitted.append(f"kernel constraints: {length} {words}")
    programs = {name: share_angles(program) for name, program in programs.items()}
    return Programs(
        equations=equations, programs=programs, phi_q=pattern, mass=built["mass"].matrix, emission=emission, omitted=tuple(omitted)
    )


CONSTRAINT_KERNELS = ("phi", "phi_q", "gamma")
"""Kernels that are made for every mechanism that has rows; "constraints" is all of them at once."""

MOST_FUSED = 4000
"""Statements of these up to which "constraints" is made: it compiles as long as they do, a humanoid 5 s, and saves a sixth of a call."""


def _is_zero(program: Program) -> bool:
    """True if a program writes nothing but zeros, by structure."""
    stores = [(block, store) for block in program.blocks for store in block.stores if store.array == program.name]
    return all(_writes_zeros(block, store) for block, store in stores)


def _writes_zeros(block: Block, store: Store | TableStore) -> bool:
    op = block.ops[store.node]
    if op.code == "slot" and (slot := block.slots[op.slot]).array == "const":
        return not any(slot.table)
    return op.code == "const" and op.value == 0.0


def _constraints(programs: dict[str, Program], pattern: Pattern, equations: Terms) -> Program:
    """Φ, the values of Φ_q, and γ, one after the other."""
    rows = range(pattern.shape[0])
    of_values = tuple(r for r in rows for _ in range(pattern.indptr[r], pattern.indptr[r + 1]))
    parts = [FusedPart(programs[name], of_values if name == "phi_q" else tuple(rows)) for name in CONSTRAINT_KERNELS]
    program = fuse("constraints", VELOCITY, parts)
    verify(program, input_lengths(equations))
    return program


def input_lengths(equations: Terms) -> dict[str, int]:
    """How many numbers each array has that programs take."""
    n, m = len(equations.free), len(equations.model.rows)
    return {"t": 1, "q": n, "qd": n, "qdd": n, "lam": m, "p": len(equations.parameters)}


def programs_of(kernels: Iterable[Kernel], equations: Terms, least: float) -> dict[str, Built]:
    """Some kernels by their names.

    Sines and cosines are still in the blocks (`share_angles` takes them out).

    least: the least number of equal terms that become a loop
    """
    derived = Derived()
    bound = {term: _bind(term, equations, derived) for term in (*equations.rows, *with_inertia(equations))}
    n, m = len(equations.free), len(equations.model.rows)
    lengths = {"n": n, "m": m, "e": len(ENERGIES), "w": 1}
    built: dict[str, Built] = {}
    for kernel in kernels:
        groups = [_build(kernel, members, equations) for members in _groups(kernel, equations, bound)]
        positions = _places(groups, equations)
        shape = tuple(lengths[axis] for axis in kernel.shape)
        pattern = Pattern.of((shape[0], shape[1]), positions) if len(shape) == 2 else None
        index: dict[tuple[int, ...], int] = {**pattern.positions()} if pattern else {position: position[0] for position in positions}
        size = pattern.nonzeros if pattern else shape[0]
        program = None
        if size and (positions or kernel.name in CONSTRAINT_KERNELS):
            program = _program(kernel, groups, index, size, equations, derived, least)
            verify(program, input_lengths(equations))
        built[kernel.name] = Built(program, pattern)
    return built


def _bind(term: Term, equations: Terms, derived: Derived) -> BoundTerm:
    with labelled_errors(term.label):
        return bind(term, equations, derived)


def _groups(kernel: Kernel, equations: Terms, bound: Mapping[Term, BoundTerm]) -> list[list[BoundTerm]]:
    groups: dict[Structure, list[BoundTerm]] = defaultdict(list)
    for term in kernel.terms(equations):
        groups[bound[term].structure].append(bound[term])
    return list(groups.values())


def _build(kernel: Kernel, members: list[BoundTerm], equations: Terms) -> Contribution:
    """The loop body of a group; constants that are the same in every member are folded into it."""
    graph, first = Graph(), members[0]
    slots: dict[Reference, int] = {}
    contribution = Contribution(members, graph, [])

    def read(reference: Reference) -> int:
        kind, k = reference
        if kind == "const":
            column = [b.constants[k] for b in members]
            if len(set(column)) == 1:
                return graph.const(column[0])
        if reference not in slots:
            slots[reference] = len(slots)
            contribution.slots.append((reference, _slot(reference, members, equations)))
        return graph.slot(slots[reference])

    contribution.parts = parts_of(kernel, first, graph, read)
    return contribution


def parts_of(kernel: Kernel, bound: BoundTerm, graph: Graph, read: Callable[[Reference], int]) -> list[tuple[Place, int]]:
    """(place, node) of what a term contributes to a kernel; structural zeros stay out. read(reference) gives inputs."""
    operands = TermOperands(graph, bound, read)
    wanted = [key for key in bound.template.outputs if key.name in kernel.wants]
    with labelled_errors(bound.term.label):
        outputs = bound.template.replay(graph, operands.symbol, wanted)
        return [(position, node) for position, node in kernel.parts(operands, outputs) if graph.value(node) != 0.0]


def _slot(reference: Reference, members: Sequence[BoundTerm], equations: Terms) -> Slot | Column:
    kind, k = reference
    if kind == "lam":
        return Slot("lam", tuple(b.row for b in members))
    if kind == "const":
        return Column(tuple(b.constants[k] for b in members))
    if kind == "p":
        return Slot(members[0].parameters[k].array, tuple(b.parameters[k].position for b in members))
    return Slot(kind, tuple(equations.index[b.coordinates[k]] for b in members))


def place_of(position: Place, bound: BoundTerm, equations: Terms) -> tuple[int, ...]:
    """Where a contribution goes: numbers of a row, of coordinates, of an energy or of a parameter of the mechanism."""

    def number(axis: Axis) -> int:
        kind, k = axis
        if kind == "coordinate":
            return equations.index[bound.coordinates[k]]
        return bound.row if kind == "row" else k

    return tuple(map(number, position))


def _places(groups: list[Contribution], equations: Terms) -> set[tuple[int, ...]]:
    return {place_of(position, b, equations) for g in groups for position, _ in g.parts for b in g.members}


def _program(
    kernel: Kernel,
    groups: Sequence[Contribution],
    index: Mapping[tuple[int, ...], int],
    size: int,
    equations: Terms,
    derived: Derived,
    least: float,
) -> Program:
    base = [0.0] * size
    loops: list[Loop] = []
    lines: list[Loop] = []
    for group in groups:
        with labelled_errors(group.members[0].term.label):
            block = passes.fold_tables(_loop(kernel, group, index, equations))
            block = take_constants(block, base)
        if block.stores:
            (loops if len(group.members) >= least else lines).append(block)
    blocks = combine(kernel.name, base, loops, lines, equations)
    needed = sorted({i for b in blocks for i in _derived_indices(b)})
    if needed:
        blocks = [_derived_block(derived, needed, equations), *blocks]
    temporaries = {"d": len(derived.expressions)} if needed else {}
    return Program(
        name=kernel.name, inputs=kernel.inputs, output=kernel.name, size=size, blocks=tuple(map(finish, blocks)), temporaries=temporaries
    )


def _loop(kernel: Kernel, group: Contribution, index: Mapping[tuple[int, ...], int], equations: Terms) -> Loop:
    stores = tuple(
        TableStore(kernel.name, tuple(index[place_of(position, b, equations)] for b in group.members), node)
        for position, node in group.parts
    )
    bound = group.members[0]
    names = {group.graph.slot(number): reference_name(bound, reference) for number, (reference, _) in enumerate(group.slots)}
    comments = tuple(term_comment(b, equations) for b in group.members)
    title = f"{bound.term.template.key}: {bound.term.template.equation}"
    slots = tuple(slot for _, slot in group.slots)
    return Loop(
        count=len(group.members), ops=tuple(group.graph.ops), slots=slots, stores=stores, names=names, title=title, comments=comments
    )


def _derived_indices(block: Block) -> set[int]:
    if isinstance(block, Loop):
        return {i for slot in block.slots if slot.array == "d" for i in slot.table}
    return {position for array, position in (op.input for op in block.ops if op.code == "load") if array == "d"}


def _derived_block(derived: Derived, needed: Sequence[int], equations: Terms) -> Straight:
    graph = Graph()
    parameters = {p.name: graph.load("p", i) for i, p in enumerate(equations.parameters)}
    names = {node: name for name, node in parameters.items()}
    stores: list[Store] = []
    for i in needed:
        with labelled_errors(shown(derived.expressions[i])):
            stores.append(
                Store(
                    array="d", index=i, node=lower_value(graph, derived.expressions[i], parameters), comment=text_of(derived.expressions[i])
                )
            )
    return Straight(tuple(graph.ops), tuple(stores), names, "derived from parameters")


def _folded(equations: Terms) -> list[str]:
    fixed = [c for c in equations.model.components if c.fixed]
    zero = sum(c.value == 0.0 for c in fixed)
    return [f"{len(fixed)} fixed coordinates became constants, {zero} of them zero"] if fixed else []
