"""From bound terms to programs: one program a kernel.

Terms of equal structure become a loop over index tables when there are enough of them, straight-line
code otherwise; contributions that turn out to be plain numbers are added up here and become data.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple, TypeAlias

from ncgen.errors import ModelError, shown
from ncgen.model.values import told
from ncgen.program.binding import Bound, Derived, Places, Reference, Structure, bind
from ncgen.program.ir import passes
from ncgen.program.ir.angles import share_angles
from ncgen.program.ir.blocks import Block, Column, Loop, Pattern, Program, Slot, Store, Straight, TableStore
from ncgen.program.ir.finishing import finish
from ncgen.program.ir.fused import Part, fuse
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.lower import lower_value
from ncgen.program.ir.verify import verify
from ncgen.program.programs import EMISSIONS, ENERGIES, Programs
from ncgen.symbolic.equations import Equations, Term
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.templates import Output


class Axis(NamedTuple):
    """Where a contribution goes along one axis of a kernel's output.

    kind: the term's own row, its coordinate of a number, the energy or the parameter of a number
    """

    kind: Literal["row", "coordinate", "energy", "parameter"]
    number: int = 0


Place: TypeAlias = tuple[Axis, ...]
"""What tells the contributions of a term apart: where each goes, along every axis of the output."""

Nodes: TypeAlias = dict[Output, int]
"""{output of a template: its node}."""

Parts: TypeAlias = Callable[[Places, Nodes], Iterable[tuple[Place, int]]]
"""(places, outputs) -> the contributions of a term: pairs (place, node)."""

ROW = Axis("row")


@dataclass(frozen=True)
class Kernel:
    """What a kernel is: its inputs, which terms enter, and how a term contributes.

    shape: the output's axes, "m" rows, "n" coordinates, "e" energies, "p" parameters; two axes make a sparse matrix
    wants: names of the outputs of templates that contributions are made of
    """

    name: str
    inputs: tuple[str, ...]
    shape: str
    terms: Callable[[Terms], tuple[Term, ...]]
    wants: tuple[str, ...]
    parts: Parts


def _row(name: str) -> Parts:
    def parts(places: Places, outputs: Nodes) -> Iterator[tuple[Place, int]]:
        yield (ROW,), outputs[Output(name)]

    return parts


def chain(name: str, order: int, by_row: bool) -> Parts:
    """Contributions per coordinate (order 1) or pair of coordinates (order 2), by the chain rule."""

    def parts(places: Places, outputs: Nodes) -> Iterator[tuple[Place, int]]:
        graph = places.graph
        weights = [places.weights(c) for c in range(len(places.bound.coordinates))]
        axes = [Axis("coordinate", c) for c in range(len(weights))]
        head = (ROW,) if by_row else ()
        made: dict[tuple[int, int], int] = {}
        for i, first in enumerate(weights):
            if order == 1:
                pieces = [graph.mul(w, outputs[output]) for k, w in first if (output := Output(name, (k,))) in outputs]
                yield (*head, axes[i]), graph.sum(pieces)
                continue
            for j, second in enumerate(weights):
                if i <= j:  # of a symmetric matrix each pair is computed once, so that it is symmetric to the last bit
                    made[i, j] = graph.sum(graph.mul(graph.mul(w, x), outputs[Output(name, (k, l))]) for k, w in first for l, x in second)
                yield (*head, axes[i], axes[j]), made[min(i, j), max(i, j)]

    return parts


def _energies(places: Places, outputs: Nodes) -> Iterator[tuple[Place, int]]:
    for k, name in enumerate(ENERGIES):
        if Output(name) in outputs:
            yield (Axis("energy", k),), outputs[Output(name)]


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
        Kernel("phi", POSITION, "m", _rows, ("phi",), _row("phi")),
        Kernel("phi_q", POSITION, "mn", _rows, ("phi_q",), chain("phi_q", 1, True)),
        Kernel("nu", POSITION, "m", _rows, ("nu",), _row("nu")),
        Kernel("gamma", VELOCITY, "m", _rows, ("gamma",), _row("gamma")),
        Kernel("mass", POSITION, "nn", _masses, ("mass",), chain("mass", 2, False)),
        Kernel("force", VELOCITY, "n", with_inertia, ("force",), chain("force", 1, False)),
        Kernel("energy", VELOCITY, "e", with_inertia, ENERGIES, _energies),
    ]
}


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

    members: list[Bound]
    graph: Graph
    parts: list[tuple[Place, int]]
    slots: list[tuple[Reference, Slot | Column]] = field(default_factory=list)


def assemble(equations: Equations, emission: str = "auto") -> Programs:
    """Build the programs of every kernel the mechanism needs."""
    omitted = list(equations.omitted)
    built = programs_of(KERNELS.values(), equations, EMISSIONS[emission])
    for name, (program, _) in built.items():
        if program is None:
            omitted.append(f"kernel {name}: nothing in this mechanism contributes to it")
    omitted += _folded(equations)
    programs = {name: program for name, (program, _) in built.items() if program is not None}
    pattern = built["phi_q"].matrix
    if "phi_q" in programs:
        length = sum(programs[name].length for name in ALWAYS)
        if length <= MOST_FUSED:
            programs["constraints"] = _constraints(programs, pattern, equations)
        else:
            omitted.append(f"kernel constraints: {length} operations of phi, phi_q and gamma are written out once, not once more together")
    programs = {name: share_angles(program) for name, program in programs.items()}
    return Programs(equations, programs, pattern, built["mass"].matrix, emission, tuple(omitted))


ALWAYS = ("phi", "phi_q", "gamma")
"""Kernels that are made for every mechanism that has rows; "constraints" is all of them at once."""

MOST_FUSED = 4000
"""Statements of these up to which "constraints" is made: it compiles as long as they do, a humanoid 5 s, and saves a sixth of a call."""


def _constraints(programs: dict[str, Program], pattern: Pattern, equations: Terms) -> Program:
    """Φ, the values of Φ_q, and γ, one after the other."""
    rows = range(pattern.shape[0])
    of_values = tuple(r for r in rows for _ in range(pattern.indptr[r], pattern.indptr[r + 1]))
    parts = [Part(programs[name], of_values if name == "phi_q" else tuple(rows)) for name in ALWAYS]
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
    lengths = {"n": n, "m": m, "e": len(ENERGIES)}
    built: dict[str, Built] = {}
    for kernel in kernels:
        groups = [_build(kernel, members, equations) for members in _groups(kernel, equations, bound)]
        places = _places(groups, equations)
        shape = tuple(lengths[axis] for axis in kernel.shape)
        pattern = Pattern.of((shape[0], shape[1]), places) if len(shape) == 2 else None
        index: dict[tuple[int, ...], int] = {**pattern.positions()} if pattern else {place: place[0] for place in places}
        size = pattern.nonzeros if pattern else shape[0]
        program = None
        if size and (places or kernel.name in ALWAYS):
            program = _program(kernel, groups, index, size, equations, derived, least)
            verify(program, input_lengths(equations))
        built[kernel.name] = Built(program, pattern)
    return built


def _bind(term: Term, equations: Terms, derived: Derived) -> Bound:
    with told_of(term.label):
        return bind(term, equations, derived)


@contextmanager
def told_of(label: str) -> Iterator[None]:
    """Whatever is wrong with the numbers or the words of a term is a ModelError with the term's own label in front."""
    try:
        yield
    except ModelError as error:
        raise error if str(error).startswith(label) else ModelError(f"{label}: {error}") from None
    except ArithmeticError as error:
        raise ModelError(f"{label}: {error}; correct the expression, or the numbers and fixed coordinates in it") from None
    except ValueError as error:
        raise ModelError(f"{label}: {error} at its numbers and fixed coordinates; correct the expression") from None


def _groups(kernel: Kernel, equations: Terms, bound: Mapping[Term, Bound]) -> list[list[Bound]]:
    groups: dict[Structure, list[Bound]] = defaultdict(list)
    for term in kernel.terms(equations):
        groups[bound[term].structure].append(bound[term])
    return list(groups.values())


def _build(kernel: Kernel, members: list[Bound], equations: Terms) -> Contribution:
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


def parts_of(kernel: Kernel, bound: Bound, graph: Graph, read: Callable[[Reference], int]) -> list[tuple[Place, int]]:
    """(place, node) of what a term contributes to a kernel; structural zeros stay out. read(reference) gives inputs."""
    places = Places(graph, bound, read)
    wanted = [key for key in bound.template.outputs if key.name in kernel.wants]
    with told_of(bound.term.label):
        outputs = bound.template.replay(graph, places.symbol, wanted)
        return [(place, node) for place, node in kernel.parts(places, outputs) if graph.value(node) != 0.0]


def _slot(reference: Reference, members: Sequence[Bound], equations: Terms) -> Slot | Column:
    kind, k = reference
    if kind == "lam":
        return Slot("lam", tuple(b.row for b in members))
    if kind == "const":
        return Column(tuple(b.constants[k] for b in members))
    if kind == "p":
        return Slot(members[0].parameters[k].array, tuple(b.parameters[k].position for b in members))
    return Slot(kind, tuple(equations.index[b.coordinates[k]] for b in members))


def place_of(place: Place, bound: Bound, equations: Terms) -> tuple[int, ...]:
    """Where a contribution goes: numbers of a row, of coordinates, of an energy or of a parameter of the mechanism."""

    def number(axis: Axis) -> int:
        kind, k = axis
        if kind == "coordinate":
            return equations.index[bound.coordinates[k]]
        return bound.row if kind == "row" else k

    return tuple(map(number, place))


def _places(groups: list[Contribution], equations: Terms) -> set[tuple[int, ...]]:
    return {place_of(place, b, equations) for g in groups for place, _ in g.parts for b in g.members}


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
        with told_of(group.members[0].term.label):
            block = passes.fold_tables(_loop(kernel, group, index, equations))
            block = _take_constants(block, base)
        if block.stores:
            (loops if len(group.members) >= least else lines).append(block)
    blocks = _combine(kernel, base, loops, lines, equations)
    needed = sorted({i for b in blocks for i in _derived_indices(b)})
    if needed:
        blocks = [_derived_block(derived, needed, equations), *blocks]
    temporaries = {"d": len(derived.expressions)} if needed else {}
    return Program(kernel.name, kernel.inputs, kernel.name, size, tuple(map(finish, blocks)), temporaries)


def _loop(kernel: Kernel, group: Contribution, index: Mapping[tuple[int, ...], int], equations: Terms) -> Loop:
    stores = tuple(
        TableStore(kernel.name, tuple(index[place_of(place, b, equations)] for b in group.members), node) for place, node in group.parts
    )
    bound = group.members[0]
    names = {group.graph.slot(number): _name(bound, reference) for number, (reference, _) in enumerate(group.slots)}
    comments = tuple(_comment(b, equations) for b in group.members)
    title = f"{bound.term.template.key}: {bound.term.template.equation}"
    slots = tuple(slot for _, slot in group.slots)
    return Loop(len(group.members), tuple(group.graph.ops), slots, stores, names, title, comments)


def _name(bound: Bound, reference: Reference) -> str:
    """What a reader calls what a reference of a term stands for."""
    kind, k = reference
    if kind == "lam":
        return "multiplier"
    return MARKS[kind] + bound.names[Reference("q", k)] if kind in MARKS else bound.names[reference]


def _comment(bound: Bound, equations: Terms) -> str:
    term = bound.term
    if term.row is None:
        return term.label
    row = equations.model.rows[term.row]
    code = f"{row.code} " if row.code else ""
    return f"row {term.row + 1}: {code}{row.label} ({row.owner}): {term.equation}"


def _take_constants(block: Loop, base: list[float]) -> Loop:
    """Move stores of plain numbers into the base table."""
    kept: list[TableStore] = []
    for store in block.stores:
        op = block.ops[store.node]
        if op.code == "const":
            column = (op.value,) * block.count
        elif op.code == "slot" and block.slots[op.slot].array == "const":
            column = block.slots[op.slot].table
        else:
            kept.append(store)
            continue
        for position, value in zip(store.table, column, strict=True):
            base[position] += value
            if not math.isfinite(base[position]):
                raise OverflowError("what is added up becomes infinite")
    return replace(block, stores=tuple(kept))


def _combine(kernel: Kernel, base: list[float], loops: Sequence[Loop], lines: Sequence[Loop], equations: Terms) -> list[Block]:
    """Base table first, then straight-line code, then loops; plain stores where nothing is added up."""
    hits: dict[int, int] = defaultdict(int)
    for block in loops:
        for store in block.stores:
            for position in store.table:
                hits[position] += 1
    straight = _straight(kernel, lines, base, hits, equations)
    written = {s.index for s in straight.stores} if straight else set()
    alone = all(base[i] == 0.0 for i in hits) and all(n == 1 for n in hits.values()) and not written & set(hits)
    blocks: list[Block] = []
    if straight and alone:
        straight = _with_constants(straight, kernel.name, {i: x for i, x in enumerate(base) if i not in written and i not in hits})
    elif not (alone and len(hits) == len(base)):
        blocks.append(_base_block(kernel.name, base))
    if straight:
        blocks.append(straight)
    for block in loops:
        blocks.append(replace(block, stores=tuple(replace(s, accumulate=not alone) for s in block.stores)))
    return blocks


def _with_constants(block: Straight, array: str, values: dict[int, float]) -> Straight:
    """The block with stores of plain numbers among its own, by position."""
    graph = Graph()
    nodes = passes.unroll(graph, block, 0)
    names = {nodes[k]: name for k, name in block.names.items()}
    stores = [replace(s, node=nodes[s.node]) for s in block.stores]
    stores += [Store(array, i, graph.const(value)) for i, value in values.items()]
    return replace(block, ops=tuple(graph.ops), stores=tuple(sorted(stores, key=lambda s: s.index)), names=names)


def _base_block(array: str, base: list[float]) -> Loop:
    graph = Graph()
    count = len(base)
    if len(set(base)) <= 1:
        node, slots = graph.const(base[0] if base else 0.0), ()
    else:
        node, slots = graph.slot(0), (Column(tuple(base)),)
    return Loop(count, tuple(graph.ops), slots, (TableStore(array, tuple(range(count)), node),), {}, "constant part")


def _straight(kernel: Kernel, lines: Sequence[Loop], base: list[float], hits: Mapping[int, int], equations: Terms) -> Straight | None:
    """Small groups written out: their loops unrolled into one graph, contributions to one place added."""
    graph = Graph()
    sums: dict[int, list[int]] = defaultdict(list)
    comments: dict[int, list[str]] = defaultdict(list)
    names: dict[int, str] = {}
    for loop in lines:
        for run in range(loop.count):
            with told_of(loop.comments[run]):
                nodes = passes.unroll(graph, loop, run)
            for store in loop.stores:
                sums[store.table[run]].append(nodes[store.node])
                comments[store.table[run]].append(loop.comments[run])
    if not sums:
        return None
    for node, op in enumerate(graph.ops):
        if op.code == "load":
            names[node] = load_name(*op.input, equations)
    stores: list[Store] = []
    for position in sorted(sums):
        value = sums[position] if position in hits else [graph.const(base[position]), *sums[position]]
        comment = "; ".join(dict.fromkeys(comments[position]))
        stores.append(Store(kernel.name, position, graph.sum(value), position in hits, comment))
    return Straight(tuple(graph.ops), tuple(stores), names)


MARKS = {"qd": "d", "qdd": "dd"}
"""What stands before a coordinate's name where its velocity or acceleration is meant."""


def load_name(array: str, index: int, equations: Terms) -> str:
    """What a reader calls an input: the coordinate, its velocity with a d in front, or the parameter."""
    if array == "q" or array in MARKS:
        return MARKS.get(array, "") + equations.free[index].name
    if array == "p" and index < len(equations.parameters):
        return equations.parameters[index].name
    return "t" if array == "t" else f"{array}{index}"


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
        with told_of(shown(derived.expressions[i])):
            stores.append(Store("d", i, lower_value(graph, derived.expressions[i], parameters), comment=told(derived.expressions[i])))
    return Straight(tuple(graph.ops), tuple(stores), names, "derived from parameters")


def _folded(equations: Terms) -> list[str]:
    fixed = [c for c in equations.model.components if c.fixed]
    zero = sum(c.value == 0.0 for c in fixed)
    return [f"{len(fixed)} fixed coordinates became constants, {zero} of them zero"] if fixed else []
