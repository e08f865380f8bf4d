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


def test_what_was_made_is_old_at_once():
    """So no collection of young objects looks through all of it; what somebody froze stays frozen."""
    gc.collect()
    with undisturbed():
        made = [[] for _ in range(5000)]
    assert any(each is made[0] for each in gc.get_objects(generation=2)) and gc.get_count()[0] < 5000
    gc.freeze()
    frozen = gc.get_freeze_count()
    try:
        with undisturbed():
            pass
        assert gc.get_freeze_count() == frozen
    finally:
        gc.unfreeze()
