"""The collector of circles rests while code is generated, and is afterwards as it was."""

from __future__ import annotations

import gc

import pytest

import ncgen
from ncgen.toolchain.undisturbed import undisturbed


@pytest.fixture(autouse=True)
def at_work():
    yield
    gc.enable()


@pytest.mark.parametrize("was_at_work", [True, False])
def test_it_is_left_as_it_was(was_at_work):
    """Also where work within work ends, or fails."""
    (gc.enable if was_at_work else gc.disable)()
    with pytest.raises(ZeroDivisionError), undisturbed():
        with undisturbed():
            assert not gc.isenabled()
        assert not gc.isenabled()
        _ = 1 / 0
    assert gc.isenabled() == was_at_work


def test_generating_leaves_it_at_work():
    ncgen.generate(ncgen.load("pendulum"))
    assert gc.isenabled()
