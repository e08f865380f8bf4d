"""Which method carries a run out, where the caller leaves it open, and what comes next where it cannot go on.

All coordinates with Lagrange's multipliers and DOP853 are the first choice. Accelerations come from a recursion over the tree of bodies
that is emitted, or from the matrix of the equations, which is sparse and is factored by a plan made once, so that the cost grows
with the mechanism and not with the square of its degrees of freedom; redundant rows, rolling and singular positions need no special case.
`ncgen hard` and `ncgen bench --precision` compare it with the others. Coordinate partitioning is taken where all coordinates cannot
serve: for a state derivative that is asked for by name, and in number types with few digits, in which redundant rows cannot be told from
others. Stiff mechanisms go on with Radau IIA: over all coordinates where a recursion gives the accelerations, since its Newton steps then
take place in the degrees of freedom, else on independent coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from ncgen.methods.method import Method
from ncgen.methods.table import FORMALISMS, INTEGRATORS, Formalism, goes_with, options_of
from ncgen.solver.runs.settings import CACHED, EMITTED, Settings

EXPLICIT, IMPLICIT = "dop853", "radau"
ALL, INDEPENDENT = "lagrange", "coordinate-partitioning"


@dataclass(frozen=True, eq=False)
class Choice:
    """A method and why it is taken, in words."""

    method: Method
    why: str


@lru_cache(maxsize=CACHED)
def choose(settings: Settings) -> Choice:
    """The method that a run begins with."""
    if settings.formalism and settings.integrator:
        return Choice(_method(settings.formalism, settings.integrator.name, settings), "as named")
    formalism, why = (settings.formalism, "formalism as named") if settings.formalism else _formalism(settings)
    if settings.integrator:
        return Choice(_method(formalism, settings.integrator.name, settings), f"{why}; integrator as named")
    name = EXPLICIT if formalism.is_ordinary else next(i.name for i in INTEGRATORS.values() if formalism.name in i.steps)
    return Choice(_method(formalism, name, settings), f"{why}; {name} reaches rtol with the fewest evaluations")


def _formalism(settings: Settings) -> tuple[Formalism, str]:
    """The formalism for what is named, and why."""
    named = settings.integrator
    if named and not named.is_ordinary:
        return FORMALISMS[named.steps[0]], f"{named.name} steps the constrained equations"
    if named and named.keeps_history:
        return FORMALISMS[INDEPENDENT], f"the states of {named.name} cannot be corrected"
    if settings.engine in EMITTED:
        return FORMALISMS[INDEPENDENT], "what is written out is a state derivative on independent coordinates"
    if settings.number != "double":
        return FORMALISMS[INDEPENDENT], f"{settings.number}: redundant rows need the digits of double"
    if options := set(settings.options) - set(FORMALISMS[ALL].options):
        for formalism in FORMALISMS.values():
            if options <= set(formalism.options) and (named is None or goes_with(formalism, named)):
                return formalism, f"it has the option {sorted(options)[0]}"
    return FORMALISMS[ALL], "all coordinates pass singular positions"


def _method(formalism: Formalism, integrator: str, settings: Settings) -> Method:
    entry = INTEGRATORS[integrator]
    return Method(formalism, entry, options_of(formalism, entry, settings.options))


@lru_cache(maxsize=CACHED)
def stiff_choice(settings: Settings, present: Choice, recurs: bool) -> Choice | None:
    """What continues where an explicit method takes small steps for stability alone; None where the integrator was named.

    recurs: whether a recursion over a tree of bodies gives the accelerations. Then Newton's steps of Radau IIA take place in its degrees
        of freedom, at the cost of a few evaluations; else on independent coordinates, since over all of them the linear systems are large.
    """
    if settings.integrator or settings.formalism or settings.options or present.method.integrator.name == IMPLICIT:
        return None
    formalism = FORMALISMS[ALL if recurs else INDEPENDENT]
    return Choice(_method(formalism, IMPLICIT, settings), f"{present.method.integrator.name} found the mechanism stiff")
