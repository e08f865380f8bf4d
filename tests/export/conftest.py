"""One export of every mechanism and target, copied for tests that build in it."""

from __future__ import annotations

import shutil

import pytest

from ncgen.exchange.examples import load
from ncgen.exchange.export import export


@pytest.fixture(scope="session")
def exports(tmp_path_factory):
    """exports(name, target): a folder as exported, to be read only."""
    made = {}

    def get(name, target="c"):
        if (name, target) not in made:
            made[name, target] = tmp_path_factory.mktemp(f"{name}-{target}")
            export(load(name), target, made[name, target])
        return made[name, target]

    return get


@pytest.fixture
def fresh(exports, tmp_path):
    """fresh(name, target): a copy of an export in a clean folder of this test's own."""

    def get(name, target="c"):
        return shutil.copytree(exports(name, target), tmp_path / f"{name}-{target}")

    return get
