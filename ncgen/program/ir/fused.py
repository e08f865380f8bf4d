"""Several programs as one, which computes once what they have in common.

Whoever solves for accelerations wants Φ, Φ_q and γ at the same position. Their sines, differences of points and
products are largely the same: in one program the robot's take two thirds of the time of the three.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

from ncgen.program.ir import passes
from ncgen.program.ir.blocks import Loop, Program, Store, Straight, TableStore
from ncgen.program.ir.finishing import finish
from ncgen.program.ir.graph import Graph

S = TypeVar("S", Store, TableStore)


@dataclass(frozen=True)
class FusedPart:
    """A program, and of which row of the mechanism every number of its output is."""

    program: Program
    rows: tuple[int, ...]


def fuse(name: str, inputs: tuple[str, ...], parts: list[FusedPart]) -> Program:
    """One program that writes the outputs of several one after the other.

    Straight-line code is merged row by row, so that what a row's outputs share is used while it is at hand; loops stay
    as they are. Sines and cosines must not have been taken out yet (ncgen.program.ir.angles).
    """
    temporary, straight = _Merged(), _Merged()
    before: list[Loop] = []
    after: list[Loop] = []
    offset = 0
    for fused_part in parts:
        loops, old = before, fused_part.program.output
        for block in fused_part.program.blocks:
            if isinstance(block, Loop):
                loops.append(replace(block, stores=tuple(_moved(s, old, name, offset) for s in block.stores)))
            elif block.stores[0].array == old:
                straight.add(block, [(fused_part.rows[s.index], _moved(s, old, name, offset)) for s in block.stores])
                loops = after
            else:
                temporary.add(block, [(0, store) for store in block.stores])
        offset += fused_part.program.size
    temporaries = {array: size for fused_part in parts for array, size in fused_part.program.temporaries.items()}
    blocks = (*temporary.block(), *before, *straight.block(), *after)
    return Program(name=name, inputs=inputs, output=name, size=offset, blocks=blocks, temporaries=temporaries)


def _moved(store: S, old: str, new: str, offset: int) -> S:
    """A store into the output, where the output begins `offset` further on; others as they are."""
    if store.array != old:
        return store
    if isinstance(store, Store):
        return replace(store, array=new, index=store.index + offset)
    return replace(store, array=new, table=tuple(i + offset for i in store.table))


class _Merged:
    """Straight-line blocks on their way into one."""

    def __init__(self) -> None:
        self.graph = Graph()
        self.stores: dict[tuple[int, str, int], Store] = {}
        self.names: dict[int, str] = {}
        self.title = ""

    def add(self, block: Straight, stores: list[tuple[int, Store]]) -> None:
        """Take up a block with other stores, each with the number of its turn."""
        nodes = passes.unroll(self.graph, block, 0)
        self.names |= {nodes[k]: name for k, name in block.names.items()}
        self.stores |= {(turn, s.array, s.index): replace(s, node=nodes[s.node]) for turn, s in stores}
        self.title = block.title

    def block(self) -> list[Straight]:
        """The merged block, or none."""
        stores = tuple(self.stores[key] for key in sorted(self.stores))
        whole = Straight(tuple(self.graph.ops), stores, self.names, self.title)
        return [finish(whole)] if stores else []
