"""The hard cases by their names: mechanisms on which methods are known to break."""

from __future__ import annotations

from ncgen.comparisons.case import Case
from ncgen.comparisons.hard_linkages import LINKAGES
from ncgen.comparisons.hard_pendulums import PENDULUMS
from ncgen.comparisons.hard_tops import TOPS

CASES: dict[str, Case] = {case.name: case for case in (*LINKAGES, *TOPS, *PENDULUMS)}
"""In the order in which they are listed."""
