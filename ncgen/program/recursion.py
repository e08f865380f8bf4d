"""Accelerations by a recursion over the tree of bodies: the program `acceleration` of `ncgen.program.dynamics`, for fewer operations.

The unknowns are the rates x of the tree's joints, and of coordinates that belong to no body of the tree. Elements move with q̇ = T x,
so what is left of the rows are those that close loops, that measure angles and lengths, and that users wrote: J x = ν with J = Φ_q T,
and J ẋ = γ − Φ_q b, where b is the acceleration of the elements without ẋ. With the mass matrix H of the rates and their forces f
by composite inertias, x = R ż + S ν over the independent rates ż gives

    (RᵀHR) z̈ = Rᵀ(f − H S (γ − Φ_q b))

γ of rows that a rigid motion satisfies is never needed. Which rows and which entries vanish is seen in sample positions.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from ncgen.errors import SingularError
from ncgen.model.elements import Component, Point, Relative, Spatial
from ncgen.program.assemble import KERNELS
from ncgen.program.blocks import Program
from ncgen.program.composite import Inertia, inertia_of, nothing
from ncgen.program.elimination import Factors, Matrix, factor, factor_symmetric, solve, solve_refined, solve_symmetric, solve_transposed
from ncgen.program.lines import Lines
from ncgen.program.programs import ENERGIES, Split
from ncgen.program.sampling import Sample, Sampling
from ncgen.program.space import Vector
from ncgen.program.tree_motion import TreePlace, TreeVelocity
from ncgen.symbolic.equations import build_without_inertia_of
from ncgen.symbolic.inertia import standard_inertia
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.tree import Tree, spanning_tree

VANISHING = 1e-11
"""An entry below this share of its row, in its natural sizes, is 0 by the way bodies move."""

SAME = 1e-10
"""Entries of a row whose ratio differs from 1 or −1 by less than this in every sample have that ratio always."""

WELL = 1e-9
"""The least singular value of the rows of the rates, over the largest."""

FEWEST = 4
"""Samples from which something can be concluded."""


class NoRecursion(Exception):
    """The recursion does not say what the equations say; the reason in words."""


@dataclass(frozen=True)
class Row:
    """A row of the rates: {unknown: node}, and where its right-hand sides come from.

    source: the number of the row of Φ, or (element, link) whose component `axis` moves with a link; None where both sides are 0
    """

    entries: dict[int, int]
    source: int | tuple[Spatial, int] | None
    axis: int = 0


def assemble_recursion(equations: Terms, split: Split, samples: Sequence[Sample], sizes: np.ndarray, refine: bool = False) -> Program:
    """The program acceleration(t, q, zd, p) -> q̇, z̈, power, amplification; arguments as for `assemble_dynamics`.

    Raises NoRecursion where the mechanism has no tree that moves as the rows allow.
    """
    if len(samples) < FEWEST:
        raise NoRecursion("too few positions to see what vanishes")
    return _Recursion(equations, split, samples, sizes).program(refine)


class _Recursion:
    """The recursion under way."""

    def __init__(self, equations: Terms, split: Split, samples: Sequence[Sample], sizes: np.ndarray) -> None:
        model = equations.model
        self.equations, self.split, self.model, self.tree = equations, split, model, spanning_tree(model)
        bodies = [link.body for link in self.tree.links]
        self.lines = Lines(build_without_inertia_of(model, bodies))
        self.graph = self.lines.graph
        self.sampling = Sampling(self.graph, samples)
        self.place = TreePlace(self.lines, self.tree)
        self.where = _where(equations, self.tree)
        count = len(self.place.columns)
        own = [c for c in range(len(equations.free)) if c not in self.where or c in split.independent]
        self.own = {c: count + k for k, c in enumerate(own)}
        self.unknowns = count + len(own)
        largest = max((sizes[c] for c, (e, _) in self.where.items() if isinstance(e, Point)), default=1.0)
        turning = [bool(np.any([self.sampling[i] for i in column.axis])) for column in self.place.columns]
        self.sizes = np.array([*(1.0 if turns else largest for turns in turning), *(sizes[c] for c in own)])
        self.natural = sizes
        self.jacobian = self.lines.matrix(KERNELS["phi_q"])
        self.free = [self.own[c] for c in split.independent]

    # -- rows of the rates ---------------------------------------------------------------------

    def rows(self) -> list[Row]:
        """All that is not satisfied by the way bodies move."""
        by_row: dict[int, dict[int, int]] = defaultdict(dict)
        for (r, c), node in sorted(self.jacobian.items()):
            by_row[r][c] = node
        rows = [self._constraint(r, entries) for r, entries in by_row.items()]
        rows += [row for number, link in enumerate(self.tree.links) for e in link.body.elements for row in self._carried(e, number)]
        return [row for row in rows if row.entries]

    def _constraint(self, number: int, entries: dict[int, int]) -> Row:
        """A row of Φ over the rates: what it does to each body is a force and a moment, which add up along the tree."""
        space, place = self.place.space, self.place
        loads: dict[int, tuple[Vector, Vector]] = {}
        row: dict[int, int] = {}
        for c, node in entries.items():
            if c in self.where:
                self._load(loads, c, node)
            else:
                row[self.own[c]] = node
        for link in reversed(range(len(self.tree.links))):
            if link in loads:
                force, moment = loads[link]
                for k in place.own[link]:
                    column = place.columns[k]
                    row[k] = self.graph.add(space.dot(column.axis, moment), space.dot(column.along, force))
                parent = self.tree.links[link].parent
                if parent is not None:
                    before = loads.get(parent, (space.zero, space.zero))
                    loads[parent] = (space.add(before[0], force), space.add(before[1], moment))
        scale = max(float(np.max(np.abs(self.sampling[node]))) * self.natural[c] for c, node in entries.items())
        row = self._nonzero(row, scale)
        snapped = self._constant(row)
        return Row(snapped, None) if snapped else Row(row, number)

    def _load(self, loads: dict[int, tuple[Vector, Vector]], c: int, node: int) -> None:
        """Add a generalised force along a coordinate to force and moment on its link."""
        space = self.place.space
        element, axis = self.where[c]
        link = self.tree.home[element]
        zero = self.graph.const(0.0)
        x, y, z = (node if k == axis else zero for k in range(3))
        force, moment = loads.get(link, (space.zero, space.zero))
        if isinstance(element, Point):
            force = space.add(force, (x, y, z))
        loads[link] = (force, space.add(moment, space.cross(self.place.lever(element, link), (x, y, z))))

    def _carried(self, element: Spatial, link: int) -> list[Row]:
        """An element that a link shares with another one that carries it, or that is held, moves as that one says; and where a
        coordinate is independent, its rate is that of the element."""
        place = self.place
        mine = place.moved(element, link)
        home = self.tree.home.get(element)
        theirs = place.moved(element, home) if home is not None and home != link else {}
        rows = []
        for axis, component in enumerate(element.components):
            entries = {k: v[axis] for k, v in mine.items()}
            for k, v in theirs.items():
                entries[k] = self.graph.sub(entries.get(k, self.graph.const(0.0)), v[axis])
            c = self.equations.index.get(component) if self.equations.moves(component) else None
            size = float(np.max([np.max(np.abs(self.sampling[node])) * self.sizes[k] for k, node in entries.items()], initial=1e-300))
            if home == link and c is not None:
                if c in self.own:
                    rows.append(Row({**self._nonzero(entries, size), self.own[c]: self.graph.const(-1.0)}, (element, link), axis))
                continue
            rows.append(Row(self._nonzero(entries, max(size, self._extent(element, component))), (element, link), axis))
        return rows

    def _extent(self, element: Spatial, component: Component) -> float:
        """How far an element moves when its link turns once."""
        return float(np.max(self.natural)) if isinstance(element, Point) else 1.0

    def _nonzero(self, entries: dict[int, int], scale: float) -> dict[int, int]:
        least = VANISHING * scale
        return {k: node for k, node in entries.items() if np.max(np.abs(self.sampling[node])) * self.sizes[k] > least}

    def _constant(self, row: dict[int, int]) -> dict[int, int] | None:
        """The row of a measured coordinate with ratios 1 and −1, where it has them: its rate is that of joints."""
        measured = [k for k in row if k >= len(self.place.columns) and isinstance(self._element(k), Relative)]
        if len(measured) != 1 or len(row) < 2:
            return None
        first = self.sampling[row[measured[0]]]
        if not np.all(np.abs(first) > 0):
            return None
        ratios = {k: self.sampling[node] / first for k, node in row.items()}
        if any(np.max(np.abs(np.abs(r) - 1.0)) > SAME or np.ptp(np.sign(r)) for r in ratios.values()):
            return None
        return {k: self.graph.const(float(np.sign(r[0]))) for k, r in ratios.items()}

    def _element(self, unknown: int) -> object:
        component = next(self.equations.free[c] for c, k in self.own.items() if k == unknown)
        return next(e for e in self.model.elements.values() if component in e.components)

    # -- the reduced system --------------------------------------------------------------------

    def kept(self, rows: list[Row]) -> list[Row]:
        """As many rows as there are dependent rates, independent in every sample."""
        dependent = [k for k in range(self.unknowns) if k not in self.free]
        matrices = np.zeros((self.sampling.count, len(rows), self.unknowns))
        for i, row in enumerate(rows):
            for k, node in row.entries.items():
                matrices[:, i, k] = self.sampling[node] * self.sizes[k]
        matrices /= np.max(np.abs(matrices), axis=(0, 2), initial=1e-300)[None, :, None]
        if len(rows) < len(dependent):
            raise NoRecursion(f"{len(rows)} rows for {len(dependent)} dependent rates")
        order = scipy.linalg.qr(matrices[0][:, dependent].T, mode="r", pivoting=True)[1]
        taken = sorted(order[: len(dependent)].tolist())
        for matrix in matrices:
            least, rank = np.linalg.svd(matrix[np.ix_(taken, dependent)], compute_uv=False), np.linalg.matrix_rank(matrix, tol=WELL * 10)
            if len(dependent) and (not least[-1] > WELL * least[0] or rank > len(dependent)):
                raise NoRecursion("the tree does not move as the rows allow")
        return [rows[i] for i in taken]

    def program(self, refine: bool) -> Program:
        graph, split = self.graph, self.split
        zero, one = graph.const(0.0), graph.const(1.0)
        rows = self.kept(self.rows())
        dependent = [k for k in range(self.unknowns) if k not in self.free]
        column = {k: j for j, k in enumerate(dependent)}
        matrix: Matrix = {(i, column[k]): node for i, row in enumerate(rows) for k, node in row.entries.items() if k in column}
        factors = factor(graph, matrix, len(rows), self.sampling.of(matrix))

        def particular(right: dict[int, int]) -> dict[int, int]:
            solution = solve_refined(graph, matrix, factors, right) if refine else solve(graph, factors, right)
            return {dependent[j]: node for j, node in solution.items()}

        R = []
        for k in self.free:
            right = {i: graph.neg(row.entries[k]) for i, row in enumerate(rows) if k in row.entries}
            R.append({k: one, **self._kept_entries(particular(right))})
        nu = self.lines.vector(KERNELS["nu"])
        driven = {i: nu[row.source] for i, row in enumerate(rows) if isinstance(row.source, int) and row.source in nu}
        x = [zero] * self.unknowns
        for k, node in particular(driven).items():
            x[k] = node
        for number, columns in enumerate(R):
            speed = graph.load("zd", number)
            for k, node in columns.items():
                x[k] = graph.add(x[k], graph.mul(node, speed))
        velocity = TreeVelocity(self.place, x[: len(self.place.columns)])
        self._take_rates(velocity, x)
        bias = particular(self._bias_of(rows, velocity))
        H, right = self._inertia(velocity)

        def times(vector: dict[int, int]) -> dict[int, int]:
            sums: dict[int, list[int]] = defaultdict(list)
            for (i, j), node in sorted(H.items()):
                if j in vector:
                    sums[i].append(graph.mul(node, vector[j]))
            return {i: graph.sum(nodes) for i, nodes in sums.items()}

        left = dict(right)
        for k, node in times(bias).items():
            left[k] = graph.sub(left.get(k, zero), node)
        HR = [times(columns) for columns in R]

        def dot(a: dict[int, int], b: dict[int, int]) -> int:
            return graph.sum(graph.mul(a[k], b[k]) for k in sorted(a.keys() & b.keys()))

        A: Matrix = {}
        for i in range(len(R)):
            for j in range(i + 1):
                node = dot(R[i], HR[j])
                if graph.value(node) != 0.0:
                    A[i, j] = A[j, i] = node
        y = {i: dot(columns, left) for i, columns in enumerate(R)}
        solved = self._solved(A, y)
        zdd = [solved.get(i, zero) for i in range(len(R))]
        power = self._power(rows, nu, column, factors, left, HR, zdd)
        amplification = graph.sum(self._grown(k, node, i) for i, columns in enumerate(R) for k, node in columns.items())
        return self.lines.program("acceleration", ("t", "q", "zd", "p"), [*self.lines.rates, *zdd, power, amplification])

    def _kept_entries(self, column: dict[int, int]) -> dict[int, int]:
        """Without those that vanish in every sample."""
        return self._nonzero_rates(column)

    def _nonzero_rates(self, column: dict[int, int]) -> dict[int, int]:
        return {k: node for k, node in column.items() if np.max(np.abs(self.sampling[node])) / self.sizes[k] > VANISHING}

    def _take_rates(self, velocity: TreeVelocity, x: list[int]) -> None:
        """q̇ from the rates; of independent coordinates they are the speeds themselves."""
        for c in range(len(self.equations.free)):
            if c in self.own:
                self.lines.rates[c] = x[self.own[c]]
            else:
                element, axis = self.where[c]
                self.lines.rates[c] = velocity.velocity[element][axis]

    def _bias_of(self, rows: list[Row], velocity: TreeVelocity) -> dict[int, int]:
        """γ − Φ_q b of every row."""
        graph, gamma = self.graph, self.lines.vector(KERNELS["gamma"])
        zero = graph.const(0.0)
        found: dict[int, int] = {}
        by_row: dict[int, dict[int, int]] = defaultdict(dict)
        for (r, c), node in sorted(self.jacobian.items()):
            if c in self.where:
                by_row[r][c] = node
        for i, row in enumerate(rows):
            if isinstance(row.source, int):
                parts = [graph.mul(node, self._acceleration(c, velocity)) for c, node in by_row[row.source].items()]
                found[i] = graph.sub(gamma.get(row.source, zero), graph.sum(parts))
            elif row.source is not None:
                element, link = row.source
                mine = velocity.bias_with(element, link)[row.axis]
                home = self.tree.home.get(element)
                theirs = velocity.bias[element][row.axis] if home is not None and home != link else zero
                found[i] = graph.sub(theirs, mine)
        return found

    def _acceleration(self, c: int, velocity: TreeVelocity) -> int:
        element, axis = self.where[c]
        return velocity.bias[element][axis]

    def _inertia(self, velocity: TreeVelocity) -> tuple[Matrix, dict[int, int]]:
        """Mass matrix of the rates, both triangles, and their forces without accelerations of the joints."""
        place, space, graph = self.place, self.place.space, self.graph
        links = self.tree.links
        gravity = tuple(self.lines.value(g) for g in self.model.gravity_field)
        applied, right = self._applied()
        composite = [nothing(space)] * len(links)
        loads = [(space.zero, space.zero)] * len(links)
        H: Matrix = {}
        for number in reversed(range(len(links))):
            link = links[number]
            force, moment = applied.get(number, (space.zero, space.zero))
            force, moment = space.sub(loads[number][0], force), space.sub(loads[number][1], moment)
            if link.body.inertia:
                own = self._own_inertia(number)
                (turning, along), (change, lift) = velocity.twists[number], velocity.changes[number]
                lift = space.add(space.sub(lift, gravity), space.cross(turning, along))
                needed = own.load(space, turning, lift, change)
                force, moment = space.add(force, needed[0]), space.add(moment, needed[1])
                composite[number] = composite[number].plus(space, own)
            for k in place.own[number]:
                column = place.columns[k]
                right[k] = graph.neg(graph.add(space.dot(column.axis, moment), space.dot(column.along, force)))
                linear, angular = composite[number].momentum(space, column.axis, column.along)
                for j in place.path[number]:
                    if j <= k:
                        other = place.columns[j]
                        H[k, j] = H[j, k] = graph.add(space.dot(other.axis, angular), space.dot(other.along, linear))
            if link.parent is not None:
                composite[link.parent] = composite[link.parent].plus(space, composite[number])
                before = loads[link.parent]
                loads[link.parent] = (space.add(before[0], force), space.add(before[1], moment))
        self._add_loose(H, right, velocity)
        return H, right

    def _own_inertia(self, number: int) -> Inertia:
        body = self.tree.links[number].body
        standard = standard_inertia(body, self.model.parameters)
        return inertia_of(standard, self.place.space, self.place.node, self.lines.value, self.place.reference[number])

    def _applied(self) -> tuple[dict[int, tuple[Vector, Vector]], dict[int, int]]:
        """Force and moment on every link, and forces along coordinates of no link, of all that is not inertia of the tree."""
        loads: dict[int, tuple[Vector, Vector]] = {}
        right: dict[int, int] = {}
        for c, node in sorted(self.lines.vector(KERNELS["force"]).items()):
            if c in self.where:
                self._load(loads, c, node)
            else:
                right[self.own[c]] = node
        return loads, right

    def _add_loose(self, H: Matrix, right: dict[int, int], velocity: TreeVelocity) -> None:
        """Masses of bodies that are no links: TᵀMT of their coordinates, and −TᵀM b."""
        graph = self.graph

        def moved(c: int) -> dict[int, int]:
            if c not in self.where:
                return {self.own[c]: graph.const(1.0)}
            element, axis = self.where[c]
            return {k: v[axis] for k, v in self.place.moved(element, self.tree.home[element]).items()}

        for (a, b), mass in sorted(self.lines.matrix(KERNELS["mass"]).items()):
            for i, left in moved(a).items():
                part = graph.mul(mass, left)
                for j, node in moved(b).items():
                    product = graph.mul(part, node)
                    H[i, j] = graph.add(H[i, j], product) if (i, j) in H else product
                if b in self.where:
                    pull = graph.mul(part, self._acceleration(b, velocity))
                    right[i] = graph.sub(right.get(i, graph.const(0.0)), pull)

    def _solved(self, A: Matrix, right: dict[int, int]) -> dict[int, int]:
        """A x = right for the mass matrix of the independent rates, in an order without fill on a tree."""
        size = len(self.free)
        if any((i, i) not in A for i in range(size)):
            raise SingularError(f"{self.model.name}: a motion of the mechanism has no inertia; give the bodies that move mass")
        return solve_symmetric(self.graph, factor_symmetric(self.graph, A, size, self.sampling.of(A)), right)

    def _grown(self, unknown: int, node: int, independent: int) -> int:
        """How much an error of an independent coordinate grows in a rate, squared, without units."""
        scale = self.sizes[self.free[independent]] / self.sizes[unknown]
        grown = self.graph.mul(self.graph.const(float(scale)), node)
        return self.graph.mul(grown, grown)

    def _power(
        self,
        rows: list[Row],
        nu: dict[int, int],
        column: dict[int, int],
        factors: Factors,
        left: dict[int, int],
        HR: Sequence[dict[int, int]],
        zdd: Sequence[int],
    ) -> int:
        """Power of forces without a potential and of drivers, P − νᵀλ with Jᵀ λ = f − H ẋ on the dependent rates."""
        graph = self.graph
        own = self.lines.vector(KERNELS["energy"]).get(ENERGIES.index("power"))
        power = own if own is not None else graph.const(0.0)
        if nu:
            rest = dict(left)
            for columns, acceleration in zip(HR, zdd, strict=True):
                for k, node in columns.items():
                    rest[k] = graph.sub(rest.get(k, graph.const(0.0)), graph.mul(node, acceleration))
            lam = solve_transposed(graph, factors, {column[k]: node for k, node in rest.items() if k in column})
            for i, row in enumerate(rows):
                if isinstance(row.source, int) and row.source in nu and i in lam:
                    power = graph.sub(power, graph.mul(nu[row.source], lam[i]))
        return power


def _where(equations: Terms, tree: Tree) -> dict[int, tuple[Spatial, int]]:
    """{coordinate: (element, axis)} of the coordinates that move with a link."""
    return {
        equations.index[component]: (element, axis)
        for element in tree.home
        for axis, component in enumerate(element.components)
        if equations.moves(component)
    }
