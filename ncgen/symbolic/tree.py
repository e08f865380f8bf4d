"""The bodies of a mechanism as a tree: which one carries which, and how each can move relative to the one that carries it.

A spanning tree takes the joints (`ncgen.model.pairs`) with the fewest degrees of freedom first. Whatever it does not use, elements shared
across it
and constraints of the user's, closes loops.
Source: García de Jalón & Bayo, Kinematic and Dynamic Simulation of Multibody Systems (1994), chapter 8.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from functools import cached_property
from heapq import heapify, heappop, heappush
from itertools import accumulate, pairwise
from weakref import WeakKeyDictionary

from ncgen.model import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import Spatial
from ncgen.model.pairs import Screw, joint_between, joint_to_ground, own_directions, sliding_of
from ncgen.symbolic.numbering import Numbering


@dataclass(frozen=True, eq=False)
class TreeLink:
    """A body in the tree. parent: the number of the link that carries it, None for the ground; screws: of its joint, outward."""

    body: Body
    parent: int | None
    screws: tuple[Screw, ...]


@dataclass(frozen=True, eq=False)
class Tree:
    """links: each after its parent; loose: bodies that are too thin to be links, such as points and bars in space."""

    links: tuple[TreeLink, ...]
    loose: tuple[Body, ...]
    home: dict[Spatial, int] = field(default_factory=dict)
    """{element: the link nearest to the ground that it moves with}; what rests and what belongs to no link is not there."""

    @property
    def dof(self) -> int:
        """Of the tree, before loops are closed."""
        return sum(len(link.screws) for link in self.links)

    @property
    def rates(self) -> list[range]:
        """For every link the numbers of its joint's rates."""
        ends = list(accumulate((len(link.screws) for link in self.links), initial=0))
        return [range(first, last) for first, last in pairwise(ends)]

    @cached_property
    def paths(self) -> list[list[int]]:
        """For every link the numbers of all rates that move it."""
        chains: list[list[int]] = []
        for link, numbers in zip(self.links, self.rates, strict=True):
            chains.append([*(chains[link.parent] if link.parent is not None else []), *numbers])
        return chains

    def chain(self, number: int) -> list[int]:
        """The links from the root to one, both included."""
        links: list[int] = []
        link: int | None = number
        while link is not None:
            links.append(link)
            link = self.links[link].parent
        return links[::-1]


_known: WeakKeyDictionary[Model, dict[tuple[int, bool], Tree]] = WeakKeyDictionary()
"""{model: {how much it had been told, and how its tree was asked for: the tree}}."""


def spanning_tree(model: Model, closes_loops_last: bool = False) -> Tree:
    """The tree of a model's bodies, found once.

    closes_loops_last: whether a body that has elements which rest hangs on the ground, whatever its joint, and of joints with as many
        degrees of freedom the one that the model has first is taken, so that what its last joints add to bodies closes loops
    """
    trees, key = _known.setdefault(model, {}), (len(model.facts), closes_loops_last)
    if key not in trees:
        trees[key] = _spanning_tree(model, closes_loops_last)
    return trees[key]


def _spanning_tree(model: Model, closes_loops_last: bool) -> Tree:
    waiting, sliding = [body for body in model.bodies.values() if _is_solid(body)], sliding_of(model)
    loose = tuple(body for body in model.bodies.values() if not _is_solid(body))
    links: list[TreeLink] = []
    best: dict[Body, tuple[int | None, tuple[Screw, ...]]] = {
        body: (None, joint_to_ground(body, sliding.get(frozenset({body, model.ground})))) for body in waiting
    }
    rank = {body: k for k, body in enumerate(waiting)}
    users: dict[Spatial, list[Body]] = defaultdict(list)
    for body in waiting:
        for element in body.elements:
            users[element].append(body)
    grounded = {body for body in waiting if closes_loops_last and any(element.fixed for element in body.elements)}
    order = _order_of_joints(model) if closes_loops_last else {}
    keys = [(-1 if body in grounded else len(best[body][1]), 0, number) for body, number in rank.items()]
    heap = list(keys)
    heapify(heap)
    taken: set[Body] = set()
    while heap:
        key = heappop(heap)
        body = waiting[key[-1]]
        if body in taken or key != keys[key[-1]]:
            continue
        taken.add(body)
        links.append(TreeLink(body, *best[body]))
        own_elements = set(body.elements)
        for other in {user: None for element in body.elements for user in users[element] if user not in taken}:
            shared = [e for e in other.elements if e in own_elements]
            screws = joint_between(other, shared, sliding.get(frozenset({body, other})))
            key = len(screws), order.get(frozenset({body, other}), len(order)), rank[other]
            if key < keys[rank[other]]:
                best[other], keys[rank[other]] = (len(links) - 1, screws), key
                heappush(heap, key)
    home: dict[Spatial, int] = {}
    for number, link in enumerate(links):
        for element in link.body.elements:
            if not element.fixed:
                home.setdefault(element, number)
    return Tree(tuple(links), loose, home)


def _order_of_joints(model: Model) -> dict[frozenset[Body], int]:
    """{two bodies: when the model first speaks of both of them}."""
    order: dict[frozenset[Body], int] = {}
    for fact in model.facts:
        bodies = frozenset(argument for argument in fact.arguments.values() if isinstance(argument, Body))
        if len(bodies) == 2:
            order.setdefault(bodies, len(order))
    return order


def by_depth(tree: Tree) -> Tree:
    """The same tree, links in the order of their distance from the ground: what comes next in a loop does not wait for what came before."""
    depth: list[int] = []
    for link in tree.links:
        depth.append(0 if link.parent is None else depth[link.parent] + 1)
    order = sorted(range(len(depth)), key=lambda number: depth[number])
    renumbered = {number: k for k, number in enumerate(order)}
    links = (tree.links[number] for number in order)
    moved = tuple(TreeLink(link.body, None if link.parent is None else renumbered[link.parent], link.screws) for link in links)
    return Tree(moved, tree.loose, {element: renumbered[number] for element, number in tree.home.items()})


def moving(numbering: Numbering, tree: Tree) -> dict[int, tuple[Spatial, int]]:
    """{coordinate: (element, axis)} of the coordinates that move with a link."""
    return {
        numbering.index[component]: (element, axis)
        for element in tree.home
        for axis, component in enumerate(element.components)
        if numbering.moves(component)
    }


def _is_solid(body: Body) -> bool:
    """True if the body's elements tell its rotation, too."""
    return bool(body.points) and len(own_directions(body, body.elements)) >= (1 if body.frame.planar else 2)
