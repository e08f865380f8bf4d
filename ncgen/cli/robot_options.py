"""The options of all commands that read robots' files, as arguments of `ncgen.load`."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any

import typer

from ncgen.cli.terminal import ROBOTS
from ncgen.errors import ModelError

JOINTS: dict[str, tuple[str, bool | str]] = {
    **{word: (word, True) for word in ("limits", "friction", "motors", "sensors")},
    "rigid-limits": ("limits", "rigid"),
    "exact-friction": ("friction", "exact"),
}
"""What a robot's joints have where it is asked for: {word: (argument of `ncgen.load`, its value)}."""

PARAMETERS = ("inertia", "geometry")
"""What becomes parameters of a robot where it is asked for, by the words of `ncgen.load`; else names of links and joints."""

INERTIAS = ("refused", "balanced", "as-given")
"""What becomes of moments of inertia that no body has, by the words of `ncgen.load` with a hyphen for a space."""


def options(
    floating: Annotated[
        bool | None,
        typer.Option(
            "--floating/--fixed",
            help="the base moves freely, or is fixed to the ground [default: as the file says]",
            rich_help_panel=ROBOTS,
        ),
    ] = None,
    having: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            help="take limits, friction, motors or sensors of joints from the file, rigid-limits and exact-friction by events; may be "
            "repeated [default: none of them]",
            autocompletion=lambda: tuple(JOINTS),
            rich_help_panel=ROBOTS,
        ),
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            help="make parameters: inertia of all links, geometry of all joints, or those of a link or joint by its name; may be repeated "
            "[default: numbers]",
            autocompletion=lambda: PARAMETERS,
            rich_help_panel=ROBOTS,
        ),
    ] = None,
    inertias: Annotated[
        str | None,
        typer.Option(
            help="moments of inertia that no body has: refused, balanced or as-given [default: refused]",
            autocompletion=lambda: INERTIAS,
            rich_help_panel=ROBOTS,
        ),
    ] = None,
    loops: Annotated[
        Path | None,
        typer.Option(help="a table of joints that close loops [default: ROBOT.loops.toml next to the file]", rich_help_panel=ROBOTS),
    ] = None,
    frame: Annotated[
        list[str] | None,
        typer.Option(
            help="link, site or frame whose position and rotation become outputs; may be repeated [default: no frame]",
            rich_help_panel=ROBOTS,
        ),
    ] = None,
) -> dict[str, Any]:
    """Return arguments of `ncgen.load`. Raises ModelError naming a word that --with does not know."""
    flags = having or []
    for word in flags:
        if word not in JOINTS:
            raise ModelError(f"--with {word}: a robot can have {', '.join(JOINTS)}")
    choices = {"loops": loops, "inertias": inertias and inertias.replace("-", " "), "parameters": parameters, "frames": frame}
    return {"floating": floating, **dict(JOINTS[word] for word in flags), **{name: value for name, value in choices.items() if value}}


def for_robots(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command that takes `robot`, arguments of `ncgen.load`, as one with the options of robots' files in its place."""
    signature, more = inspect.signature(command, eval_str=True), inspect.signature(options, eval_str=True).parameters

    @wraps(command)
    def with_options(**arguments: Any) -> None:
        return command(robot=options(**{name: arguments.pop(name) for name in more}), **arguments)

    parameters = [each for name, each in signature.parameters.items() if name != "robot"]
    vars(with_options)["__signature__"] = signature.replace(parameters=[*parameters, *more.values()])
    with_options.__annotations__ = {each.name: each.annotation for each in (*parameters, *more.values())}
    del with_options.__wrapped__
    return with_options
