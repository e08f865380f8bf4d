"""A method: a formalism, an integrator, and what was set for the two together."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ncgen.methods import table
from ncgen.methods.table import Formalism, Integrator


@dataclass(frozen=True)
class Method:
    """A formalism and an integrator that go together, with their options; `Method.of` makes one from names."""

    formalism: Formalism
    integrator: Integrator
    options: dict[str, Any] = field(default_factory=dict, hash=False)

    @classmethod
    def of(cls, formalism: str | Formalism, integrator: str, options: dict[str, Any] | None = None) -> Method:
        """The method of two names. Raises ModelError for unknown names and options, and for names that do not go together."""
        pair = table.find_formalism(formalism), table.find_integrator(integrator)
        table.check_pair(*pair)
        return cls(*pair, table.options_of(*pair, options))

    @property
    def is_stepper(self) -> bool:
        """True if the integrator discretises the constrained equations themselves."""
        return table.steps_constraints(self.formalism, self.integrator)

    @property
    def is_constrained(self) -> bool:
        """True where all coordinates are integrated, not the independent ones alone."""
        return self.formalism.is_constrained

    @property
    def has_fixed_step(self) -> bool:
        return self.integrator.has_fixed_step

    def __str__(self) -> str:
        return f"{self.formalism.name} with {self.integrator.name}"
