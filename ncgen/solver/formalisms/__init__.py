"""Formalisms by name: how accelerations follow from the kernels, and what keeps the constraints closed meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from ncgen.solver.coordinate_partitioning import Motion
from ncgen.solver.formalisms.augmented_lagrangian import augmented_lagrangian, penalty
from ncgen.solver.formalisms.instant import Baumgarte, instant
from ncgen.solver.formalisms.lagrange import lagrange
from ncgen.solver.formalisms.null_space import null_space
from ncgen.solver.formalisms.udwadia_phohomsiri import udwadia_phohomsiri


@dataclass(frozen=True)
class Formalism:
    """A formalism and what a user may set.

    solve: accelerations and multipliers of an `Instant`, without units, given the options of its own; None where the
        formalism is not one of accelerations over all coordinates
    options: what may be set, with defaults: the stabilisation, ω and ξ of Baumgarte's, and the `own` ones that `solve` takes
    ordinary: True if its state derivative can be given to integrators of ordinary differential equations
    """

    name: str
    solve: Callable | None
    options: dict = field(default_factory=dict)
    own: tuple[str, ...] = ()
    ordinary: bool = True

    def motion(self, kernels, q, qd, t, p, options: dict, rows=None) -> Motion:
        """Accelerations, multipliers and power at any position and velocity, from the given rows (default: all).

        Raises SingularError where they are not determined.
        """
        options = {**self.options, **options}
        now = instant(kernels, q, qd, t, p, rows, self.gains(options))
        qdd, lam = now.accelerations(*self.solve(now, **{name: options[name] for name in self.own}))
        power = float(kernels.energy(q, qd, t, p)[2] - kernels.nu(q, t, p) @ lam)
        return Motion(t, q, qd, qdd, lam, power, 0)

    @staticmethod
    def gains(options: dict) -> Baumgarte | None:
        """Baumgarte's terms, if the options ask for them."""
        return Baumgarte(options["omega"], options["xi"]) if options["stabilisation"] == "baumgarte" else None


def _of_accelerations(name: str, solve, stabilisation: str = "projection", ordinary: bool = True, **own) -> Formalism:
    return Formalism(name, solve, {"stabilisation": stabilisation, "omega": 10.0, "xi": 1.0, **own}, tuple(own), ordinary)


FORMALISMS = {
    f.name: f
    for f in (
        Formalism("coordinate-partitioning", None),
        _of_accelerations("null-space", null_space),
        _of_accelerations("lagrange", lagrange),
        _of_accelerations("augmented-lagrangian", augmented_lagrangian, alpha=1e7),
        _of_accelerations("ali3p", lagrange, ordinary=False),
        _of_accelerations("udwadia-phohomsiri", udwadia_phohomsiri),
        _of_accelerations("penalty", penalty, stabilisation="baumgarte", alpha=1e7),
    )
}
"""Every formalism by its name. What ali3p is, its stepper says; accelerations of single instants are Lagrange's."""
