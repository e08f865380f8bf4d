"""The hard cases by their names: mechanisms on which methods are known to break."""

from __future__ import annotations

from benchmarks.case import Case
from benchmarks.hard_linkages import LINKAGES
from benchmarks.hard_pendulums import PENDULUMS
from benchmarks.hard_tops import TOPS

CASES: dict[str, Case] = {case.name: case for case in (*LINKAGES, *TOPS, *PENDULUMS)}
"""In the order in which they are listed."""
