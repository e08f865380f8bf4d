"""Which link of a tree of bodies carries which entry of the mass matrix.

What two bodies share at the end of a loop moves with both of them wherever loops are closed. So an entry is shared out among bodies that
have both of its elements, each with what is its own at the parameters' defaults. Any other shares give the same motion, since they differ
only in velocities that loops do not allow; these leave the inertia of every body as it is, so that all joints move inertia.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from ncgen.model.bodies import Body
from ncgen.model.elements import Component
from ncgen.model.values import Parameter, evaluate
from ncgen.program.ir.blocks import Pattern
from ncgen.program.tree.couplings import NoTables
from ncgen.program.tree.tree_velocities import TreeVelocities
from ncgen.symbolic.inertia import standard_inertia

MASSLESS_FRACTION = 1e-2
"""An element without mass counts as one with this share of the heaviest one's of its link."""

CANCELLED = 1e-6
"""Shares of bodies that leave less than this of them in their sum cannot be told from it."""


@dataclass(kw_only=True)
class TreeMasses:
    """Entries of M by the links that carry them.

    pairs: (link, element, element, number of its value), where it is the same along all axes; pair_shares: what of it the link carries
    singles: (link, element, axis, element, axis, number of its value) of others; single_shares: as of pairs
    rotors: (screw, number of its value, square of how much faster the measured coordinate is)
    """

    pairs: list[tuple[int, int, int, int]] = field(default_factory=list)
    pair_shares: list[float] = field(default_factory=list)
    singles: list[tuple[int, int, int, int, int, int]] = field(default_factory=list)
    single_shares: list[float] = field(default_factory=list)
    rotors: list[tuple[int, int, float]] = field(default_factory=list)


def masses_of(
    tree: TreeVelocities,
    pattern: Pattern,
    masses: np.ndarray,
    parameters: dict[str, Parameter],
    together: dict[tuple[int, int], bool],
) -> TreeMasses:
    """Entries of M, as pairs where they are the same along all axes.

    masses (positions, nonzeros): values of M; together: as `TreeVelocities.moving_together`
    Raises NoTables where an entry belongs to no body that carries both of its elements.
    """
    entries_by_link, entries = TreeMasses(), defaultdict[tuple[int, int], dict[tuple[int, int], int]](dict)
    for (i, j), value in pattern.positions().items():
        if i == j and i in tree.measured:
            screw, ratio = tree.measured[i]
            entries_by_link.rotors.append((screw, value, ratio**2))
        elif i >= j:
            if i not in tree.where or j not in tree.where:
                raise NoTables("a mass couples coordinates of no body")
            (a, x), (b, y) = sorted((tree.where[i], tree.where[j]))
            entries[a, b][x, y] = value
    carriers = _carriers(tree, parameters, together)
    carried = sorted((link, pair, fraction) for pair in entries for link, fraction in carriers(*pair).items())
    for link, (a, b), fraction in carried:
        values = masses[:, list(entries[a, b].values())].T
        if all(x == y for x, y in entries[a, b]) and np.all(np.ptp(values, axis=1) <= 4 * np.finfo(float).eps * np.abs(values[:, 0])):
            entries_by_link.pairs.append((link, a, b, next(iter(entries[a, b].values()))))
            entries_by_link.pair_shares.append(fraction)
        else:
            entries_by_link.singles += [(link, a, x, b, y, value) for (x, y), value in sorted(entries[a, b].items())]
            entries_by_link.single_shares += [fraction] * len(entries[a, b])
    return entries_by_link


def _carriers(
    tree: TreeVelocities, parameters: dict[str, Parameter], together: dict[tuple[int, int], bool]
) -> Callable[[int, int], dict[int, float]]:
    """{link: its share} of the entries between two elements."""
    users: dict[int, list[int]] = defaultdict(list)
    for element, link in sorted(together):
        users[element].append(link)

    @cache
    def masses_alone(link: int) -> dict[tuple[Component, Component], float]:
        return _own_masses(tree.tree.links[link].body, parameters)

    def carriers(a: int, b: int) -> dict[int, float]:
        links = [link for link in users[a] if link in users[b]]
        if not links:
            raise NoTables("a mass belongs to two bodies")
        at_home = max(tree.home[a], tree.home[b])
        first = at_home if at_home in links else links[0]
        if all(together[a, link] and together[b, link] for link in links):
            return {first: 1.0}
        components = tree.elements[a].components[0], tree.elements[b].components[0]
        amounts = {link: masses_alone(link).get(components, 0.0) for link in links}
        whole = sum(amounts.values())
        if abs(whole) <= CANCELLED * sum(map(abs, amounts.values())):
            return {first: 1.0}
        return {link: amount / whole for link, amount in amounts.items() if amount}

    return carriers


def _own_masses(body: Body, parameters: dict[str, Parameter]) -> dict[tuple[Component, Component], float]:
    """{first components of two elements: the mass between them} of one body, that of a cross product left out."""
    masses: dict[tuple[Component, Component], float] = defaultdict(float)
    if body.inertia is None:
        return masses
    standard = standard_inertia(body, parameters)
    for k, one in enumerate(standard.directions):
        for l, other in enumerate(standard.directions):
            amount = evaluate(standard.matrix[k][l], parameters, body.name)
            for weight, components in one:
                for factor, others in other:
                    masses[components[0], others[0]] += weight * factor * amount
    return masses


def heaviness_of(tree: TreeVelocities, pattern: Pattern, masses: np.ndarray, q: np.ndarray, columns: np.ndarray) -> list[float]:
    """How much the velocity of an element counts where the rates of a joint are found, as `ncgen.program.tree.joint_rates` has it:
    of one screw that of the element alone that it moves most, of several those of all, each with its mass.

    masses: values of M at q; columns (n,): natural sizes of the coordinates
    """
    diagonal = pattern.diagonal(masses)
    heaviest_entry, size = np.zeros(len(tree.elements)), np.ones(len(tree.elements))
    for c, (e, _) in tree.where.items():
        heaviest_entry[e], size[e] = max(heaviest_entry[e], diagonal[c]), columns[c]
    heaviness, homes, components = heaviest_entry * size**2, np.array(tree.home), np.array(tree.components)
    moved = tree.velocities(q, np.ones(len(tree.screws)), alone=True)
    ends = np.searchsorted(homes, range(len(tree.own) + 1))
    for rates, first, last in zip(tree.own, ends, ends[1:], strict=False):
        carried = np.arange(first, last)
        heaviest = np.max(heaviness[carried], initial=0.0) or 1.0
        heaviness[carried] = np.maximum(heaviness[carried] / heaviest, MASSLESS_FRACTION) / size[carried] ** 2
        if len(rates) == 1 and len(carried):
            reach = np.sum(moved[components[carried]] ** 2, axis=1)
            best = carried[np.argmax(heaviness[carried] * reach)]
            heaviness[carried[carried != best]] = 0.0
    return heaviness.tolist()
