"""How accelerations follow from the kernels, formalism by formalism; what there is and goes together says `ncgen.methods.table`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.methods.table import FORMALISMS
from ncgen.solver.coordinate_partitioning import Motion
from ncgen.solver.formalisms.augmented_lagrangian import augmented_lagrangian, penalty
from ncgen.solver.formalisms.instant import Baumgarte, instant
from ncgen.solver.formalisms.lagrange import lagrange
from ncgen.solver.formalisms.null_space import null_space
from ncgen.solver.formalisms.udwadia_phohomsiri import udwadia_phohomsiri


@dataclass(frozen=True)
class Accelerations:
    """Accelerations over all coordinates by one formalism.

    name: in `ncgen.methods.table`; solve: accelerations and multipliers of an `Instant`, without units, given the options of its own
    own: names of the options that `solve` takes
    """

    name: str
    solve: Callable[..., tuple[np.ndarray, np.ndarray]]
    own: tuple[str, ...] = ()

    def motion(
        self,
        kernels: Kernels,
        q: np.ndarray,
        qd: np.ndarray,
        t: float,
        p: np.ndarray | None,
        options: dict[str, Any],
        rows: np.ndarray | None = None,
    ) -> Motion:
        """Accelerations, multipliers and power at any position and velocity, from the given rows (default: all).

        Raises SingularError where they are not determined.
        """
        options = {**FORMALISMS[self.name].options, **options}
        now = instant(kernels, q, qd, t, p, rows, self.gains(options))
        qdd, lam = now.accelerations(*self.solve(now, **{name: options[name] for name in self.own}))
        power = float(kernels.energy(q, qd, t, p)[2] - kernels.nu(q, t, p) @ lam)
        return Motion(t, q, qd, qdd, lam, power, 0)

    @staticmethod
    def gains(options: dict[str, Any]) -> Baumgarte | None:
        """Baumgarte's terms, if the options ask for them."""
        return Baumgarte(options["omega"], options["xi"]) if options["stabilisation"] == "baumgarte" else None


ACCELERATIONS = {
    each.name: each
    for each in (
        Accelerations("lagrange", lagrange),
        Accelerations("augmented-lagrangian", augmented_lagrangian, ("alpha",)),
        Accelerations("penalty", penalty, ("alpha",)),
        Accelerations("null-space", null_space),
        Accelerations("udwadia-phohomsiri", udwadia_phohomsiri),
        Accelerations("ali3p", lagrange),
    )
}
"""By the formalism's name. What ali3p is, its stepper says; accelerations of single instants are Lagrange's."""
