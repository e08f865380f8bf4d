"""Formalisms by name: how accelerations follow from the kernels, and what keeps the constraints closed meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from ncgen.errors import ModelError
from ncgen.solver.coordinate_partitioning import Motion
from ncgen.solver.formalisms.augmented_lagrangian import augmented_lagrangian, penalty
from ncgen.solver.formalisms.instant import Baumgarte, instant
from ncgen.solver.formalisms.lagrange import lagrange
from ncgen.solver.formalisms.null_space import null_space
from ncgen.solver.formalisms.udwadia_phohomsiri import udwadia_phohomsiri
from ncgen.solver.integrators import INTEGRATORS

STABILISATIONS = ("projection", "baumgarte", "none")


@dataclass(frozen=True)
class Formalism:
    """A formalism and what a user may set.

    solve: accelerations and multipliers of an `Instant`, without units, given the options of its own; None where the
        formalism is not one of accelerations over all coordinates
    integrators: names of those it goes with
    stabilisation: what keeps the constraints closed unless the user says otherwise
    own: names of the options that `solve` takes
    """

    name: str
    solve: Callable | None
    integrators: tuple[str, ...]
    stabilisation: str | None = "projection"
    own: tuple[str, ...] = ()
    options: dict = field(default_factory=dict)

    def motion(self, kernels, q, qd, t, p, options: dict, rows=None) -> Motion:
        """Accelerations, multipliers and power at any position and velocity, from the given rows (default: all).

        Raises SingularError where they are not determined.
        """
        gains = Baumgarte(options["omega"], options["xi"]) if options["stabilisation"] == "baumgarte" else None
        now = instant(kernels, q, qd, t, p, rows, gains)
        qdd, lam = now.accelerations(*self.solve(now, **{name: options[name] for name in self.own}))
        power = float(kernels.energy(q, qd, t, p)[2] - kernels.nu(q, t, p) @ lam)
        return Motion(t, q, qd, qdd, lam, power, 0)


def _of_accelerations(name: str, solve, integrators: tuple[str, ...] = (), stabilisation: str = "projection", **own) -> Formalism:
    options = {"stabilisation": stabilisation, "omega": 10.0, "xi": 1.0, **own}
    return Formalism(name, solve, (*INTEGRATORS, *integrators), stabilisation, tuple(own), options)


FORMALISMS = {
    f.name: f
    for f in (
        Formalism("coordinate-partitioning", None, tuple(INTEGRATORS), None),
        _of_accelerations("null-space", null_space),
        _of_accelerations("lagrange", lagrange),
        _of_accelerations("augmented-lagrangian", augmented_lagrangian, alpha=1e7),
        _of_accelerations("udwadia-phohomsiri", udwadia_phohomsiri),
        _of_accelerations("penalty", penalty, stabilisation="baumgarte", alpha=1e7),
    )
}
"""Every formalism by its name."""


def find_formalism(name: str, integrator: str) -> Formalism:
    """The formalism of a name. Raises ModelError for an unknown one, or where the integrator does not go with it."""
    if name not in FORMALISMS:
        raise ModelError(f"formalism {name!r} is unknown; choose one of {', '.join(FORMALISMS)}")
    found = FORMALISMS[name]
    if integrator not in found.integrators:
        others = [f.name for f in FORMALISMS.values() if integrator in f.integrators]
        raise ModelError(
            f"{integrator} does not go with {name}: {name} goes with {', '.join(found.integrators)}; {integrator} goes with {', '.join(others)}"
        )
    return found


def chosen_options(formalism: Formalism, known: dict, given: dict | None) -> dict:
    """The options of a run: defaults with the user's in their place. Raises ModelError naming what is unknown or wrong."""
    given = given or {}
    for name, value in given.items():
        if name not in known:
            has = f"it has {', '.join(known)}" if known else "it has none"
            raise ModelError(f"option {name}: {formalism.name} has no such option here; {has}")
        if name == "stabilisation" and value not in STABILISATIONS:
            raise ModelError(f"stabilisation {value!r} is unknown; choose one of {', '.join(STABILISATIONS)}")
        if isinstance(known[name], float) and not (isinstance(value, (int, float)) and 0 <= value < float("inf")):
            raise ModelError(f"option {name}: {value!r} given; it must be a number from 0 on")
    return {**known, **given}
