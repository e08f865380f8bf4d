"""Functions of the motion for CasADi, with Jacobians and second derivatives, in C after its interface for external functions."""

from __future__ import annotations

import re
from itertools import accumulate

import numpy as np

from ncgen import __version__
from ncgen.emit.c.files import program_records
from ncgen.emit.naming import Label, labels
from ncgen.errors import ModelError
from ncgen.exchange.export.package import Package, without_runtime
from ncgen.model.elements import rate_name
from ncgen.model.singular_values import least_squares
from ncgen.program.ir.cost import cost
from ncgen.program.motions.dynamics import accelerations, cheapest
from ncgen.program.motions.state_functions import (
    StateArgument,
    StateFunction,
    StateResult,
    closed_functions,
    open_functions,
    with_derivatives,
)
from ncgen.solver.engines.partition_dynamics import samples, split_of
from ncgen.solver.joints.joint_space import JointsOfTree, joint_space
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.trajectories.output_values import uses_loads

MAX_OPERATIONS = 60_000
"""Operations up to which derivatives are written out."""


class CasadiState:
    """What s and v are, where they start, and what follows from them.

    names, rates: of s and v; places: of those in s that v is the rate of, in the order of v
    """

    def __init__(self, package: Package) -> None:
        kernels, equations = package.kernels, package.kernels.programs.equations
        self.space = _open(package)
        if self.space:
            space = self.space
            self.names, self.rates = space.rates, tuple(map(rate_name, space.rates))
            self.s = space.values(package.q)
            moved = space.velocities(package.q, np.eye(space.n)).T
            self.v = least_squares(moved, package.qd)
            self.places = list(range(space.n))
            self.functions = open_functions(equations, space.followed, space.n)
        else:
            partitions = choose_partitions(kernels, package.q, independent=kernels.model.chosen_independent)
            split, self.places = split_of(partitions.velocity), partitions.position.independent.tolist()
            self.names, self.rates = kernels.coordinates, tuple(rate_name(kernels.coordinates[c]) for c in split.independent)
            self.s, self.v = package.q, package.qd[partitions.velocity.independent]
            ways = accelerations(equations, split, samples(kernels, package.q, kernels.p0), kernels.column_sizes)
            rows = partitions.position.rows.tolist()
            self.functions = closed_functions(equations, ways[cheapest(ways)], rows, len(split.independent))


def _open(package: Package) -> JointsOfTree | None:
    """The joint space of a tree whose joints turn or slide about one axis each, so that their rates are those of their values."""
    try:
        space = joint_space(package.kernels)
    except ModelError:
        return None
    if not isinstance(space, JointsOfTree):
        return None
    simple = all(len(link.screws) <= 1 for link in space.tree.links)
    return space if simple and np.allclose(space.placed(space.values(package.q)), package.q, rtol=0, atol=1e-9) else None


def files(package: Package) -> dict[str, str]:
    """{path in the folder: text}."""
    if uses_loads(package.kernels.model):
        raise ModelError(f"{package.kernels.name} cannot be exported to casadi: its outputs mention loads, and the motion there has none")
    prefix, kernels, state = package.prefix, package.kernels, CasadiState(package)
    functions = [each for function in state.functions for each in with_derivatives(function, MAX_OPERATIONS)]
    count = len(kernels.parameters) - len(kernels.inputs)
    start = {
        "s": state.s.tolist(), "v": state.v.tolist(), "u": kernels.p0[count:].tolist(), "p": kernels.p0[:count].tolist(),
        "places": [float(k) for k in state.places],
    }  # fmt: skip
    records = {
        "prefix": prefix,
        "upper": prefix.upper(),
        "version": __version__,
        "model": kernels.model,
        "is_open": state.space is not None,
        "functions": [_described(function, prefix) for function in functions],
        "operations": {called(f.name, prefix): cost(f.program).total for f in functions},
        "directed": [called(f.name, prefix) for f in functions if f.along],
        "start": [{"name": name, "numbers": [repr(x) for x in values], "sparsity": _full(len(values))} for name, values in start.items()],
        "independent": [state.names[k] for k in state.places],
        "names": _names(package, state, count),
        **program_records([f.program for f in functions], prefix, "casadi"),
    }

    return without_runtime("casadi", "functions", prefix, records, ("README.md", "Makefile"))


def _names(package: Package, state: CasadiState, parameters: int) -> dict[str, list[Label]]:
    """Names in C of what stands in every array."""
    kernels = package.kernels
    listed = {
        "s": state.names, "v": state.rates, "u": kernels.inputs, "p": kernels.parameters[:parameters],
        "y": tuple(kernels.model.outputs), "q": kernels.coordinates,
    }  # fmt: skip
    if state.space is None:
        del listed["q"]
    return {name: labels(words) for name, words in listed.items() if words}


def called(name: str, prefix: str) -> str:
    """A function's name in C: the model's stands behind what CasADi looks for, as in jac_robot_dynamics."""
    return re.sub(r"^((jac_|adj1_)*)", rf"\1{prefix}_", name)


def _described(function: StateFunction, prefix: str) -> dict[str, object]:
    """A function as the template writes it; offset: of a result among all numbers that the program writes."""
    results, offset = [], 0
    for result in function.results:
        results.append({"name": result.name, "offset": offset, "count": len(result.entries), "sparsity": sparsity(result)})
        offset += len(result.entries)
    return {
        "name": called(function.name, prefix),
        "program": function.program.name,
        "inputs": [{"name": a.name, "size": a.size, "is_read": a.is_read, "sparsity": _vector(a)} for a in function.inputs],
        "results": results,
        "size": offset,
        "longest": max((a.size for a in function.inputs if a.is_read), default=0),
        "along": _directions(function) if function.along else None,
    }


def _directions(function: StateFunction) -> dict[str, object]:
    """How a Jacobian is found by directions: how many numbers change, and where every change belongs, −1 for nowhere."""
    along, offset = function.along, 0
    assert along is not None, f"{function.name} is written out"
    offsets: dict[tuple[int, int], int] = {}
    row_start = 0
    read = [a.name for a in along.inputs if a.is_read]
    starts = dict(zip(read, accumulate((a.size for a in along.inputs if a.is_read), initial=0), strict=False))
    results = iter(function.results)
    for result in along.results:
        for argument, block in zip(along.inputs, results, strict=False):
            for row, column in block.places:
                offsets[starts[argument.name] + column, row_start + row] = offset
                offset += 1
        row_start += result.shape[0]
    variables, rows = len(along.variables), row_start
    table = [offsets.get((k, r), -1) for k in range(variables) for r in range(rows)]
    groups = [
        {"name": a.name, "start": starts[a.name], "size": a.size, "blocks": [o * len(along.inputs) + i for o in range(len(along.results))]}
        for i, a in enumerate(along.inputs)
        if a.is_read and a.size
    ]
    return {"variables": variables, "rows": rows, "table": table, "groups": groups}


def sparsity(result: StateResult) -> list[int]:
    """In compressed columns as CasADi has them: rows, columns, where every column begins, row numbers."""
    rows, columns = result.shape
    begins = [sum(column < k for _, column in result.entries) for k in range(columns + 1)]
    return [rows, columns, *begins, *(row for row, _ in result.places)]


def _vector(argument: StateArgument) -> list[int]:
    """Sparsity of an argument: full, or empty where nobody reads it."""
    return _full(argument.size) if argument.is_read else [argument.size, 1, 0, 0]


def _full(size: int) -> list[int]:
    return [size, 1, 0, size, *range(size)]
