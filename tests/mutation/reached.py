"""Which tests run a line, the promising ones first, by what `measured.py` has written."""

from __future__ import annotations

import ast
import json
import math
from collections import Counter, defaultdict
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import TypeAlias

from coverage import CoverageData
from faults import ROOT, Fault

LINES, TESTS = ROOT / ".coverage", ROOT / ".tests"

Lines: TypeAlias = dict[int, set[str]]
"""{line: tests that run it} of a file."""

MOST = 150
"""Tests that are tried at most: those of the line, then those of the rest of its module, since what is kept is computed by one of many."""

FIRST = 40
"""Tests of the library in Python that are tried before programs in C."""

REACH = 6
"""Lines before a fault at which its statement may begin."""

PREBUILT = "generic"
"""The folder of the library that is compiled to WebAssembly in advance: with a fault in it the files are made anew."""

OWN_PROGRAMS = {
    "tests/runtime/test_c_driver.py": "src", "tests/runtime/test_batch_driver.py": "lanes", "tests/export/test_c.py": "src",
    "tests/export/test_exported_loads.py": "src", "tests/export/test_controller.py": "src",
    "tests/export/test_events_in_wasm.py": PREBUILT, "tests/export/test_generic_wasm.py": PREBUILT, "tests/export/test_wasm.py": PREBUILT,
}  # fmt: skip
"""They run a folder of the library in programs, whose lines are not measured; so do others, which name the one file they need."""

SETTING_UP = 0.2
"""Seconds that any test costs: it is collected, and what it needs is imported."""


class Reached:
    """Tests by the lines that they run, and what they cost."""

    def __init__(self) -> None:
        self.data = CoverageData(str(LINES))
        self.data.read()
        self.seconds: dict[str, float] = {}
        self.in_c: dict[str, Lines] = defaultdict(lambda: defaultdict(set))
        for line in TESTS.read_text(encoding="utf-8").splitlines():
            record = json.loads(line)
            if record["passed"]:
                self.seconds[record["test"]] = record["seconds"]
                for file, numbers in record["lines"].items():
                    for number in numbers:
                        self.in_c[file][number].add(record["test"])

    def tests(self, fault: Fault) -> list[str]:
        """What may notice a fault, the promising ones first; nothing where no test runs its module."""
        path = Path(fault.file)
        is_python = path.suffix == ".py"
        lines = self._in_python(str(ROOT / path)) if is_python else self.in_c[path.name]
        nearest = next((lines[line] for line in _before(fault, lines) if lines.get(line)), set())
        rest = set().union(*lines.values()) - nearest
        shares = self._shares(lines, self.run_in_python if is_python else self.run_in_c)
        found = (self._ordered(nearest, path.stem, shares) + self._ordered(rest, path.stem, shares))[:MOST]
        if is_python:
            return found
        tests = sorted((ROOT / "tests/runtime").glob("test_*.py"))
        naming = [str(test.relative_to(ROOT)) for test in tests if path.name in test.read_text(encoding="utf-8")]
        programs = [module for module, folder in OWN_PROGRAMS.items() if folder == path.parent.name]
        return [*naming, *found[:FIRST], *programs, *found[FIRST:]]

    @cached_property
    def run_in_python(self) -> Counter[str]:
        """How many lines of Python each test runs."""
        return _counted(self._in_python(file) for file in self.data.measured_files())

    @cached_property
    def run_in_c(self) -> Counter[str]:
        """How many lines of C each test runs."""
        return _counted(self.in_c.values())

    def _in_python(self, file: str) -> Lines:
        told = self.data.contexts_by_lineno(file)
        return {line: {context.partition("|")[0] for context in contexts if context} for line, contexts in told.items()}

    @staticmethod
    def _shares(lines: Lines, run: Counter[str]) -> dict[str, float]:
        """What share of all lines that a test runs are those of one file: how much it is about that file."""
        return {test: here / run[test] for test, here in _counted([lines]).items()}

    def _ordered(self, tests: set[str], stem: str, shares: dict[str, float]) -> list[str]:
        """By what it costs to run a test and the quicker ones of its module, in powers of two, so that no module is begun often. Those that
        are more about the file come before others that cost no less, those of a module called like it before others that cost four times as
        much; the next case of the same function comes behind others that cost twice as much, the third behind such that cost three times.
        """
        cost: dict[str, float] = {}
        spent, cases = defaultdict(lambda: SETTING_UP), Counter[str]()
        for test in sorted(self.seconds.keys() & tests, key=lambda test: (self.seconds[test], test)):
            module = test.partition("::")[0]
            spent[module] += self.seconds[test]
            is_called_so = stem.removeprefix("ncgen_").removesuffix("s") in Path(module).name
            cases[test.partition("[")[0]] += 1
            cost[test] = spent[module] / math.sqrt(shares[test]) / (4 if is_called_so else 1) * cases[test.partition("[")[0]]
        return sorted(cost, key=lambda test: (math.ceil(math.log2(cost[test])), test.partition("::")[0], cost[test]))


def _counted(files: Iterable[Lines]) -> Counter[str]:
    """How many of these lines each test runs."""
    counts = Counter[str]()
    for lines in files:
        for tests in lines.values():
            counts.update(tests)
    return counts


def _before(fault: Fault, lines: Iterable[int]) -> Iterable[int]:
    """Lines that are run if the one with the fault is, the last one first. Where that is run by an import, those that read the name that is
    given there, or where the function begins whose arguments have the fault; none if there are none.
    """
    if fault.file.endswith(".c"):
        return sorted((line for line in lines if line <= fault.line), reverse=True)  # of a block the first line is known
    nodes = list(ast.walk(ast.parse((ROOT / fault.file).read_text(encoding="utf-8"))))
    functions = [node for node in nodes if isinstance(node, (ast.FunctionDef, ast.Lambda))]
    for function in functions:
        first, last = _body(function)
        if first <= fault.line <= last:
            return range(fault.line, fault.line - REACH, -1)
    for function in functions:
        first, _ = _body(function)
        if function.lineno <= fault.line < first:
            return range(first, first + REACH)
    assigned = [node for node in nodes if isinstance(node, (ast.Assign, ast.AnnAssign))]
    given = [node for node in assigned if node.lineno <= fault.line <= (node.end_lineno or node.lineno)]
    names = {node.id for each in given for node in ast.walk(each) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    return [node.lineno for node in nodes if isinstance(node, ast.Name) and node.id in names and isinstance(node.ctx, ast.Load)]


def _body(function: ast.FunctionDef | ast.Lambda) -> tuple[int, int]:
    """The first and the last line of what a function does."""
    body = function.body if isinstance(function.body, list) else [function.body]
    return body[0].lineno, body[-1].end_lineno or body[-1].lineno
