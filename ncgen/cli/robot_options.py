"""The options of all commands that read robots' files, as arguments of `ncgen.load`."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any

import typer

from ncgen.errors import ModelError

JOINTS = ("limits", "friction", "motors", "sensors")
"""What a robot's joints have where it is asked for, by the names of `ncgen.load`."""

PARAMETERS = ("inertia", "geometry")
"""What becomes parameters of a robot where it is asked for, by the words of `ncgen.load`; else names of links and joints."""

INERTIAS = ("refused", "balanced", "as given")
"""What becomes of moments of inertia that no body has, by the words of `ncgen.load`."""


def options(
    floating: Annotated[
        bool | None, typer.Option("--floating/--fixed", help="a robot's base moves freely, or is ground [default: its file's]")
    ] = None,
    having: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            help="limits, friction, motors or sensors of a robot as its file says; may be repeated",
            autocompletion=lambda: JOINTS,
        ),
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            help="what of a robot becomes parameters: inertia, geometry, or a link or joint by its name; may be repeated",
            autocompletion=lambda: PARAMETERS,
        ),
    ] = None,
    inertias: Annotated[
        str | None,
        typer.Option(
            help='moments of inertia that no body has: refused, balanced or "as given" [default: refused]', autocompletion=lambda: INERTIAS
        ),
    ] = None,
    loops: Annotated[
        Path | None, typer.Option(help="a table of what closes a robot's loops [default: ROBOT.loops.toml next to its file]")
    ] = None,
    frame: Annotated[
        list[str] | None,
        typer.Option(help="link, site or frame of a robot's file whose position and rotation are outputs; may be repeated"),
    ] = None,
) -> dict[str, Any]:
    """Arguments of `ncgen.load`. Raises ModelError naming a word that --with does not know."""
    asked = having or []
    for word in asked:
        if word not in JOINTS:
            raise ModelError(f"--with {word}: a robot can have {', '.join(JOINTS)}")
    said = {"loops": loops, "inertias": inertias and inertias.replace("-", " "), "parameters": parameters, "frames": frame}
    return {"floating": floating, **dict.fromkeys(asked, True), **{name: value for name, value in said.items() if value}}


def for_robots(command: Callable[..., None]) -> Callable[..., None]:
    """A command that takes `robot`, arguments of `ncgen.load`, as one with the options of robots' files in its place."""
    signature, more = inspect.signature(command, eval_str=True), inspect.signature(options, eval_str=True).parameters

    @wraps(command)
    def with_options(**given: Any) -> None:
        return command(robot=options(**{name: given.pop(name) for name in more}), **given)

    own = [each for name, each in signature.parameters.items() if name != "robot"]
    vars(with_options)["__signature__"] = signature.replace(parameters=[*own, *more.values()])
    with_options.__annotations__ = {each.name: each.annotation for each in (*own, *more.values())}
    del with_options.__wrapped__
    return with_options
