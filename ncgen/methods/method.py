"""A method: a formalism, an integrator, and what was set for the two together."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from ncgen.methods import table
from ncgen.methods.newmark import newmark
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

    @cached_property
    def has_fixed_step(self) -> bool:
        return self.integrator.has_fixed_step

    @cached_property
    def in_c(self) -> dict[str, float]:
        """Its members of `ncgen_options` where all coordinates are integrated; nobody writes to them."""
        return {"formalism": table.number_in_c(self.formalism), **settings_in_c(self.options), **_weights(self.options)}

    def __str__(self) -> str:
        return f"{self.formalism.name} with {self.integrator.name}"


def settings_in_c(settings: dict[str, Any]) -> dict[str, float]:
    """The options of a formalism over all coordinates, or of energy-momentum or ali3p, by the names of `ncgen_options`."""
    stabilisation = settings.get("stabilisation")
    projected = stabilisation == "projection" or settings.get("project_velocities", False)
    frequency = settings["omega"] if stabilisation == "baumgarte" else 0.0
    return {"project": int(projected), "penalty": settings.get("alpha", 0.0), "damping": settings.get("xi", 0.0), "frequency": frequency}


def _weights(settings: dict[str, Any]) -> dict[str, float]:
    """Of generalised-α, by the names of `ncgen_options`."""
    if "rho" not in settings:
        return {}
    return dict(zip(("alpha_m", "alpha_f"), newmark(settings["rho"], settings["hht"]), strict=False))
