"""How accelerations follow from the kernels, formalism by formalism; what there is and goes together says `ncgen.methods.table`.

A formalism over all coordinates is a module here with a function, both called like it with _ for -: from an `Instant`, without units,
and the options that its arguments name, to accelerations and multipliers.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from typing import Any

import numpy as np

from ncgen.errors import ModelError, SingularError, shown
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.own_formalism import OwnFormalism
from ncgen.methods.table import FORMALISMS, Formalism
from ncgen.model.singular_values import least_squares
from ncgen.solver.formalisms.coordinate_partitioning import Motion
from ncgen.solver.formalisms.instant import Baumgarte, InstantMatrices, instant


@dataclass(frozen=True)
class Accelerations:
    """Accelerations over all coordinates by one formalism.

    entry: of `ncgen.methods.table`; solve: the function of its module, or of a user's object; own: names of the options that it takes
    """

    entry: Formalism
    solve: Callable[..., tuple[np.ndarray, np.ndarray]]
    option_names: tuple[str, ...]

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
        options = {**self.entry.options, **options}
        now = instant(kernels, q, qd, t, p, rows, self.gains(options))
        qdd, lam = now.accelerations(*self.solve(now, **{name: options[name] for name in self.option_names}))
        power = float(kernels.energy(q, qd, t, p)[2] - kernels.nu(q, t, p) @ lam)
        return Motion(t=t, q=q, qd=qd, qdd=qdd, lam=lam, power=power, iterations=0)

    @staticmethod
    def gains(options: dict[str, Any]) -> Baumgarte | None:
        """Baumgarte's terms, if the options ask for them."""
        return Baumgarte(options["omega"], options["xi"]) if options["stabilisation"] == "baumgarte" else None


@cache
def accelerations_by(name: str) -> Accelerations:
    """The accelerations of a formalism of ncgen's over all coordinates."""
    word = name.replace("-", "_")
    solve = getattr(import_module(f"{__name__}.{word}"), word)
    return Accelerations(FORMALISMS[name], solve, tuple(inspect.signature(solve).parameters)[1:])


def accelerations_of(formalism: Formalism) -> Accelerations:
    """The accelerations of an entry over all coordinates, which a user's own object may have made."""
    if formalism.user_object is None:
        return accelerations_by(formalism.name)
    return Accelerations(formalism, partial(solved_by, formalism.user_object), ())


def solved_by(formalism: OwnFormalism, now: InstantMatrices) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations (n,) of the object and multipliers (k,): Φ_qᵀ λ = Q − M q̈. Raises what the object's function raises."""
    for matrix in (now.mass, now.jacobian, now.force, now.gamma):
        matrix.flags.writeable = False  # the multipliers need them as they are
    returned, where = formalism.accelerations(now), f"formalism {shown(formalism.name)}"
    try:
        x = None if np.iscomplexobj(returned) else np.array(returned, dtype=float)
    except (TypeError, ValueError):
        x = None
    if x is None or x.shape != now.force.shape:
        raise ModelError(f"{where}: accelerations returned {shown(returned)}; return {len(now.force)} numbers, one a coordinate")
    if not np.all(np.isfinite(x)):
        raise SingularError(f"{now.kernels.name}: {where} returned accelerations that are not finite")
    return x, least_squares(now.jacobian.T, now.force - now.mass @ x)
