"""The motion of a mechanism as functions of a state, with exact derivatives, for codes that look for motions, such as optimal control.

    dynamics(t, s, v, u, p)     -> sd, vd: how s and v change
    outputs(t, s, v, u, p)      -> y: the model's outputs
    position(t, s, p)           -> q: natural coordinates
    constraints(t, s, p)        -> phi: what loops ask of s

u: inputs, p: parameters. In an open tree of hinges and slides s are the values of the joints and v their rates; there are no constraints.
Else s are all natural coordinates and v the rates of the independent ones, and `position` is left out. From a function f follow

    jac_f(in, out)                -> ∂out/∂in, block by block, sparse
    adj1_f(in, out, adj_out)      -> adj_in = Σ (∂out/∂in)ᵀ adj_out
    jac_adj1_f(…)                 -> the same of adj1_f: second derivatives

by forward or reverse sweeps, whichever give fewer operations; where both would be long, by one program that is run for every direction
(`Function.along`). Values of outputs are among the arguments of derivatives since CasADi's
interface has them there; nothing reads them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

from ncgen.program.algebra.elimination import solve_positive
from ncgen.program.ir.blocks import Program, written
from ncgen.program.ir.cut import cut
from ncgen.program.ir.derivatives import changes_along, gradient, tangent
from ncgen.program.ir.finishing import finish
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.inlined import inlined
from ncgen.program.ir.verify import verify
from ncgen.program.kernel_table import KERNELS
from ncgen.program.lines import Lines
from ncgen.program.motions.output_programs import assemble_outputs
from ncgen.program.tree.joint_programs import Followed, assemble_joint_space
from ncgen.symbolic.numbering import Terms

Entries: TypeAlias = dict[tuple[int, int], int]
"""{(row, column): node}."""

Nodes: TypeAlias = dict[str, list[int]]
"""{array: nodes of its elements}."""

Slopes: TypeAlias = dict[int, dict[tuple[str, int], int]]
"""{node: {(argument, position): node of the derivative by it}}; structural zeros stay out."""

SWEEPS = 3
"""Sweeps are not even tried where each would have to leave less than this share of the operations that it visits."""


@dataclass(frozen=True)
class StateArgument:
    """What a function takes: an array of `size` numbers; those of an unread one are not even given."""

    name: str
    size: int
    is_read: bool = True


@dataclass(frozen=True)
class StateResult:
    """A matrix that a function gives; only these entries can be other than 0."""

    name: str
    shape: tuple[int, int]
    entries: Entries

    @property
    def places(self) -> list[tuple[int, int]]:
        """(row, column) of the entries, column by column."""
        return sorted(self.entries, key=lambda entry: entry[::-1])


@dataclass(frozen=True, eq=False, kw_only=True)
class StateFunction:
    """A function of arrays as nodes of a graph.

    along: None, or the function whose Jacobian this is, found one direction after the other: the program then takes a seed, one number
        for each of the `variables` of that function, and writes how its results change; entries are all nodes of the results
    """

    name: str
    graph: Graph
    inputs: tuple[StateArgument, ...]
    results: tuple[StateResult, ...]
    along: StateFunction | None = None

    @cached_property
    def program(self) -> Program:
        """Writes the entries of all results one after the other."""
        read = {a.name: a.size for a in self.inputs if a.is_read}
        nodes = self.along.nodes if self.along else self.nodes
        if self.along:
            seeds = {load: self.graph.load("seed", k) for k, load in enumerate(self.along.variables)}
            nodes, read = changes_along(self.graph, nodes, seeds), read | {"seed": len(seeds)}
        block = finish(written(self.graph, "out", nodes))
        program = cut(Program(name=f"entries_of_{self.name}", inputs=tuple(read), output="out", size=len(nodes), blocks=(block,)))
        verify(program, read)
        return program

    @property
    def nodes(self) -> list[int]:
        """Of all entries of the results."""
        return [result.entries[entry] for result in self.results for entry in result.places]

    @property
    def variables(self) -> dict[int, tuple[str, int]]:
        """{node: (argument, position)} of all numbers that are read."""
        return {self.graph.load(a.name, k): (a.name, k) for a in self.inputs if a.is_read for k in range(a.size)}

    def jacobian(self, most: int) -> StateFunction:
        """Of vectors by all arguments; unrolled where that takes no more than so many operations."""
        variables = self.variables
        if operations(self.graph, self.nodes) * min(len(variables), len(self.nodes)) <= SWEEPS * most:
            derivatives = _slopes(self.graph, self.nodes, variables)
            if operations(self.graph, (s for row in derivatives.values() for s in row.values())) <= most:
                return self._jacobian(derivatives)
        return self._jacobian(_reached(self.graph, self.nodes, variables), self)

    def _jacobian(self, derivatives: Slopes, along: StateFunction | None = None) -> StateFunction:
        blocks = tuple(self._block(result, a, derivatives) for result in self.results for a in self.inputs)
        return StateFunction(name=f"jac_{self.name}", graph=self.graph, inputs=(*self.inputs, *self._values()), results=blocks, along=along)

    def _block(self, result: StateResult, by: StateArgument, derivatives: Slopes) -> StateResult:
        entries: Entries = {}
        for (row, _), node in result.entries.items():
            entries |= {(row, k): derivative for (name, k), derivative in derivatives[node].items() if name == by.name}
        return StateResult(f"jac_{result.name}_{by.name}", (result.shape[0], by.size), entries)

    def adjoint(self) -> StateFunction:
        """The gradient by the arguments of the results' sum, each entry times a seed."""
        graph, seeds = self.graph, tuple(StateArgument(f"adj_{r.name}", r.shape[0]) for r in self.results)
        parts = [
            graph.mul(graph.load(seed.name, row), node)
            for seed, result in zip(seeds, self.results, strict=True)
            for (row, _), node in result.entries.items()
        ]
        loads = self.variables
        derivatives = {loads[x]: node for x, node in gradient(graph, graph.sum(parts), loads).items()}
        results = [_vector(f"adj_{a.name}", [derivatives.get((a.name, k), graph.const(0.0)) for k in range(a.size)]) for a in self.inputs]
        return StateFunction(name=f"adj1_{self.name}", graph=graph, inputs=(*self.inputs, *self._values(), *seeds), results=tuple(results))

    def _values(self) -> tuple[StateArgument, ...]:
        return tuple(StateArgument(f"out_{r.name}", r.shape[0], is_read=False) for r in self.results)


def _vector(name: str, nodes: Sequence[int]) -> StateResult:
    return StateResult(name, (len(nodes), 1), {(k, 0): node for k, node in enumerate(nodes)})


def _slopes(graph: Graph, nodes: Iterable[int], loads: Mapping[int, tuple[str, int]]) -> Slopes:
    """By a sweep for every input or for every node, whichever needs fewer operations."""
    wanted, one = sorted(set(nodes)), graph.const(1.0)
    by_node = {node: {loads[x]: derivative for x, derivative in gradient(graph, node, loads).items()} for node in wanted}
    by_input: Slopes = {node: {} for node in wanted}
    for load, leaf in loads.items():
        for node, derivative in tangent(graph, wanted, {load: one}).items():
            by_input[node][leaf] = derivative
    return min(by_node, by_input, key=lambda derivatives: operations(graph, (s for row in derivatives.values() for s in row.values())))


def _reached(graph: Graph, nodes: Iterable[int], loads: Mapping[int, tuple[str, int]]) -> Slopes:
    """The pattern of the slopes alone, with the nodes themselves in their place."""
    known = {load: 1 << k for k, load in enumerate(loads)}
    reached: dict[int, int] = {}
    for node in sorted(graph.below(nodes)):
        bits = known.get(node, 0)
        for a in graph.ops[node].args:
            bits |= reached[a]
        reached[node] = bits
    leaves = list(loads.values())
    return {node: {leaf: node for k, leaf in enumerate(leaves) if reached[node] >> k & 1} for node in set(nodes)}


def operations(graph: Graph, nodes: Iterable[int]) -> int:
    """How many operations nodes need together."""
    return sum(bool(graph.ops[node].args) for node in graph.below(nodes))


def open_functions(equations: Terms, followed: Followed, joints: int) -> list[StateFunction]:
    """Of an open tree over its joints; followed: as for `assemble_joint_space`."""
    work = _Work(equations, {"s": joints, "v": joints})
    graph, t, s, v, p = work.graph, *(work.given[name] for name in ("t", "s", "v", "p"))
    programs = assemble_joint_space(equations, followed, "basics")

    def found(name: str, **inputs: list[int]) -> list[int]:
        return inlined(graph, programs[f"joint_{name}"], {"t": t, "p": p, "v": v, **inputs})

    q = found("position", x=s)
    applied, needed = found("loads", q=q), found("inverse", q=q, a=[graph.const(0.0)] * joints)
    lower = dict(zip(((i, j) for i in range(joints) for j in range(i + 1)), found("mass", q=q), strict=True))
    vd = solve_positive(graph, lower, joints, [graph.sub(a, b) for a, b in zip(applied, needed, strict=True)])
    motion = dict(zip([*s, *v], [*v, *vd], strict=True))
    qd = work.rates(q, motion)
    functions = [work.function("dynamics", {"sd": v, "vd": vd}), *work.outputs(q, qd, work.rates(qd, motion))]
    return [*functions, work.function("position", {"q": q}, ("t", "s", "p"))]


def closed_functions(equations: Terms, acceleration: Program, rows: Sequence[int], velocities: int) -> list[StateFunction]:
    """Of any mechanism over its natural coordinates. acceleration: q̇, z̈ from t, q, zd, p for so many velocities; rows: of Φ, which
    suffice."""
    n = len(equations.free)
    work = _Work(equations, {"s": n, "v": velocities})
    graph, t, s, v, p = work.graph, *(work.given[name] for name in ("t", "s", "v", "p"))
    inlined_nodes = inlined(graph, acceleration, {"t": t, "q": s, "zd": v, "p": p})
    sd, vd = inlined_nodes[:n], inlined_nodes[n : n + velocities]
    qdd = work.rates(sd, {t[0]: graph.const(1.0), **dict(zip([*s, *v], [*sd, *vd], strict=True))})
    lines = Lines(equations)
    phi = lines.vector(KERNELS["phi"])
    left = lines.program("phi", ("t", "q", "p"), [phi.get(r, lines.graph.const(0.0)) for r in rows])
    constraints = inlined(graph, left, {"t": t, "q": s, "p": p})
    functions = [work.function("dynamics", {"sd": sd, "vd": vd}), *work.outputs(s, sd, qdd)]
    return [*functions, work.function("constraints", {"phi": constraints}, ("t", "s", "p"))]


class _Work:
    """A graph whose inputs are t, the state, inputs u and parameters p; "p" of `given` are both, as ncgen's programs have them."""

    def __init__(self, equations: Terms, state: Mapping[str, int]) -> None:
        self.equations, self.graph = equations, Graph()
        count = len(equations.model.inputs)
        self.sizes = {"t": 1, **state, "u": count, "p": len(equations.parameters) - count}
        self.given: Nodes = {name: [self.graph.load(name, k) for k in range(size)] for name, size in self.sizes.items()}
        self.given["p"] = [*self.given["p"], *self.given["u"]]

    def rates(self, nodes: Sequence[int], motion: Mapping[int, int]) -> list[int]:
        """How nodes change where inputs change like this."""
        return changes_along(self.graph, nodes, dict(motion))

    def outputs(self, q: list[int], qd: list[int], qdd: list[int]) -> list[StateFunction]:
        """[] where the model has none. They mention no loads: there are no multipliers here."""
        if not self.equations.model.outputs:
            return []
        program, _ = assemble_outputs(self.equations)
        motion: Nodes = {"q": q, "qd": qd, "qdd": qdd, "lam": []}
        return [self.function("outputs", {"y": inlined(self.graph, program, self.given | motion)})]

    def function(self, name: str, results: Nodes, inputs: Sequence[str] | None = None) -> StateFunction:
        taken = tuple(StateArgument(name, self.sizes[name]) for name in inputs or self.sizes)
        return StateFunction(
            name=name, graph=self.graph, inputs=taken, results=tuple(_vector(result, nodes) for result, nodes in results.items())
        )


def with_derivatives(function: StateFunction, most: int) -> list[StateFunction]:
    """The function, its Jacobian, its gradient, and second derivatives; those that take more operations than `most` by directions."""
    adjoint = function.adjoint()
    return [function, function.jacobian(most), adjoint, adjoint.jacobian(most)]
