"""A model file looked at before anything is made of it: the model, and all that is wrong."""

from __future__ import annotations

from pathlib import Path

from ncgen.exchange import robots
from ncgen.exchange.examples import load
from ncgen.exchange.toml_reader import problems_of_run, read_toml
from ncgen.model import Model
from ncgen.solver.runs.simulation_options import check_simulation


def checked(path: Path) -> tuple[Model | None, list[str]]:
    """The model as far as it could be read, and one line for each problem: of a TOML file all, of a robot's file those of links and joints.

    Raises ModelError for the first problem of a file of another kind.
    """
    suffix = path.suffix.lower()
    if suffix in robots.SUFFIXES and (problems := robots.problems_of(path)):
        return None, problems
    if suffix != ".toml":
        model = load(path)
        check_simulation(model)
        return model, []
    model, problems = read_toml(path)
    if model is not None:
        problems = problems or problems_of_run(path, model)
    return model, [problem.of(path) for problem in problems]
