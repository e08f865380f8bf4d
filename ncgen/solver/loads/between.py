"""What one body does to another: the part of a body's loads that comes through the elements both share and through rows between them.

A row is no body's: what it does to an element of one body alone is that body's load, −λ ∂Φ/∂e, and fixed elements are loaded like others.
Who is on its other side its joint or its elements tell; the ground is where the forces and moments on them do not cancel.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ModelError
from ncgen.model.bodies import Body
from ncgen.model.elements import Angle, Combination, Point, Spatial, Vector
from ncgen.model.rows import Owner
from ncgen.solver import geometry
from ncgen.solver.loads.sharing import Released
from ncgen.symbolic.equations import build_bonds

if TYPE_CHECKING:
    from ncgen.model.model import Model
    from ncgen.solver.trajectories.trajectory import Trajectory

BALANCED = 1e-9
"""Forces and moments of a row that cancel to this part of their size need no ground."""

FORCE_ROUNDING = 1e-11
"""Forces below this part of the largest load on a body are rounding."""


@dataclass(frozen=True, eq=False)
class RowLoad:
    """What a row does to points and vectors: {element: (K, 3)} generalised forces, those of fixed elements among them.

    bodies: the two that it is between, where that is known; needs_ground: the forces do not cancel
    """

    label: str
    bodies: tuple[str, ...]
    forces: dict[Spatial, np.ndarray]
    needs_ground: bool


def row_loads(run: Trajectory, largest: float, between: Mapping[str, tuple[str, str]]) -> list[RowLoad]:
    """The loads of all rows that no body owns; rows between coordinates alone have none.

    largest: load on any body, to which rounding is compared; between: the two bodies of rows that do not say it, by labels
    """
    model, bonds = run.model, Released(run, build_bonds(run.model))
    columns_of = {
        element: [bonds.kernels.index[c.name] for c in element.components]
        for element in model.elements.values()
        if isinstance(element, Spatial)
    }
    numbers = [i for i, row in enumerate(model.rows) if row.owner.kind != "body"]
    history = np.zeros((len(run.t), len(numbers), bonds.kernels.n))
    for k, (t, q, lam) in enumerate(zip(run.t, run.q, run.lam, strict=True)):
        derivatives = bonds.kernels.phi_q(bonds.position(q), t, run.kernels.present(t, run.p))[numbers]
        history[k] = -lam[numbers, None] * derivatives.toarray()
    at = {element: geometry.element(run.kernels, element, run.q, run.p) for element in columns_of}
    loads_of_rows = []
    for i, number in enumerate(numbers):
        forces = {}
        for element, columns in columns_of.items():
            force = history[:, i, columns]
            felt = np.cross(at[element], force) if isinstance(element, Vector) else force
            if np.max(np.abs(felt), initial=0.0) > FORCE_ROUNDING * largest:
                forces[element] = force
        if forces:
            row, needs_ground = model.rows[number], _needs_ground(forces, at)
            pair = between.get(row.label) or _bodies_by_label(model, row.owner) or _covering(model, row.owner, forces, needs_ground)
            loads_of_rows.append(RowLoad(row.label, pair, forces, needs_ground))
    return loads_of_rows


def body_of(model: Model, direction: Combination) -> str | None:
    """The one body that has all elements of a direction; the ground where all are fixed."""
    elements = [element for _, element in direction.terms]
    if all(element.fixed for element in elements):
        return model.ground.name
    having = [name for name, body in model.bodies.items() if all(element in body.elements for element in elements)]
    return having[0] if len(having) == 1 else None


def _bodies_by_label(model: Model, owner: Owner) -> tuple[str, ...]:
    """The two bodies that a row is between, where its joint or its angle says it."""
    if isinstance(angle := model.elements.get(owner.name), Angle):
        ends = body_of(model, angle.start), body_of(model, angle.end)
        return (ends[0], ends[1]) if ends[0] and ends[1] and ends[0] != ends[1] else ()
    return owner.bodies if len(owner.bodies) == 2 else ()


def _covering(model: Model, owner: Owner, forces: Iterable[Spatial], needs_ground: bool) -> tuple[str, ...]:
    """The only two bodies that have all elements of a row between them; what is fixed is the ground's where that leaves a choice."""
    ground = model.ground.name
    having = [_owners(model.bodies, element, ground) for element in forces]
    names = sorted({ground}.union(*having)) if needs_ground else sorted(set().union(*having))
    needed = {*owner.bodies, *([ground] if needs_ground else [])}
    pairs = [pair for pair in combinations(names, 2) if needed <= set(pair) and all(each & set(pair) for each in having)]
    if not needs_ground and set.intersection(*having):
        return ()  # a body's own
    return next((chosen[0] for chosen in (pairs, [pair for pair in pairs if ground in pair]) if len(chosen) == 1), ())


def _needs_ground(forces: dict[Spatial, np.ndarray], at: dict[Spatial, np.ndarray]) -> bool:
    arms = {e: np.cross(at[e], f) for e, f in forces.items()}
    for parts in ([f for e, f in forces.items() if isinstance(e, Point)], list(arms.values())):
        if parts and np.max(np.abs(sum(parts))) > BALANCED * max(np.max(np.abs(force)) for force in parts):
            return True
    return False


def loads_between(
    rows: list[RowLoad],
    loads: Mapping[str, np.ndarray],
    bodies: Mapping[str, Body],
    ground: str,
    body: str,
    neighbour: str,
    meet: bool = False,
) -> list[tuple[Spatial, np.ndarray]]:
    """What a body feels of its neighbour: (element, (K, 3) generalised force) for every element of it that they act through.

    loads: {coordinate: (K,)} of the body; meet: whether they have something else in common
    Raises ModelError where both have nothing in common, or where a third one has a part in it that cannot be told from theirs.
    """
    own_elements = bodies[body].elements
    shared = [e for e in own_elements if (e.fixed if neighbour == ground else e in bodies[neighbour].elements)]
    for element in shared:
        if third := sorted(_owners(bodies, element, ground) - {body, neighbour}):
            raise _unknown(element.name, body, neighbour, third[0])
    felt: list[tuple[Spatial, np.ndarray]] = [(e, np.stack([loads[c.name] for c in e.components], axis=-1)) for e in shared]
    for row in rows:
        elements = [e for e in row.forces if body in _bearers(row, bodies, e, ground)]
        if not elements:
            continue
        partners, unsure = _partners(row, bodies, ground, body), [e for e in elements if len(_bearers(row, bodies, e, ground)) > 1]
        if neighbour not in partners:
            if any(e in shared for e in unsure):
                raise _unknown(row.label, body, neighbour, min(partners))
            felt += [(e, -row.forces[e]) for e in elements if e in shared]  # that comes from another one
            continue
        if len(partners) > 1:
            raise _unknown(row.label, body, neighbour, min(partners - {neighbour}))
        if held := [e for e in unsure if e not in shared]:
            raise _unknown(f"{row.label} ({held[0].name})", body, neighbour, min(_bearers(row, bodies, held[0], ground) - {body}))
        felt += [(e, row.forces[e]) for e in elements if e not in shared]
    if not (felt or meet):
        raise ModelError(f"body {body} shares no point and no vector with {neighbour}, and no constraint connects them")
    return felt


def _owners(bodies: Mapping[str, Body], element: Spatial, ground: str) -> set[str]:
    return {name for name, body in bodies.items() if element in body.elements} | ({ground} if element.fixed else set())


def _bearers(row: RowLoad, bodies: Mapping[str, Body], element: Spatial, ground: str) -> set[str]:
    """The bodies that a row's force on an element may act on: those of the two that it is between, where they have the element."""
    having = _owners(bodies, element, ground)
    return having & set(row.bodies) or ({ground} if element.fixed else having)


def _partners(row: RowLoad, bodies: Mapping[str, Body], ground: str, body: str) -> set[str]:
    """Who is on the other side of a row that acts on a body."""
    if body in row.bodies:
        return set(row.bodies) - {body}
    opposite = {name for e in row.forces if body not in _bearers(row, bodies, e, ground) for name in _bearers(row, bodies, e, ground)}
    opposite |= {ground} if row.needs_ground else set()
    return opposite or {name for e in row.forces for name in _bearers(row, bodies, e, ground)} - {body}


def _unknown(label: str, body: str, neighbour: str, third: str) -> ModelError:
    return ModelError(
        f"{label} joins {body} and {neighbour} with {third}, too, so the wrench between two of them is not known; "
        "leave neighbour out for that of all joints"
    )
