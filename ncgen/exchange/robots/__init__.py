"""Robots from files: links and joints are read into a `Robot`, and that becomes a model in natural coordinates.

A format is a module with a function from the file's root element to a `Robot`; the root's tag tells which one it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.balance import remedy
from ncgen.exchange.robots.markup import XACRO, read_markup
from ncgen.exchange.robots.robot import Robot, together
from ncgen.exchange.text import as_path
from ncgen.model import Model
from ncgen.model.bodies import check_inertia
from ncgen.toolchain.undisturbed import undisturbed

SUFFIXES = (".urdf", ".sdf", ".xml", ".mjcf", XACRO)

FORMATS = {"robot": "urdf", "sdf": "sdf", "mujoco": "mjcf"}
"""{tag of the root element: module}."""

TAGS_WITH_ALL_PROBLEMS = ("robot", "sdf")
"""Tags of formats that tell all problems of links and joints; MuJoCo tells the first one."""

WRITERS = {".urdf": "urdf", ".sdf": "sdf_written", ".xml": "mjcf_written", ".mjcf": "mjcf_written"}
"""{how a file's name ends: module} of formats that are written, too."""

WRITERS_WITH_LOOPS = ("sdf_written", "mjcf_written")
"""Modules of formats that say loops."""


def read_robot(path: Path) -> Robot:
    """The robot of a file, its joints ordered from the root outward. Raises ModelError with file and line."""
    root = read_markup(path)
    if root.tag not in FORMATS:
        root.refuse(f"<{root.tag}> begins no robot; a file begins with {' or '.join(f'<{tag}>' for tag in FORMATS)}")
    return import_module(f"ncgen.exchange.robots.{FORMATS[root.tag]}").robot_of(root, path)


def problems_of(path: Path) -> list[str]:
    """All that is wrong with links and joints of a robot's file, one line each: of URDF and SDF; else the first problem is raised."""
    root = read_markup(path)
    if root.tag in TAGS_WITH_ALL_PROBLEMS:
        problems = import_module(f"ncgen.exchange.robots.{FORMATS[root.tag]}").problems_of(root, path)
        if problems:
            return problems
    return _impossible(read_robot(path))


def _impossible(robot: Robot) -> list[str]:
    """Links, with what is fixed to them, whose inertia no body has."""
    problems = []
    for link in together(robot).links.values():
        try:
            if link.mass is not None:
                check_inertia(link.name, link.mass.mass, link.mass.com, link.mass.tensor)
        except ModelError as error:
            problems.append(f"{link.where}: {error}{remedy(link)}")
    return problems


def load_robot(
    path: Path,
    floating: bool | None = None,
    limits: bool | str = False,
    friction: bool | str = False,
    loops: str | Path | None = None,
    motors: bool = False,
    sensors: bool = False,
    inertias: str = "refused",
    parameters: str | Sequence[str] = (),
    stacklevel: int = 1,
) -> Model:
    """The model of a robot's file. Warns, in one line, of how many things that change the motion it does not have.

    floating: the root is a free body; None for what the file says
    limits, friction: of joints, as springs and couples, or "rigid" and "exact" as elements of events; else they are left out
    motors, sensors: inputs for actuators of the file, or for joints; outputs for its sensors; else they are left out
    loops: a file that says loops (`ncgen.exchange.robots.loops`); None for ROBOT.loops.toml next to the robot's file, if there is one
    inertias: "refused", "balanced" or "as given" where no body has them
    parameters: "inertia", "geometry", or names of links and joints, whose numbers become parameters
    stacklevel: of warnings, 1 for who calls this
    Raises ModelError with file and line.
    """
    with undisturbed():
        from ncgen.exchange.robots.accounting import warn_of
        from ncgen.exchange.robots.balance import accepted
        from ncgen.exchange.robots.closing import built
        from ncgen.exchange.robots.loop_files import loop_file_of
        from ncgen.exchange.robots.parameters import names_of_parameters

        as_parameters = names_of_parameters(parameters)
        robot = read_robot(path)
        robot = accepted(robot, inertias, robot.floats if floating is None else floating, stacklevel + 1)
        table = loop_file_of(path) if loops is None else as_path(loops, "the path of a file with loops")
        if table or robot.loops or robot.follows_from_start:
            robot = _assembled(robot, table)
        model = built(robot, (floating, limits, friction, motors, sensors, as_parameters))
    warn_of(model.left_out, path.name, stacklevel + 1)
    return model


def _assembled(robot: Robot, table: Path | None) -> Robot:
    """The robot with its loops closed: those of a table if there is one."""
    from ncgen.exchange.robots.closures import closures_of, refuse_idle, with_closures
    from ncgen.exchange.robots.loops import closed

    if table:
        return closed(robot, table)
    if robot.follows_from_start:
        return with_closures(robot, closures_of(robot))
    refuse_idle(robot)
    return robot


def with_frame_outputs(model: Model, names: Sequence[str]) -> Model:
    """The model, with outputs of these frames of its. Raises ModelError for what is no frame."""
    from ncgen.exchange.robots.frame_outputs import add_frame_outputs

    add_frame_outputs(model, names)
    return model


def robot_text(model: Model, suffix: str) -> str:
    """A model as a robot's file; where its bodies are no open tree, as SDF or MJCF. suffix: one of `WRITERS`.

    Raises ModelError naming what the format cannot say: a loop, a row or a load that belongs to no joint, a joint that it does not have.
    """
    from ncgen.exchange.robots.outward import robot_of

    if suffix not in WRITERS:
        raise ModelError(f"{model.name}: files of links and joints end with {', '.join(WRITERS)}; {shown(suffix)} is not one of them")
    return import_module(f"ncgen.exchange.robots.{WRITERS[suffix]}").text_of(robot_of(model, loops=WRITERS[suffix] in WRITERS_WITH_LOOPS))
