"""Generation is timed from an empty cache in a process of its own, and code of loops does not grow with the model."""

import pytest

import ncgen
from ncgen.comparisons.bench import generation_rows
from ncgen.comparisons.generation import generation_records, growth_records


def test_the_second_time_derives_nothing():
    first, again = generation_records("pendulum")
    assert "symbolic" in first["stages"] and "symbolic" not in again["stages"]
    assert again["seconds"] < first["seconds"]
    assert len({len(row) for row in generation_rows([first, again])}) == 1


def test_code_of_a_chain_does_not_grow():
    """Tables do; from 100 to 200 links (gcc unrolls shorter loops) the functions differ by their limits alone."""
    short, long = growth_records(lengths=(100, 200), steps=0)
    assert abs(long["code"] - short["code"]) < 0.02 * short["code"]


def test_what_fails_is_said():
    with pytest.raises(ncgen.NcgenError, match="nosuchmodel"):
        generation_records("nosuchmodel")
