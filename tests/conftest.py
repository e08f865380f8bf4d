"""Fixtures shared by all tests: the examples' models and kernels, and a cache of their own."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import ncgen

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "examples" / "robot"))


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory):
    """Compiled libraries go to a folder of this test run, shared by its workers."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "gw" in base.name or "popen" in base.name else base
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NCGEN_CACHE_DIR", str(shared / "ncgen-cache"))
        yield


@pytest.fixture(scope="session")
def robot_tables():
    """The paper's tables as a module: `build(angles=…, form=…, scale=…)` makes the model."""
    import tables

    return tables


@pytest.fixture(scope="session")
def robot_model(robot_tables):
    return robot_tables.build()


@pytest.fixture(scope="session")
def robot(robot_model):
    """The robot's kernels in C."""
    return ncgen.compile(robot_model, backend="c")


@pytest.fixture(scope="session")
def robot_numpy(robot_model):
    return ncgen.compile(robot_model, backend="numpy")
