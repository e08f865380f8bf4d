"""With which link of a tree of bodies an element stands that several bodies share.

On an open tree that is the one nearest to the ground. At the end of a loop the bodies that share an element carry it differently: it stands
with one that needs it, since nothing else shows how fast its joint moves.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np

from ncgen.model.singular_values import rank_above
from ncgen.program.tree.couplings import RELATIVE_TOLERANCE
from ncgen.program.tree.tree_velocities import TreeVelocities
from ncgen.symbolic.numbering import Numbering
from ncgen.symbolic.tree import Tree


def with_homes(numbering: Numbering, tree: Tree, q: np.ndarray, length: float) -> Tree:
    """The same tree with homes of its elements by which every link shows how fast its joint moves, as far as there are some.

    length (m): a natural one
    """
    velocities = TreeVelocities(numbering, tree)
    moved = _Moved(velocities, q, length)
    homes = list(velocities.home)
    contested = {e: links for e in range(len(homes)) if len(links := moved.carriers(e)) > 1}
    for link in range(len(velocities.tree.links)):
        for e, links in contested.items():
            if link not in links or homes[e] == link or moved.is_shown(link, homes):
                continue
            tried = [link if other == e else home for other, home in enumerate(homes)]
            if moved.shown(link, tried) > moved.shown(link, homes) and moved.shown(homes[e], tried) == moved.shown(homes[e], homes):
                homes = tried
    chosen = {element: homes[velocities.number[element]] for element in velocities.elements}
    return replace(velocities.tree, home=chosen)


class _Moved:
    """What joints move in a position."""

    def __init__(self, tree: TreeVelocities, q: np.ndarray, length: float) -> None:
        self.tree = tree
        rates = np.diag([1.0 if screw.point else length for screw in tree.screws])
        both = [(tree.number[e], link) for link, each in enumerate(tree.tree.links) for e in each.body.elements if e in tree.number]
        carried = tree.carried(q, rates, np.array([e for e, _ in both], dtype=int), [link for _, link in both])
        self.velocity = {pair: carried[:, k] for k, pair in enumerate(both)}
        self.users: dict[int, list[int]] = defaultdict(list)
        for e, link in both:
            self.users[e].append(link)

    def carriers(self, e: int) -> list[int]:
        """Links that carry an element differently, of those that carry it alike the first."""
        links: list[int] = []
        for link in sorted(self.users[e]):
            velocity = self.velocity[e, link]
            if not any(np.allclose(self.velocity[e, other], velocity, rtol=0, atol=RELATIVE_TOLERANCE) for other in links):
                links.append(link)
        return links

    def shown(self, link: int, homes: list[int]) -> int:
        """How many of its joint's motions the elements show that stand with a link."""
        joint = self.tree.own[link]
        moved = [self.velocity[e, link][joint.start : joint.stop] for e in self._members(link) if homes[e] == link]
        return int(rank_above(np.hstack(moved), RELATIVE_TOLERANCE)) if moved else 0

    def _members(self, link: int) -> list[int]:
        """The elements of its body."""
        return [self.tree.number[e] for e in self.tree.tree.links[link].body.elements if e in self.tree.number]

    def is_shown(self, link: int, homes: list[int]) -> bool:
        return self.shown(link, homes) == len(self.tree.own[link])
