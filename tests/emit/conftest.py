"""The robot's sources in every emission."""

from __future__ import annotations

import pytest
from hypothesis import settings

import ncgen

# The same examples on every run and machine, however slow it is.
settings.register_profile("ncgen", derandomize=True, deadline=None, max_examples=60)
settings.load_profile("ncgen")


@pytest.fixture(scope="session")
def robot_sources(robot_model):
    """robot_sources(emission): generated once a process."""
    made = {}

    def sources(emission: str):
        if emission not in made:
            made[emission] = ncgen.generate(robot_model, emission=emission)
        return made[emission]

    return sources
