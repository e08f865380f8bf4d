"""Which coordinates and parameters the kernels have, in which order: what is known of a mechanism without any derivation."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from ncgen.model import Model
from ncgen.model.elements import Component
from ncgen.model.values import Parameter

if TYPE_CHECKING:
    from ncgen.symbolic.equations import Equations
    from ncgen.symbolic.term import Term


class Numbering:
    """The numbering of a model's coordinates and parameters.

    released: fixed coordinates that are treated as free, to see what holds them
    """

    model: Model
    released: frozenset[Component]

    @cached_property
    def index(self) -> dict[Component, int]:
        """Position of every free coordinate in the kernels' q."""
        return {c: i for i, c in enumerate(self.free)}

    @cached_property
    def free(self) -> list[Component]:
        return [c for c in self.model.components if self.moves(c)]

    def moves(self, component: Component) -> bool:
        """True if a component is a coordinate of the kernels, False if it is a constant."""
        return not component.fixed or component in self.released

    @cached_property
    def parameters(self) -> list[Parameter]:
        """What stands in the kernels' p: parameters, then inputs."""
        return list(self.model.numbers.values())

    @cached_property
    def parameter_index(self) -> dict[str, int]:
        """{name: its place in p}."""
        return {parameter.name: i for i, parameter in enumerate(self.parameters)}


class Terms(Numbering):
    """The numbering, and the terms that refer to it: rows of constraints, masses, forces, and in words what was omitted."""

    rows: tuple[Term, ...]
    masses: tuple[Term, ...]
    forces: tuple[Term, ...]
    omitted: tuple[str, ...]


class DeferredTerms(Terms):
    """The equations of a model whose programs are at hand: its terms are derived if anybody asks for them."""

    released: frozenset[Component] = frozenset()

    def __init__(self, model: Model) -> None:
        self.model = model

    def __repr__(self) -> str:
        return f"<Equations {self.model.name}: kept from before>"

    def __reduce__(self) -> tuple[type[DeferredTerms], tuple[Model]]:
        """Pickled as its model."""
        return DeferredTerms, (self.model,)

    def __getattr__(self, name: str) -> object:
        if name not in ("rows", "masses", "forces", "omitted"):
            raise AttributeError(name)
        return getattr(self._derived, name)

    @cached_property
    def _derived(self) -> Equations:
        from ncgen.symbolic.equations import build_equations

        return build_equations(self.model)
