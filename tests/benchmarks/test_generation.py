"""Generation is timed from an empty cache in a process of its own, and code of loops does not grow with the model."""

import pytest

import ncgen
from benchmarks.generation import generation_records, growth_records
from benchmarks.tables import generation_rows


def test_the_second_time_derives_nothing():
    first, again = generation_records("pendulum")
    assert "symbolic" in first["stages"] and "symbolic" not in again["stages"]
    assert again["seconds"] < first["seconds"]
    assert len({len(row) for row in generation_rows([first, again])}) == 1


def test_code_of_a_chain_does_not_grow():
    """Tables do; the functions differ by their limits alone.

    Compilers that optimise take up to 8 doubles at a time, write out what that leaves over, and whole loops of up to 16 turns: both lengths
    leave the same over, of 8 as of 16, and are longer.
    """
    short, long = growth_records(lengths=(200, 1000), steps=0)
    assert abs(long["code"] - short["code"]) < 0.02 * short["code"]


def test_what_fails_is_said():
    with pytest.raises(ncgen.NcgenError, match="nosuchmodel"):
        generation_records("nosuchmodel")
