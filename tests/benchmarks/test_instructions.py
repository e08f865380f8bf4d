"""`bench.py MODEL --instructions`: counts that repeat, and that fit what the programs say they do."""

import shutil

import pytest

import ncgen
from benchmarks import instructions
from benchmarks.instructions import instruction_records, table
from ncgen.program.ir.cost import cost

needs_valgrind = pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")


@needs_valgrind
def test_counts_repeat_and_fit_the_operations(monkeypatch):
    """A fused instruction does two operations, and each takes some loads and stores."""
    monkeypatch.setattr(instructions, "EMISSIONS", ("unrolled",))
    monkeypatch.setenv("NCGEN_CFLAGS", "")  # as it is compiled for users
    model = ncgen.load("slidercrank")
    records = list(instruction_records(model))
    assert records == list(instruction_records(model))
    programs = ncgen.compile(model, "c").programs.programs
    for r in (r for r in records if r["tool"] == "generated, unrolled"):
        operations = cost(programs[r["case"]])
        if not operations.calls:
            assert operations.total / 2 <= r["instructions"] <= 6 * operations.total + 30, r
    assert {"newton", "acceleration"} <= {r["case"] for r in records}
    assert len({len(row) for row in table(records)}) == 1


def test_without_valgrind_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(ncgen.NcgenError, match="valgrind"):
        list(instruction_records(ncgen.load("pendulum")))
