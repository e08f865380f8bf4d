"""Open trees of bodies: their tables, made from the kernels at the initial position, whatever their size."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.program.tree.couplings import NoTables
from ncgen.program.tree.table_layout import TreeTables, tables_of
from ncgen.program.tree.tree_tables import Around, OpenTree, SampledPosition
from ncgen.solver.positions.described_position import found_in_described
from ncgen.symbolic.tree import spanning_tree

PARAMETER_PERTURBATION = 0.03
"""By which share of theirs other parameters differ."""


@dataclass(frozen=True)
class KnownTree:
    """What runs need of an open tree: its degrees of freedom while loops are open, and its tables."""

    freedoms: int
    tables: TreeTables


def known_tree(kernels: Kernels, closes_loops: bool = False) -> KnownTree | None:
    """What runs need of `open_tree`, or of `tree_with_loops`, from the cache or made now."""
    record = _found(kernels, closes_loops)
    return record if isinstance(record, KnownTree) else None


def why_no_tables(kernels: Kernels) -> str | None:
    """Why a mechanism does not move in loops over tables, with its loops; None where it does."""
    record = _found(kernels, closes_loops=True)
    return None if known_tree(kernels) or isinstance(record, KnownTree) else record


def _found(kernels: Kernels, closes_loops: bool) -> KnownTree | str:
    """What runs need, or why there is none, from the cache or made now."""

    def made() -> dict[str, Any]:
        tree = (open_tree(kernels) if closes_loops else None) or _known(kernels, closes_loops)
        return {"why": tree} if isinstance(tree, str) else {"freedoms": tree.freedoms, "tables": tables_of(tree).plain()}

    def find() -> KnownTree | str:
        members = found_in_described(kernels, f"tables of a tree{' with loops' if closes_loops else ''}", made)
        return members["why"] if "why" in members else KnownTree(members["freedoms"], TreeTables(**members["tables"]))

    return kernels.remember("known tree", closes_loops, find)


def open_tree(kernels: Kernels) -> OpenTree | None:
    """The open tree that a mechanism is; None where it has loops, drivers, rolling, or bodies that are no links."""
    made = _known(kernels, closes_loops=False)
    return made if isinstance(made, OpenTree) else None


def tree_with_loops(kernels: Kernels) -> OpenTree | None:
    """The same of a mechanism whose other constraints close loops of its tree of bodies, or couple motions of a joint."""
    made = open_tree(kernels) or _known(kernels, closes_loops=True)
    return made if isinstance(made, OpenTree) else None


def _known(kernels: Kernels, closes_loops: bool) -> OpenTree | str:
    return kernels.remember("tree with loops" if closes_loops else "open tree", (), lambda: _made(kernels, closes_loops))


def _made(kernels: Kernels, closes_loops: bool) -> OpenTree | str:
    """The tree, or why there is none."""
    if "nu" in kernels.programs.programs or len(kernels.holonomic) < kernels.m or not 0 < kernels.m <= kernels.n:
        return "it has drivers, rolling, more constraints than coordinates, or no constraints"
    parameters = [kernels.p0]
    if len(kernels.p0):
        generator = np.random.default_rng(1)
        parameters.append(
            kernels.p0
            + PARAMETER_PERTURBATION * generator.uniform(-1, 1, len(kernels.p0)) * np.where(kernels.p0 == 0.0, 1.0, np.abs(kernels.p0))
        )
    around = Around(kernels.q0, [partial(sampled, kernels, p) for p in parameters], kernels.row_sizes, kernels.column_sizes)
    try:
        tree = spanning_tree(kernels.model, closes_loops_last=closes_loops)
        return OpenTree(
            kernels.programs.equations, tree, (kernels.mass_pattern, kernels.phi_q_pattern), around, kernels.model.parameters, closes_loops
        )
    except NoTables as reason:
        return str(reason)


def sampled(kernels: Kernels, p: np.ndarray, q: np.ndarray, t: float = 0.0) -> SampledPosition:
    """What the kernels say of a position."""
    phi, phi_q, mass = (kernels.values(name, t, q, None, p) for name in ("phi", "phi_q", "mass"))
    return SampledPosition(q, phi / kernels.row_sizes, phi_q, mass)
