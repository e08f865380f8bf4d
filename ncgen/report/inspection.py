"""Facts about a mechanism: what `ncgen inspect` shows, as plain data."""

from __future__ import annotations

from ncgen.exchange.robots.accounting import changes_motion, parted
from ncgen.mechanism.kernels import Kernels
from ncgen.model.elements import Angle
from ncgen.program.ir.cost import cost
from ncgen.program.programs import Programs
from ncgen.solver.positions.rank import Freedom, Redundancy, freedom
from ncgen.symbolic.tree import Tree, spanning_tree


def inspect(kernels: Kernels, mobility: Freedom | None = None) -> dict:
    """Describe a mechanism and its generated code in one record, ready for JSON.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    mobility : Freedom, optional
        Degrees of freedom, if they are known already.

    Returns
    -------
    dict
        Keys: name; coordinates, free, rows: counts; rank, dof; redundant: [{row, label, owner, implied_by, coefficients}] with
        rows counted from 1; measured: how many constraints have their lengths and angles from the initial position; singular:
        whether the initial position is; initial: {angle: rad}; left_out: [{what, count, changes_motion}] of a robot's file, which
        the model does not have; assembled: [{joint, moved, unit}] of a robot whose loops were closed when it was read; omitted:
        [text] of what the generator simplified away; kernels: {name: {operations, calls, nonzeros, size, bytes}}; parameters:
        {name: default}; tree: [{body, on, dof}], from the ground outward; joints: [{kind, bodies, elements}];
        drivers: {coordinate: law}.
    """
    mobility = mobility or freedom(kernels)
    model = kernels.model
    return {
        "name": kernels.name,
        "coordinates": len(model.components),
        "free_coordinates": kernels.n,
        "constraints": kernels.m,
        "rank": mobility.rank,
        "dof": mobility.dof,
        "redundant": [_redundant(kernels, r) for r in mobility.redundant],
        "singular": mobility.is_singular,
        "measured_constraints": sum(row.measured for row in kernels.rows),
        "left_out": [
            {"feature": feature, "count": count, "changes_motion": changes_motion(sentence)}
            for sentence in model.left_out
            for feature, count in (parted(sentence),)
        ],
        "assembled": [{"joint": name, "moved": moved, "unit": unit} for name, moved, unit in model.assembled],
        "simplified": list(kernels.programs.omitted),
        "initial_angles": {e.name: float(e.initial[0]) for e in model.elements.values() if isinstance(e, Angle)},
        "kernels": _kernels(kernels.programs),
        "tree": _tree(spanning_tree(model)),
        "joints": [{"kind": j.kind, "bodies": list(j.bodies), "elements": list(j.elements)} for j in model.joints],
        "drivers": {driver.coordinate: str(driver.law) for driver in model.drivers},
        "parameters": {p.name: p.default for p in model.parameters.values()},
        "emission": kernels.programs.emission,
        "backend": kernels.backend,
    }


def _tree(tree: Tree) -> list[dict]:
    return [
        {"body": link.body.name, "parent": "ground" if link.parent is None else tree.links[link.parent].body.name, "dof": len(link.screws)}
        for link in tree.links
    ]


def _redundant(kernels: Kernels, redundancy: Redundancy) -> dict:
    row = kernels.rows[redundancy.row]
    return {
        "constraint": redundancy.row + 1,
        "label": row.label,
        "owner": str(row.owner),
        "implied_by": [i + 1 for i in redundancy.implied_by],
        "coefficients": list(redundancy.implied_by.values()),
    }


def _kernels(programs: Programs) -> dict[str, dict]:
    records = {}
    for name, program in programs.programs.items():
        counted = cost(program)
        records[name] = {
            "operations": counted.total,
            "calls": counted.calls,
            "nonzeros": program.size,
            "bytes": counted.read + counted.written,
            "constant": program.is_constant,
        }
    return records
