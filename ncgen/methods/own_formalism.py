"""A formalism of the user's own: an object with a name and a function `accelerations`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from ncgen.errors import ModelError, shown

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class OwnFormalism(Protocol):
    """What `formalism=` of `ncgen.simulate` takes besides names.

    name: for messages and for `Trajectory.formalism`; none of ncgen's
    """

    name: str

    def accelerations(self, now: Any, /) -> ArrayLike:
        """Accelerations (n,) from the matrices at one instant, all without units.

        now.mass (n, n), now.jacobian (k, n), now.force (n,), now.gamma (k,): M, Φ_q, Q and γ of M q̈ + Φ_qᵀ λ = Q and Φ_q q̈ = γ, with
        the k constraints that are in use. Lengths are measured in the mechanism's size, inertia in its largest entry.
        """
        ...


def is_own(formalism: object) -> bool:
    """True for an object that is meant as a formalism, right or wrong."""
    return not isinstance(formalism, str) and (callable(formalism) or hasattr(formalism, "accelerations") or hasattr(formalism, "name"))


def check_own(formalism: Any, taken: tuple[str, ...]) -> None:
    """Raise ModelError unless an object is a formalism. taken: names that it cannot have"""
    if isinstance(formalism, type):
        raise ModelError(f"formalism: {formalism.__name__} is a class; give an object of it, such as {formalism.__name__}()")
    if not callable(getattr(formalism, "accelerations", None)):
        raise ModelError(f"formalism: {shown(formalism)} has no function accelerations; give an object with one and a name")
    name = getattr(formalism, "name", None)
    if not isinstance(name, str) or not name.isprintable() or not name.strip():
        raise ModelError(f"formalism: the name of the object is {shown(name)}; it must be a text of one line")
    if name in taken:
        raise ModelError(f"formalism: the name of the object is {shown(name)}, which ncgen has, too; choose another name")
