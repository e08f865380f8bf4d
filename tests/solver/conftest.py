"""Motions of the robot and of the four-bar that several tests look at, and their independent counterparts."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from fourbar_loop import FourbarLoop  # noqa: E402
from robot_motions import MOTORS, SPATIAL, TIGHT  # noqa: E402
from robot_tree import RobotTree  # noqa: E402

import ncgen  # noqa: E402


@pytest.fixture(scope="session")
def tree(robot_tables):
    """The robot as a tree of rotations: no constraint, no natural coordinate."""
    return RobotTree(robot_tables)


@pytest.fixture(scope="session")
def spatial(robot):
    """A spatial motion of the robot under gravity alone."""
    return ncgen.simulate(robot, 0.5, formalism="coordinate-partitioning", integrator="dop853", zd0=SPATIAL, points=51, **TIGHT)


@pytest.fixture(scope="session")
def driven(robot_tables):
    """A spatial motion of the robot with a motor on every angle; its model knows them."""
    import sympy

    model = robot_tables.build()
    for name, law in MOTORS.items():
        psi = model.elements[name]
        model.torque(psi, law(model.time, psi.symbol, psi.rate, sympy.sin))
    kernels = ncgen.compile(model, backend="c")
    return ncgen.simulate(kernels, 0.4, formalism="coordinate-partitioning", integrator="dop853", zd0=SPATIAL, points=9, **TIGHT)


@pytest.fixture(scope="session")
def driven_unawares(driven, robot):
    """The same motion in the eyes of a model without motors."""
    return replace(driven, kernels=robot)


@pytest.fixture(scope="session")
def fourbar():
    """The example's kernels in C."""
    return ncgen.compile(ncgen.load("fourbar"), backend="c")


@pytest.fixture(scope="session")
def turning(fourbar):
    """The four-bar turning freely for nearly two turns of its crank."""
    return ncgen.simulate(fourbar, 1.0, formalism="coordinate-partitioning", integrator="dop853", zd0={"psi": 12.0}, points=21, **TIGHT)


@pytest.fixture(scope="session")
def loop():
    """The four-bar as one equation in its crank angle."""
    return FourbarLoop()


@pytest.fixture(scope="session")
def reference():
    """Rows of a file of tests/reference, without comments and header, as lists of words."""

    def rows(name):
        text = (HERE.parent / "reference" / name).read_text(encoding="utf-8")
        return [line.split(",") for line in text.splitlines() if not line.startswith("#")][1:]

    return rows
