"""Where a mechanism has corners over time: the knots of tables, and of splines that are differentiated twice.

A step that ends there has the error of a smooth motion. Corners over coordinates are found by error control.
"""

from __future__ import annotations

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.model.pieces import Pieces
from ncgen.program.ir.blocks import Straight
from ncgen.program.ir.graph import PIECES
from ncgen.program.ir.passes import compute

STRAIGHT = 1e-12
"""How far an argument may be from a straight line in time, of its largest value."""

MOST = 100_000
"""Corners of one table in a run beyond which they are left to error control."""


def corners(kernels: Kernels, p: np.ndarray, start: float, end: float) -> np.ndarray:
    """The instants (s) between two others, ascending, at which a table in a mechanism's forces or constraints has a corner.

    p (n_p,): the parameters. Tables count whose argument is a t + b, with numbers and parameters.
    """
    found = {
        instant
        for block in kernels.remember("blocks with lookups", (), lambda: _looking_up(kernels))
        for pieces, values in _over_time(block, p, (start, (start + end) / 2, end))
        for instant in _instants(pieces, values, start, end)
    }
    return np.array(sorted(found))


def _looking_up(kernels: Kernels) -> list[Straight]:
    """The straight lines of the kernels that look something up."""
    blocks = [block for program in kernels.programs.programs.values() for block in program.blocks if isinstance(block, Straight)]
    return [block for block in blocks if any(op.code == PIECES for op in block.ops)]


def _over_time(block: Straight, p: np.ndarray, times: tuple[float, ...]) -> list[tuple[Pieces, list[float]]]:
    """Lookups with corners, and their arguments at some times, where these depend on nothing but time and parameters."""
    known: dict[int, list[float]] = {}
    found: list[tuple[Pieces, list[float]]] = []
    for node, op in enumerate(block.ops):
        if op.code == "const":
            known[node] = [op.value] * len(times)
        elif op.code == "load" and op.input.array in ("t", "p"):
            known[node] = list(times) if op.input.array == "t" else [float(p[op.input.position])] * len(times)
        elif op.args and all(a in known for a in op.args):
            known[node] = [compute(op, run) for run in zip(*(known[a] for a in op.args), strict=True)]
            if op.code == PIECES and op.pieces.degree <= 1:
                found.append((op.pieces, known[op.args[0]]))
    return found


def _instants(pieces: Pieces, values: list[float], start: float, end: float) -> list[float]:
    """When an argument that has these values at the start, in the middle and at the end passes knots.

    One that only looks straight there costs a few steps, and no more.
    """
    first, middle, last = values
    bend = abs(first - 2 * middle + last)
    if first == last or not bend <= STRAIGHT * max(map(abs, values)):
        return []
    low, high = sorted((first, last))
    knots = np.array(pieces.knots)
    if pieces.period:
        if (high - low) / pieces.period * len(knots) > MOST:
            return []
        turns = np.arange(np.floor((low - knots[0]) / pieces.period), np.floor((high - knots[0]) / pieces.period) + 1)
        knots = np.add.outer(turns * pieces.period, knots[:-1]).ravel()
    instants = start + (knots - first) / (last - first) * (end - start)
    return instants[(instants > start) & (instants < end)].tolist()
