"""Which tests are among the longer proofs: what the processor needed for each of them decides, not who wrote it.

    python -m pytest -m "slow or not slow" --times times.jsonl     # a line a test: its name and seconds
    python tests/times.py times.jsonl                              # adds those that take long to tests/slow.txt
    python -m pytest --cov=ncgen --cov-context=test                # which test runs which line
    python tests/times.py times.jsonl .coverage                    # adds to tests/slow.txt until the others take SUITE

Of a test with parameters all cases below SHORT stay in the ordinary suite, and the quickest one below LONG; so does a test that has
one case, and what KEPT names. What the sources mark, `pytest.mark.slow`, is among the longer proofs in any case. Then those go whose lines
others run as well: first what takes most seconds for the lines that nobody else runs.
"""

from __future__ import annotations

import json
import resource
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

LISTED = Path(__file__).with_name("slow.txt")

SHORT = 0.25
LONG = 1.0
"""Seconds of the processor, with those of compilers and other processes that a test starts."""

SUITE = 600.0
"""Seconds of the processor that the ordinary suite may take: on two cores it then ends within 6 minutes."""

KEPT = (
    "tests/test_",
    "tests/solver/test_time_loops.py",
    "tests/cli/test_cli_commands.py::test_inspect",
    "tests/comparisons/test_bench.py",
    "tests/comparisons/test_compare.py::test_the_report_asks_nobody",
    "tests/comparisons/test_compare.py::test_functions_of_the_user",
    "tests/comparisons/test_precision.py",
    "tests/comparisons/test_robots.py",
    "tests/export/test_casadi.py::test_derivatives_are_those_of_the_functions[dynamics-cartpole]",
    "tests/export/test_casadi.py::test_start",
    "tests/export/test_casadi.py::test_values_are_those_of_a_run[cam]",
    "tests/export/test_joints_in_c.py::test_a_loop_in_c",
    "tests/export/test_joints_in_c.py::test_its_own_program_runs_by_the_readme",
    "tests/program/test_full_loads.py::test_loads_are_those_of_reactions[slidercrank3d]",
    "tests/robots/test_inverse_kinematics.py::test_what_is_refused",
    "tests/runtime/test_c_driver.py::test_it_has_no_warning_in_float_and_in_cpp",
    "tests/solver/test_second_derivatives.py::test_a_start_that_is_no_straight_line_of_a_parameter",
    "tests/solver/test_integrators_on_c.py::test_every_formalism_over_all_coordinates[udwadia-phohomsiri]",
    "tests/robots/test_written_loops.py::test_an_open_tree_keeps_its_zeros_in_sdf",
    "tests/robots/test_written_loops.py::test_gears_become_mimics",
    "tests/robots/test_written_loops.py::test_mimics_come_back[.sdf]",
    "tests/robots/test_written_loops.py::test_what_is_read_back_moves_as_what_was_written[fivebar]",
)
"""Beginnings of the names of tests that stay however long they take: no other ordinary one passes through what they are about."""


PHYSICS = ("tests/gallery/",)
"""Beginnings of the names of tests of what examples do, which is seen in numbers and in no line."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--times", help="a file to which each test's name and processor time (s) are appended")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    listed = set(LISTED.read_text(encoding="utf-8").splitlines()) if LISTED.exists() else set()
    for item in items:
        if item.nodeid in listed:
            item.add_marker(pytest.mark.slow)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    path = item.config.getoption("--times")
    before = _seconds()
    yield
    if path:
        with open(path, "a", encoding="utf-8") as lines:  # one write a line: workers append to the same file
            lines.write(json.dumps([item.nodeid, round(_seconds() - before, 3)]) + "\n")


def _seconds() -> float:
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in usage)


def longer_proofs(times: Iterable[tuple[str, float]]) -> list[str]:
    """Names of the tests that take too long for the ordinary suite, from the names and seconds of all."""
    cases: dict[str, dict[str, float]] = defaultdict(dict)
    for name, seconds in times:
        cases[name.partition("[")[0]][name] = seconds
    found = []
    for each in cases.values():
        quickest = min(each, key=lambda name: each[name])
        found += [name for name, seconds in each.items() if seconds > (LONG if name == quickest else SHORT)]
    return sorted(name for name in found if not name.startswith(KEPT + PHYSICS))


def lines_of(path: str) -> dict[str, set[tuple[str, int]]]:
    """{test: lines that it runs}, of what coverage has recorded with `--cov-context=test`."""
    from coverage import CoverageData  # which no run of the tests needs

    data = CoverageData(path)
    data.read()
    found: dict[str, set[tuple[str, int]]] = defaultdict(set)
    for file in data.measured_files():
        for line, contexts in data.contexts_by_lineno(file).items():
            for context in contexts:
                found[context.partition("|")[0]].add((file, line))
    return found


def spared(seconds: dict[str, float], lines: dict[str, set[tuple[str, int]]]) -> list[str]:
    """Names of the tests without which the others take SUITE, from the seconds of each and the lines that it runs."""
    runs = Counter(line for each in lines.values() for line in each)
    left, found = {name for name in seconds if seconds[name] > SHORT and not name.startswith(KEPT + PHYSICS)}, []
    spent = sum(seconds.values())
    while spent > SUITE and left:
        name = max(sorted(left), key=lambda name: seconds[name] / (1 + sum(runs[line] == 1 for line in lines.get(name, ()))))
        left.discard(name)
        found.append(name)
        spent -= seconds[name]
        runs.subtract(lines.get(name, ()))
    return found


if __name__ == "__main__":
    lines = [json.loads(line) for line in Path(sys.argv[1]).read_text(encoding="utf-8").splitlines()]
    times = {name: seconds for name, seconds, *_ in lines}
    known = LISTED.read_text(encoding="utf-8").splitlines()
    ordinary = {name: seconds for name, seconds in times.items() if name not in known}
    more = spared(ordinary, lines_of(sys.argv[2])) if len(sys.argv) > 2 else longer_proofs(ordinary.items())
    names = sorted({*known, *more})
    LISTED.write_text("".join(f"{name}\n" for name in names), encoding="utf-8")
