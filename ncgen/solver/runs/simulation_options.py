"""A model's own `simulation`: what it can say, and what is wrong with what it says."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ncgen.errors import ModelError
from ncgen.model import Model
from ncgen.solver.groups import DEFAULTS, check_names
from ncgen.solver.runs.run import Run

DURATION = 1.0
"""Seconds that a run takes unless its model or its caller says something else."""

OPTIONS = ("duration", "points", "stop", *DEFAULTS)
"""What a model's own `simulation` can say."""


def check_simulation(model: Model, **more: Any) -> Run:
    """The run that a model's own `simulation` describes, with other options in their place, checked and not carried out.

    Raises ModelError naming the option.
    """
    options = simulation_of(model, **more)
    check_options(options)
    return Run.from_arguments(model, **options)


def refusals(model: Model) -> list[tuple[str | None, str]]:
    """All that is wrong with a model's own `simulation`: (option, message), the option None where none is to blame.

    To blame is the last option without which nothing is wrong, or at least something else.
    """
    options, refused = dict(model.simulation_options), []
    while message := _refusal(model, options):
        without = {name: _refusal(model, {k: v for k, v in options.items() if k != name}) for name in reversed(options)}
        blamed = min((name for name in without if without[name] != message), key=lambda name: without[name] != "", default=None)
        refused.append((blamed, message))
        if blamed is None:
            break
        del options[blamed]
    return refused


def _refusal(model: Model, options: dict[str, Any]) -> str:
    """Why there is no such run, or nothing."""
    try:
        check_options(options)
        arguments: dict[str, Any] = {"duration": DURATION, **options}
        Run.from_arguments(model, **arguments)
    except ModelError as error:
        return str(error)
    return ""


def check_options(options: Iterable[str]) -> None:
    """Raise ModelError for a name that is no option of a run."""
    check_names("m.simulation", options, OPTIONS)


def simulation_of(model: Model, **more: Any) -> dict[str, Any]:
    """Arguments of `ncgen.simulate` for a model: its own, with others in their place where they are not None."""
    return {"duration": DURATION, **model.simulation_options, **{name: value for name, value in more.items() if value is not None}}
