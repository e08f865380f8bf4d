"""The robot's programs in every emission, and a position off the initial one."""

from __future__ import annotations

import random

import pytest
from hypothesis import settings

from ncgen.program.assemble import assemble
from ncgen.program.programs import EMISSIONS
from ncgen.symbolic.equations import build_equations

# The same examples on every run and machine, however slow it is.
settings.register_profile("ncgen", derandomize=True, deadline=None, max_examples=60)
settings.load_profile("ncgen")


@pytest.fixture(scope="session")
def equations(robot_model):
    return build_equations(robot_model)


@pytest.fixture(scope="session")
def assembled(equations):
    """{emission: programs of the robot}."""
    return {emission: assemble(equations, emission) for emission in EMISSIONS}


@pytest.fixture(scope="session")
def inputs(equations):
    """A position near the initial one, with velocities."""
    draw = random.Random(1).uniform
    position = [c.initial + draw(-0.1, 0.1) for c in equations.free]
    return {"t": 0.3, "q": position, "qd": [draw(-1.0, 1.0) for _ in position], "p": []}
