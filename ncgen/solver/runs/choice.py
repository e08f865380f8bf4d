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

from ncgen.methods.method import Method
from ncgen.methods.table import FORMALISMS, INTEGRATORS, Formalism, goes_with, options_of
from ncgen.solver.runs.run import EMITTED, Run

EXPLICIT, IMPLICIT = "dop853", "radau"
ALL, INDEPENDENT = "lagrange", "coordinate-partitioning"


@dataclass(frozen=True)
class Choice:
    """A method and why it is taken, in words."""

    method: Method
    why: str


def choose(run: Run) -> Choice:
    """The method that a run begins with."""
    if run.formalism and run.integrator:
        return Choice(Method(run.formalism, run.integrator, options_of(run.formalism, run.integrator, run.options)), "as named")
    formalism, why = (run.formalism, "formalism as named") if run.formalism else _formalism(run)
    if run.integrator:
        return Choice(_method(formalism, run.integrator.name, run), f"{why}; integrator as named")
    name = EXPLICIT if formalism.is_ordinary else next(i.name for i in INTEGRATORS.values() if formalism.name in i.steps)
    return Choice(_method(formalism, name, run), f"{why}; {name} reaches rtol with the fewest evaluations")


def _formalism(run: Run) -> tuple[Formalism, str]:
    """The formalism for what is named, and why."""
    named = run.integrator
    if named and not named.is_ordinary:
        return FORMALISMS[named.steps[0]], f"{named.name} steps the constrained equations"
    if named and named.keeps_history:
        return FORMALISMS[INDEPENDENT], f"the states of {named.name} cannot be corrected"
    if run.engine in EMITTED:
        return FORMALISMS[INDEPENDENT], "what is written out is a state derivative on independent coordinates"
    if run.number != "double":
        return FORMALISMS[INDEPENDENT], f"{run.number}: redundant rows need the digits of double"
    if options := set(run.options) - set(FORMALISMS[ALL].options):
        for formalism in FORMALISMS.values():
            if options <= set(formalism.options) and (named is None or goes_with(formalism, named)):
                return formalism, f"it has the option {sorted(options)[0]}"
    return FORMALISMS[ALL], "all coordinates pass singular positions"


def _method(formalism: Formalism, integrator: str, run: Run) -> Method:
    entry = INTEGRATORS[integrator]
    return Method(formalism, entry, options_of(formalism, entry, run.options))


def stiff_choice(run: Run, present: Choice, recurs: bool) -> Choice | None:
    """What continues where an explicit method takes small steps for stability alone; None where the integrator was named.

    recurs: whether a recursion over a tree of bodies gives the accelerations. Then Newton's steps of Radau IIA take place in its degrees
        of freedom, at the cost of a few evaluations; else on independent coordinates, since over all of them the linear systems are large.
    """
    if not run.promises or run.formalism or run.options or present.method.integrator.name == IMPLICIT:
        return None
    formalism = FORMALISMS[ALL if recurs else INDEPENDENT]
    return Choice(_method(formalism, IMPLICIT, run), f"{present.method.integrator.name} found the mechanism stiff")
