"""Nodes of a graph as numbers in some typical positions: what is 0 everywhere, what never changes, which pivots are large."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ncgen.program.ir.graph import Graph
from ncgen.program.ir.passes import compute


class Sample(NamedTuple):
    """A consistent position q (n,) at the time t (s) and the parameters p (n_p,)."""

    t: float
    q: np.ndarray
    p: np.ndarray


def roughly(number: float) -> float:
    """Three digits of a number that was measured in samples: enough for a size, and the same on every machine."""
    return float(f"{number:.3g}")


class Sampling:
    """The values of a graph's nodes in samples; each is computed when it is first asked for.

    alike: which samples have the parameters of the first one
    """

    def __init__(self, graph: Graph, samples: Sequence[Sample]) -> None:
        self.graph, self.count = graph, len(samples)
        self.alike = [k for k, sample in enumerate(samples) if np.array_equal(sample.p, samples[0].p)]
        self._arrays: list[Mapping[str, Any]] = [{"t": [s.t], "q": s.q.tolist(), "p": s.p.tolist()} for s in samples]
        self._known: dict[int, np.ndarray] = {}

    def __getitem__(self, node: int) -> np.ndarray:
        """One number a sample."""
        for operand in self._missing(node):
            op = self.graph.ops[operand]
            if op.code == "const":
                self._known[operand] = np.full(self.count, op.value)
            elif op.code == "load":
                array, position = op.input
                self._known[operand] = np.array([arrays[array][position] for arrays in self._arrays])
            else:
                runs = zip(*(self._known[a].tolist() for a in op.args), strict=True)
                self._known[operand] = np.array([compute(op, run) for run in runs])
        return self._known[node]

    def of(self, matrix: Mapping[tuple[int, int], int]) -> list[dict[tuple[int, int], float]]:
        """A matrix of nodes as numbers, sample by sample."""
        values = {position: self[node] for position, node in matrix.items()}
        return [{position: float(v[k]) for position, v in values.items()} for k in range(self.count)]

    def _missing(self, node: int) -> list[int]:
        waiting, missing = [node], set()
        while waiting:
            operand = waiting.pop()
            if operand not in self._known and operand not in missing:
                missing.add(operand)
                waiting += self.graph.ops[operand].args
        return sorted(missing)
