"""A step of an implicit method as the equations that it solves, with their derivatives: for what a whole motion changes with.

From a state x the unknowns u of a step solve F(u, x) = 0, and the step ends in G(u, x):

    step(t, h, x, u, w, p)  -> F and the nonzeros of ∂[F; G]/∂[u, x, w, p]

t: where the step begins; h: its length, then numbers of the method; w: inputs at its start, in its middle and at its end
States are [q, q̇] and what a method carries besides. RATTLE is of Andersen (J. Comput. Phys. 52, 1983, doi 10.1016/0021-9991(83)90014-1),
forces that depend on velocities taking that of the drift in both kicks; the energy-momentum scheme is the midpoint rule with the discrete
gradient of Gonzalez (J. Nonlinear Sci. 6, 1996, doi 10.1007/BF02440162); generalised α is of Arnold and Brüls (`ncgen.methods.newmark`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from ncgen.program.ir.blocks import Pattern, Program
from ncgen.program.ir.derivatives import gradient
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.inlined import inlined
from ncgen.program.ir.verify import verify
from ncgen.program.lines import line
from ncgen.program.programs import ENERGIES, Programs

INPUTS = ("t", "h", "x", "u", "w", "p")

MIN_STEP = 1e-10
"""A step of energy-momentum that moves less than this, in natural sizes, needs no correction: it would be rounding over rounding."""

INSTANTS = ("start", "middle", "end")
"""Of a step, in the order in which w has their inputs."""

Vector: TypeAlias = "list[Node]"

Entries: TypeAlias = "dict[tuple[int, int], Node]"


@dataclass(frozen=True)
class Node:
    """A number of a graph that is added and multiplied like one."""

    graph: Graph
    number: int

    def _of(self, other: Node | float) -> int:
        return other.number if isinstance(other, Node) else self.graph.const(float(other))

    def __add__(self, other: Node | float) -> Node:
        return Node(self.graph, self.graph.add(self.number, self._of(other)))

    def __sub__(self, other: Node | float) -> Node:
        return Node(self.graph, self.graph.sub(self.number, self._of(other)))

    def __mul__(self, other: Node | float) -> Node:
        return Node(self.graph, self.graph.mul(self.number, self._of(other)))

    def __truediv__(self, other: Node | float) -> Node:
        return Node(self.graph, self.graph.div(self.number, self._of(other)))

    def __neg__(self) -> Node:
        return Node(self.graph, self.graph.neg(self.number))

    __radd__, __rmul__ = __add__, __mul__


@dataclass(frozen=True)
class StepLayout:
    """unknowns, state: how many u and x has; multipliers: where, and how many, numbers of rows u has that need not be unique, with as many
    equations there; explicit: how many of the last unknowns their equations give from the others."""

    unknowns: int
    state: int
    multipliers: tuple[tuple[int, int], ...]
    explicit: int = 0

    @classmethod
    def of(cls, method: str, n: int, m: int) -> StepLayout:
        """That of a method, for n coordinates and m rows."""
        if method == "rattle":
            return cls(2 * (n + m), 2 * n, ((n, m), (2 * n + m, m)))
        if method == "energy-momentum":
            return cls(2 * n + 3 * m + 1, 2 * n, ((n, m), (2 * n + m, m)), m + 1)
        return cls(n + m, 4 * n if method == "generalized-alpha" else 2 * n, ((n, m),))


@dataclass(frozen=True, eq=False)
class StepEquations:
    """The program `step` of one mechanism and one method.

    pattern: of the derivatives
    """

    program: Program
    layout: StepLayout
    pattern: Pattern


Made: TypeAlias = "tuple[Vector, Vector]"
"""F and G."""


class _Step:
    """What formulas of steps read: nodes of a graph of their own."""

    def __init__(self, programs: Programs) -> None:
        self.programs, self.graph = programs, Graph()
        equations = programs.equations
        self.n, self.m, self.n_p, self.n_w = (
            len(equations.free),
            len(equations.rows),
            len(equations.parameters),
            len(equations.model.inputs),
        )
        self.rolling = [row.level != "position" for row in equations.model.rows]
        self.h = self.load("h", 0)
        t = self.load("t", 0)
        self.times: dict[str, Node] = dict(zip(INSTANTS, (t, t + self.h * 0.5, t + self.h), strict=True))
        self.q, self.qd = self.loads("x", 0, self.n), self.loads("x", self.n, self.n)

    def load(self, array: str, k: int) -> Node:
        return Node(self.graph, self.graph.load(array, k))

    def loads(self, array: str, first: int, count: int) -> Vector:
        return [self.load(array, first + k) for k in range(count)]

    def kernel(self, name: str, instant: str, q: Vector, qd: Vector | None = None) -> Vector:
        """The output of a kernel somewhere; [] of one that the mechanism does not need."""
        program = self.programs.programs.get(name)
        if program is None:
            return []
        p, inputs = self.loads("p", 0, self.n_p - self.n_w), self.loads("w", INSTANTS.index(instant) * self.n_w, self.n_w)
        arrays = {"t": [self.times[instant]], "q": q, "qd": qd or [], "p": p + inputs}
        outputs = inlined(self.graph, program, {name: [each.number for each in nodes] for name, nodes in arrays.items()})
        return [Node(self.graph, node) for node in outputs]

    def vector(self, name: str, size: int, instant: str, q: Vector, qd: Vector | None = None) -> Vector:
        return self.kernel(name, instant, q, qd) or [self.zero] * size

    @property
    def zero(self) -> Node:
        return Node(self.graph, self.graph.const(0.0))

    def rows(self, instant: str, q: Vector) -> Entries:
        """Φ_q."""
        return dict(zip(self.programs.phi_q.positions(), self.kernel("phi_q", instant, q), strict=True))

    def mass(self, instant: str, q: Vector) -> Entries:
        return dict(zip(self.programs.mass.positions(), self.kernel("mass", instant, q), strict=True))

    def times_vector(self, matrix: Entries, x: Vector, size: int) -> Vector:
        product = [self.zero] * size
        for (r, c), entry in matrix.items():
            product[r] = product[r] + entry * x[c]
        return product

    def balance(self, mass: Entries, qdd: Vector, rows: Entries, lam: Vector, force: Vector) -> Vector:
        """M q̈ + Φ_qᵀ λ − Q."""
        pulled = self.times_vector({(c, r): entry for (r, c), entry in rows.items()}, lam, self.n)
        return [a + b - c for a, b, c in zip(self.times_vector(mass, qdd, self.n), pulled, force, strict=True)]

    def closure(self, q: Vector) -> Vector:
        """Φ at the end; of a rolling condition its integral by the midpoint rule."""
        violation = self.vector("phi", self.m, "end", q)
        if not any(self.rolling):
            return violation
        middle = [(a + b) * 0.5 for a, b in zip(self.q, q, strict=True)]
        moved = self.times_vector(self.rows("middle", middle), sums(q, (-1.0, self.q)), self.m)
        nu = self.vector("nu", self.m, "middle", middle)
        rolled = sums(moved, (-self.h, nu))
        return [a + b if rolls else a for a, b, rolls in zip(violation, rolled, self.rolling, strict=True)]

    def allowed(self, instant: str, q: Vector, qd: Vector) -> Vector:
        """Φ_q q̇ − ν."""
        return sums(self.times_vector(self.rows(instant, q), qd, self.m), (-1.0, self.vector("nu", self.m, instant, q)))


def sums(first: Vector, *more: tuple[Node | float, Vector]) -> Vector:
    """first + Σ weight · vector."""
    total = list(first)
    for weight, vector in more:
        total = [a + b * weight for a, b in zip(total, vector, strict=True)]
    return total


def _dot(a: Iterable[Node], b: Iterable[Node], zero: Node) -> Node:
    return sum((x * y for x, y in zip(a, b, strict=True)), zero)


def start(step: _Step) -> Made:
    """u = [q̈, λ]: accelerations of a state; what generalised α begins with: [q, q̇, q̈, q̈]."""
    n, m, q, qd = step.n, step.m, step.q, step.qd
    qdd, lam = step.loads("u", 0, n), step.loads("u", n, m)
    rows = step.rows("start", q)
    balance = step.balance(step.mass("start", q), qdd, rows, lam, step.vector("force", n, "start", q, qd))
    gap = sums(step.times_vector(rows, qdd, m), (-1.0, step.vector("gamma", m, "start", q, qd)))
    return [*balance, *gap], [*q, *qd, *qdd, *qdd]


def generalized_alpha(step: _Step) -> Made:
    """u = [q̈, λ] at the end; x = [q, q̇, q̈, a]; h = [h, αm, αf, β, γ]."""
    n, m, h, q, qd = step.n, step.m, step.h, step.q, step.qd
    qdd, lam, before, auxiliary = step.loads("u", 0, n), step.loads("u", n, m), step.loads("x", 2 * n, n), step.loads("x", 3 * n, n)
    alpha_m, alpha_f, beta, gamma = step.loads("h", 1, 4)
    whole = -alpha_m + 1.0
    a = [(y * (-alpha_f + 1.0) + x * alpha_f - b * alpha_m) / whole for y, x, b in zip(qdd, before, auxiliary, strict=True)]
    end = sums(q, (h, qd), (h * h * (-beta + 0.5), auxiliary), (h * h * beta, a))
    rates = sums(qd, (h * (-gamma + 1.0), auxiliary), (h * gamma, a))
    balance = step.balance(step.mass("end", end), qdd, step.rows("end", end), lam, step.vector("force", n, "end", end, rates))
    return [*balance, *step.closure(end)], [*end, *rates, *qdd, *a]


def rattle(step: _Step) -> Made:
    """u = [v, λ, q̇, λ₁]: the velocity of the drift, that at the end, and what either kick takes."""
    n, m, h, q = step.n, step.m, step.h, step.q
    drift, lam = step.loads("u", 0, n), step.loads("u", n, m)
    rates, push = step.loads("u", n + m, n), step.loads("u", 2 * n + m, m)
    end = sums(q, (h, drift))
    first, second = ([x * 2.0 / h for x in sums(b, (-1.0, a))] for a, b in ((step.qd, drift), (drift, rates)))
    before, after = (
        step.balance(step.mass(when, at), kick, step.rows(when, at), by, step.vector("force", n, when, at, drift))
        for when, at, kick, by in (("start", q, first, lam), ("end", end, second, push))
    )
    return [*before, *step.closure(end), *after, *step.allowed("end", end, rates)], [*end, *rates]


def energy_momentum(step: _Step) -> Made:
    """u = [v, λ, q̇, μ, e, g]: the velocity at the end before and after it is projected, what rows and energy lack in the middle.

    h = [h, corrected, projected, sizes of coordinates]: corrected is 0 where a step moves nothing to speak of, projected whether it is
    """
    n, m, h, q = step.n, step.m, step.h, step.q
    qd, lam = step.loads("u", 0, n), step.loads("u", n, m)
    rates, push, gap, work = (
        step.loads("u", n + m, n),
        step.loads("u", 2 * n + m, m),
        step.loads("u", 2 * n + 2 * m, m),
        step.load("u", 2 * n + 3 * m),
    )
    corrected, projected, sizes = step.load("h", 1), step.load("h", 2), step.loads("h", 3, n)
    rate = [(a + b) * 0.5 for a, b in zip(step.qd, qd, strict=True)]
    end, middle = sums(q, (h, rate)), sums(q, (h * 0.5, rate))
    moved, change = sums(end, (-1.0, q)), sums(qd, (-1.0, step.qd))
    along = [x / (size * size) for x, size in zip(moved, sizes, strict=True)]
    length = _dot(moved, along, step.zero) * corrected + (-corrected + 1.0)
    along = [x * corrected / length for x in along]

    rows, force, mass = step.rows("middle", middle), step.vector("force", n, "middle", middle, rate), step.mass("middle", middle)
    ends = sums(step.vector("phi", m, "end", end), (-1.0, step.vector("phi", m, "start", q)), (h, step.vector("nu", m, "middle", middle)))
    lacking = sums(ends, (-1.0, step.times_vector(rows, moved, m)))
    lacking = [step.zero if rolls else x for x, rolls in zip(lacking, step.rolling, strict=True)]
    before, half, after = (
        step.vector("energy", len(ENERGIES), *at) for at in (("start", q, step.qd), ("middle", middle, rate), ("end", end, qd))
    )
    heavy = step.times_vector(mass, change, n)
    energy = before[1] - after[1] + half[2] * h + _dot(rate, heavy, step.zero) - (after[0] - before[0]) - _dot(force, moved, step.zero)
    total = work - _dot(gap, lam, step.zero)  # what the two corrections say along `along`
    balance = step.balance(mass, [x / h for x in change], rows, lam, force)
    balance = sums(balance, (-total, along))
    missing = step.balance(step.mass("end", end), sums(rates, (-1.0, qd)), step.rows("end", end), push, [step.zero] * n)
    held = sums(rates, (-1.0, qd))
    missing = [a * projected + b * (-projected + 1.0) for a, b in zip(missing, held, strict=True)]
    closing = step.allowed("end", end, rates)
    closing = [a * projected + b * (-projected + 1.0) for a, b in zip(closing, push, strict=True)]
    equations = [*balance, *step.closure(end), *missing, *closing, *sums(gap, (-1.0, lacking)), work - energy]
    return equations, [*end, *rates]


METHODS: dict[str, Callable[[_Step], Made]] = {
    "start": start, "rattle": rattle, "energy-momentum": energy_momentum, "generalized-alpha": generalized_alpha,
}  # fmt: skip
"""By the names of integrators; `start` by none."""


def extra(method: str, n: int) -> int:
    """How many numbers `h` has besides the length of the step."""
    return {"generalized-alpha": 4, "energy-momentum": 2 + n}.get(method, 0)


def assemble_step(programs: Programs, method: str) -> StepEquations:
    """The equations of a step of a method, one of `METHODS`."""
    step = _Step(programs)
    F, G = METHODS[method](step)
    layout = StepLayout.of(method, step.n, step.m)
    assert len(F) == layout.unknowns
    lengths = {"u": layout.unknowns, "x": layout.state, "w": len(INSTANTS) * step.n_w, "p": step.n_p}
    columns = {leaf: k for k, leaf in enumerate((array, i) for array, length in lengths.items() for i in range(length))}
    derivatives = _slopes(step.graph, [node.number for node in (*F, *G)], columns)
    pattern = Pattern.of((len(F) + len(G), len(columns)), derivatives)
    program = line(
        step.graph,
        "step",
        INPUTS,
        [*(node.number for node in F), *(derivatives[entry] for entry in sorted(derivatives))],
        programs.equations,
    )
    verify(program, {"t": 1, "h": 1 + extra(method, step.n), **lengths})
    return StepEquations(program, layout, pattern)


def _slopes(graph: Graph, outputs: Sequence[int], columns: dict[tuple[str, int], int]) -> dict[tuple[int, int], int]:
    """{(row, column): node of the derivative}."""
    variables = {graph.load(*leaf): column for leaf, column in columns.items()}
    derivatives: dict[tuple[int, int], int] = {}
    for row, output in enumerate(outputs):
        if output in variables:
            derivatives[row, variables[output]] = graph.const(1.0)
            continue
        for variable, derivative in gradient(graph, output, variables).items():
            derivatives[row, variables[variable]] = derivative
    return derivatives
