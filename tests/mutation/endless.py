"""A plugin of pytest: a test that computes far longer than any ordinary one, as where a fault makes a loop endless, ends the run."""

from __future__ import annotations

import signal

SECONDS = 30.0
"""Of the processor, for one test with what is made for it; the longest ordinary one takes less than half of them."""


def pytest_runtest_logstart(nodeid: str) -> None:
    signal.setitimer(signal.ITIMER_PROF, SECONDS)  # what is done at its end: the process ends by the signal SIGPROF
