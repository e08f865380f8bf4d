"""How the elements of a tree of bodies move with the rates of its joints, in numbers: the tables' own kinematics."""

from __future__ import annotations

from itertools import groupby
from typing import TypeAlias

import numpy as np

from ncgen.model.elements import Component, Point, Spatial
from ncgen.model.pairs import Screw
from ncgen.model.values import is_number
from ncgen.program.tree.couplings import RELATIVE_TOLERANCE, NoTables
from ncgen.symbolic.numbering import Numbering
from ncgen.symbolic.tree import Tree, by_depth, moving

Level: TypeAlias = tuple[list[int], list[int], list[tuple[bool, list[int], list[int]]]]
"""Links of equal distance from the ground, their parents (no one's where they hang on the ground), and their screws, those of no link with
those of the same link: whether these turn, the links, and the screws."""


class TreeVelocities:
    """A tree of bodies, its elements and screws by their numbers.

    elements: those that move, each with its home, the link nearest to the ground that it moves with; where: {coordinate: (element, axis)}
    measured: {coordinate: (number of its screw, how much faster it grows)} of coordinates that no body carries
    Raises NoTables where parameters have a say in it.
    """

    def __init__(self, numbering: Numbering, tree: Tree) -> None:
        if not tree.links:
            raise NoTables("there are no bodies")
        self.tree = tree = by_depth(tree)
        self.index, self.n = numbering.index, len(numbering.free)
        self.moves = numbering.moves
        self.fixed: dict[Component, int] = {}
        self.elements = sorted(tree.home, key=lambda e: tree.home[e])
        self.number = {element: k for k, element in enumerate(self.elements)}
        self.home = [tree.home[element] for element in self.elements]
        self.where = {c: (self.number[e], axis) for c, (e, axis) in moving(numbering, tree).items()}
        self.screws = [screw for link in tree.links for screw in link.screws]
        self.own = tree.rates
        self.components = [self._components(element) for element in self.elements]
        self._positions = np.array(self.components, dtype=int).reshape(-1, 3)
        self.is_point = np.array([isinstance(element, Point) for element in self.elements], dtype=bool)
        self.references = [self._components(self._reference(number)) for number in range(len(tree.links))]
        self._origins = np.array(self.references)
        self.terms = [self._terms(screw) for screw in self.screws]
        self._axes = self._padded_terms()
        self._levels = self._by_level()
        self.measured: dict[int, tuple[int, float]] = {}

    def _component(self, component: Component) -> int:
        """A coordinate, or the number of a fixed component behind them."""
        if self.moves(component):
            return self.index[component]
        if not is_number(component.value):
            raise NoTables(f"{component.name} is an expression of parameters")
        return self.n + self.fixed.setdefault(component, len(self.fixed))

    def _components(self, element: Spatial) -> list[int]:
        return [self._component(component) for component in element.components]

    def _reference(self, link: int) -> Point:
        """The point that a link turns about, else one of its own."""
        body, screws = self.tree.links[link].body, self.tree.links[link].screws
        return next((screw.point for screw in screws if screw.point is not None), body.points[0])

    def _terms(self, screw: Screw) -> list[tuple[float, list[int]]]:
        if not all(is_number(weight) for weight, _ in screw.axis.terms):
            raise NoTables("an axis has parameters")
        return [(float(weight), self._components(element)) for weight, element in screw.axis.terms]

    def _padded_terms(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The first term of every axis, the second and so on: weights (screws, 1), 0 where there is none, and coordinates (screws, 3)."""
        most = max(map(len, self.terms), default=0)
        padded = [[*terms, *[(0.0, [0, 0, 0])] * (most - len(terms))] for terms in self.terms]
        return [(np.array([[w] for w, _ in each]), np.array([c for _, c in each])) for each in zip(*padded, strict=True)]

    def _by_level(self) -> list[Level]:
        """The links of equal distance from the ground, which move with those before."""
        levels: list[Level] = []
        depth: dict[int | None, int] = {None: 0}
        for number, link in enumerate(self.tree.links):
            depth[number] = depth[link.parent] + 1
        for _, group in groupby(range(len(self.tree.links)), lambda number: depth[number]):
            links = list(group)
            joints: dict[tuple[int, bool], tuple[list[int], list[int]]] = {}
            for number in links:
                for order, k in enumerate(self.own[number]):
                    carriers, screws = joints.setdefault((order, self.screws[k].point is not None), ([], []))
                    carriers.append(number)
                    screws.append(k)
            parents = [parent for number in links if (parent := self.tree.links[number].parent) is not None]
            levels.append((links, parents, [(turns, *joints[order, turns]) for order, turns in sorted(joints)]))
        return levels

    def values(self, q: np.ndarray) -> np.ndarray:
        """Coordinates, fixed components behind them: (n + fixed,)."""
        return np.append(q, [component.initial for component in self.fixed])

    def velocities(self, q: np.ndarray, rates: np.ndarray, alone: bool = False) -> np.ndarray:
        """q̇ (…, n) at rates (…, screws) of the joints, those of fixed components behind it: (…, n + fixed).

        alone: what each link's own joint gives, as if its parent were at rest
        """
        qd = np.zeros((*rates.shape[:-1], self.n + len(self.fixed)))
        qd[..., self._positions] = self.carried(q, rates, np.arange(len(self.elements)), self.home, alone)
        for c, (k, ratio) in self.measured.items():
            qd[..., c] = ratio * rates[..., k]
        return qd

    def carried(self, q: np.ndarray, rates: np.ndarray, elements: np.ndarray, links: list[int], alone: bool = False) -> np.ndarray:
        """Velocities (…, elements, 3) of elements as links carry them, of each its own; alone: as of `velocities`."""
        values, is_point = self.values(q), self.is_point[elements][:, None]
        turning, along, origins = self._twists(values, rates, alone)
        levers = values[self._positions[elements]] - np.where(is_point, origins[links], 0.0)
        return cross(turning[..., links, :], levers) + np.where(is_point, along[..., links, :], 0.0)

    def moving_together(self, q: np.ndarray, rates: np.ndarray) -> dict[tuple[int, int], bool]:
        """{(element, link to whose body it belongs): whether it moves with the link at all rates (tries, screws)}."""
        both = [(self.number[e], link) for link, each in enumerate(self.tree.links) for e in each.body.elements if e in self.number]
        elements, links = np.array([e for e, _ in both], dtype=int), [link for _, link in both]
        if not both:
            return {}
        moved = self.velocities(q, rates)[..., self._positions[elements]]
        gaps, apart = np.abs(self.carried(q, rates, elements, links) - moved), np.zeros(len(both), dtype=bool)
        for kind in (self.is_point[elements], ~self.is_point[elements]):
            size = np.max(np.abs(moved[:, kind]), axis=(1, 2), initial=0.0)[:, None, None]
            apart[kind] = np.any(gaps[:, kind] > RELATIVE_TOLERANCE * size, axis=(0, 2))
        return {pair: not is_apart for pair, is_apart in zip(both, apart.tolist(), strict=True)}

    def _twists(self, values: np.ndarray, rates: np.ndarray, alone: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of every link its angular velocity and that of its reference point (…, links, 3), and where that is (links, 3)."""
        axes = np.zeros((len(self.terms), 3))
        for weights, coordinates in self._axes:
            axes += weights * values[coordinates]
        origins = values[self._origins]
        turning, along = (np.zeros((*rates.shape[:-1], len(origins), 3)) for _ in range(2))
        for links, parents, joints in self._levels:
            if parents and not alone:
                turning[..., links, :] = turning[..., parents, :]
                along[..., links, :] = along[..., parents, :] + cross(turning[..., parents, :], origins[links] - origins[parents])
            for turns, carriers, screws in joints:
                moved = turning if turns else along
                moved[..., carriers, :] += rates[..., screws, None] * axes[screws]
        return turning, along, origins


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a × b of vectors (…, 3) and (…, 3), as np.cross gives it in a fraction of the time."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)
