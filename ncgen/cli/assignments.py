"""Numbers by name as they are typed: `k=3`."""

from __future__ import annotations

from typing import Any

from ncgen.errors import ModelError, shortened
from ncgen.model import Model


def assigned(option: str, typed: str | list[str] | None, word: str = "") -> dict[str, Any] | None:
    """{name: number}, or None where nothing was typed.

    word: one that may follow a number, as `psi=1.2,rising`, for messages; the value is then (number, word)
    Raises ModelError naming the option for another form, and for a name that comes twice.
    """
    values: dict[str, Any] = {}
    for text in [typed] if isinstance(typed, str) else typed or ():
        name, _, value = text.rpartition("=")
        number, comma, behind = value.partition(",") if word else (value, "", "")
        try:
            parsed = float(number)
        except ValueError:
            name, parsed = "", 0.0
        if not name:
            also = f" or psi1=2.5,{word}" if word else ""
            raise ModelError(f"{option} {shortened(text)}: write it as name=number, for example psi1=2.5{also}")
        if name in values:
            raise ModelError(f"{option} {shortened(text)}: {name} is given twice; give it once")
        values[name] = (parsed, behind) if comma else parsed
    return values or None


def with_model_parameters(model: Model, typed: dict[str, float] | None) -> dict[str, float] | None:
    """Parameters as they were typed, and those of the model's own simulation that were not; None where nothing was typed.

    Raises ModelError where its own are not numbers.
    """
    from ncgen.solver.argument_checks import parameters
    from ncgen.solver.runs.run import outline

    defaults: Any = model.simulation_options.get("p")
    if not typed or defaults is None:
        return typed
    return dict(zip(model.numbers, parameters(outline(model), defaults).tolist())) | typed
