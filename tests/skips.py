"""Which tests may be skipped: `python -m pytest --complete` fails if another one was, so that no promised feature goes untested.

A summary says at the end of every run what was skipped and why.
"""

from __future__ import annotations

from collections import Counter

import pytest

MAY_BE_MISSING = {
    "could not import 'torch'": "a download of 2 GB, whose bridge is that of JAX",
    "could not import 'symforce'": "a benchmark beside a program that is none of ncgen's features",
    "exudyn is not installed": "a benchmark beside a program that is none of ncgen's features",
    "Octave is not installed": "a benchmark beside the paper's Matlab programs",
    "pip install drake": "a comparison with another reader of SDF",
    "could not import 'distributed'": "a scheduler to which studies are handed by an interface that a test imitates",
    "clang is not installed": "one of several compilers; gcc and zig, which contains clang, are tested",
    "tcc is not installed": "one of several compilers",
    "arm-none-eabi-gcc is not installed": "zig compiles for the same processors",
    "ziglang ": "another version of zig writes other bytes",
}
"""{beginning of a reason: why the test may be skipped even so}. Reasons about the case itself follow."""

OF_THE_CASE = (
    "of redundant rows ali3p takes all",
    "it begins so slowly",
    "not the same: see OTHERWISE",
    "its rows are of several choices of independent coordinates",
    "it does not run in C",
    "its independent coordinates are no relative ones",
    "it begins in a singular position",
    "drivers leave nothing free",
    "no joint is away from its parent",
    "one processor",
    "no two processors with nothing else to do",
)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--complete", action="store_true", help="fail if a test was skipped that tests/skips.py does not list")


def pytest_terminal_summary(terminalreporter, config: pytest.Config) -> None:
    reasons = _reasons(terminalreporter)
    for reason, count in sorted(reasons.items()):
        terminalreporter.write_line(f"skipped, {count}: {reason}{_excuse(reason)}")


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None or not session.config.getoption("--complete") or exitstatus != pytest.ExitCode.OK:
        return
    if untested := unlisted(_reasons(reporter)):
        reporter.write_line(f"\nnot tested, and not listed in tests/skips.py: {'; '.join(untested)}", red=True)
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def unlisted(reasons) -> list[str]:
    """Those reasons for which a test must not be skipped."""
    return sorted(reason for reason in reasons if not reason.startswith((*MAY_BE_MISSING, *OF_THE_CASE)))


def _reasons(reporter) -> Counter[str]:
    """{reason: how many tests were skipped}."""
    return Counter(report.longrepr[2].removeprefix("Skipped: ") for report in reporter.stats.get("skipped", ()))


def _excuse(reason: str) -> str:
    return next((f" ({why})" for beginning, why in MAY_BE_MISSING.items() if reason.startswith(beginning)), "")
