"""What is held removes degrees of freedom from an emitted recursion, which a switch cannot do."""

from __future__ import annotations

from benchmarks.held import CASES, counts
from ncgen.resources import folder


def test_a_mode_may_take_fewer_operations_than_the_free_mechanism():
    """The brake and the ratchet of the winch leave one of three degrees of freedom: a quarter of the operations, as docs say."""
    found = {names: (operations, conditions) for names, operations, conditions in counts(*CASES["winch"])}
    free, mode = found[""][0], found["brake ratchet"][0]
    assert 3 * mode < free
    words = (folder("runtime").parents[1] / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert f"| winch, brake and ratchet | {free} | {mode} | {found['brake ratchet'][1]} | {found['with switches'][1]} |" in words
