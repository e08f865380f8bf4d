"""What the events of a mechanism do as rows of a table (`ncgen_event_table.h`), for C."""

from __future__ import annotations

from dataclasses import dataclass

from ncgen.errors import ModelError
from ncgen.mechanism.impacts_in_c import LAWS
from ncgen.mechanism.kernels import Kernels
from ncgen.model.actions import Change, Impact, Stop
from ncgen.model.elements import coordinate_of
from ncgen.model.values import Scalar
from ncgen.solver.events.conditions import VALUE_ROUNDING, most_degree
from ncgen.solver.name_lists import listed_names


@dataclass(frozen=True)
class ActionRow:
    """One action, with the members of `ncgen_action`."""

    event: int
    kind: str
    index: int = 0
    value: int = 0


@dataclass(frozen=True, eq=False, kw_only=True)
class Actions:
    """rows: in the order of the events; values: what their values are, each with the words that messages call it by; law: of several
    impacts; most: velocities that one event sets, or the number of events if that is more"""

    rows: list[ActionRow]
    values: list[tuple[str, Scalar]]
    law: str
    most: int
    degree: int
    noise: float

    @classmethod
    def of(cls, kernels: Kernels) -> Actions:
        """Those of a mechanism. Raises ModelError where impacts name different laws."""
        events = tuple(kernels.model.events.values())
        rows: list[ActionRow] = []
        values: list[tuple[str, Scalar]] = []

        def value(where: str, expression: Scalar) -> int:
            values.append((where, expression))
            return len(values) - 1

        for k, event in enumerate(events):
            where = f"event {event.name}"
            changes = {name: value for action in event.do if isinstance(action, Change) for name, value in action.values.items()}
            velocities = {name for name in changes if name not in kernels.parameters}
            impacts = [action for action in event.do if isinstance(action, Impact)]
            rows += [ActionRow(k, "NCGEN_IMPACT", int(a.rest == "end"), value(where, a.restitution)) for a in impacts]  # type: ignore[arg-type]
            for name in sorted(changes, key=lambda name: name in velocities):
                index = kernels.index[coordinate_of(name)] if name in velocities else kernels.parameters.index(name)
                kind = "NCGEN_SET_VELOCITY" if name in velocities else "NCGEN_SET"
                rows.append(ActionRow(k, kind, index, value(f"{where}, {name}", changes[name])))
            rows += [ActionRow(k, "NCGEN_STOP") for action in event.do if isinstance(action, Stop)]
        set_velocities = [row.event for row in rows if row.kind == "NCGEN_SET_VELOCITY"]
        most = max([len(events), *(set_velocities.count(k) for k in range(len(events)))])
        degree = most_degree(kernels)
        return cls(rows=rows, values=values, law=_law(kernels), most=most, degree=degree, noise=VALUE_ROUNDING[degree])

    def changed(self, kernels: Kernels) -> frozenset[str]:
        """Names of the parameters and inputs that events change."""
        return frozenset(kernels.parameters[row.index] for row in self.rows if row.kind == "NCGEN_SET")


def _law(kernels: Kernels) -> str:
    """Of several impacts at one instant. Raises ModelError where events name different ones."""
    named = {event.name: event.impact.order for event in kernels.model.events.values() if event.impact and event.impact.order}
    if len(laws := set(named.values())) > 1:
        raise ModelError(
            f"{kernels.name}: impacts of {listed_names(list(named))} have different orders; an export needs the same one for all"
        )
    return LAWS[laws.pop() if laws else ""]
