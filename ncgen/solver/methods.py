"""Which formalism goes with which integrator, and what may be set for the two together."""

from __future__ import annotations

from dataclasses import dataclass

from ncgen.errors import ModelError
from ncgen.solver.formalisms import FORMALISMS, Formalism
from ncgen.solver.integrators import INTEGRATORS, OTHER_NAMES, canonical_name
from ncgen.solver.steppers import STEPPERS

STABILISATIONS = ("projection", "baumgarte", "none")


@dataclass(frozen=True)
class Method:
    """A formalism, a SciPy OdeSolver class or a Stepper class, and the options of a run."""

    formalism: Formalism
    integrator: type
    options: dict

    @property
    def is_stepper(self) -> bool:
        return self.integrator in STEPPERS.values()

    @property
    def has_error_control(self) -> bool:
        """False with a fixed step."""
        return not (self.is_stepper or hasattr(self.integrator, "has_fixed_step"))


def find_method(formalism: str, integrator: str, options: dict | None = None) -> Method:
    """The method of two names. Raises ModelError for unknown names and options, and for names that do not go together."""
    if formalism not in FORMALISMS:
        raise ModelError(f"formalism {formalism!r} is unknown; choose one of {', '.join(FORMALISMS)}")
    name = canonical_name(integrator)
    known = list(dict.fromkeys([*INTEGRATORS, *(step for _, step in STEPPERS)]))
    if name not in known:
        raise ModelError(f"integrator {integrator!r} is unknown; choose one of {', '.join([*known, *OTHER_NAMES])}")
    found = FORMALISMS[formalism]
    if name not in partners(found):
        others = [f.name for f in FORMALISMS.values() if name in partners(f)]
        raise ModelError(
            f"{name} does not go with {formalism}: {formalism} goes with {', '.join(partners(found))}; {name} goes with {', '.join(others)}"
        )
    stepper = STEPPERS.get((formalism, name))
    defaults = found.options if stepper is None else stepper.options
    return Method(found, stepper or INTEGRATORS[name], _chosen(f"{formalism} with {name}", defaults, options or {}))


def partners(formalism: Formalism) -> list[str]:
    """Names of the integrators that go with a formalism."""
    ordinary = [name for name, method in INTEGRATORS.items() if formalism.solve is None or not hasattr(method, "keeps_history_to_itself")]
    return [*(ordinary if formalism.ordinary else ()), *(step for form, step in STEPPERS if form == formalism.name)]


def _chosen(name: str, defaults: dict, given: dict) -> dict:
    """The defaults with the user's options in their place."""
    for option, value in given.items():
        if option not in defaults:
            raise ModelError(f"option {option}: {name} has no such option; it has {', '.join(defaults) or 'none'}")
        if option == "stabilisation" and value not in STABILISATIONS:
            raise ModelError(f"stabilisation {value!r} is unknown; choose one of {', '.join(STABILISATIONS)}")
        if isinstance(defaults[option], float) and not (isinstance(value, (int, float)) and 0 <= value < float("inf")):
            raise ModelError(f"option {option}: {value!r} given; it must be a number from 0 on")
    return {**defaults, **given}
