"""Which tests run a line, the promising ones first, by what `measured.py` has written."""

from __future__ import annotations

import ast
import json
import math
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

from coverage import CoverageData
from faults import ROOT, Fault

LINES, TESTS = ROOT / ".coverage", ROOT / ".tests"

MOST = 150
"""Tests that are tried at most: those of the line, then those of the rest of its module, since what is kept is computed by one of many."""

REACH = 6
"""Lines before a fault at which its statement may begin."""

OWN_PROGRAMS = (
    "tests/runtime/test_c_driver.py", "tests/runtime/test_batch_driver.py", "tests/export/test_c.py", "tests/export/test_exported_loads.py",
    "tests/export/test_controller.py",
)  # fmt: skip
"""They compile the library into programs, whose lines are not measured; as do others, which name the one file that they need."""

SETTING_UP = 0.2
"""Seconds that any test costs: it is collected, and what it needs is imported."""


class Reached:
    """Tests by the lines that they run, and what they cost."""

    def __init__(self) -> None:
        self.data = CoverageData(str(LINES))
        self.data.read()
        self.seconds: dict[str, float] = {}
        self.in_c: dict[str, dict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
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
        lines = self._in_python(path) if path.suffix == ".py" else self.in_c[path.name]
        nearest = next((lines[line] for line in _before(fault, lines) if lines.get(line)), set())
        rest = set().union(*lines.values()) - nearest
        found = self._ordered(nearest, path.stem) + self._ordered(rest, path.stem)
        if path.suffix == ".py":
            return found[:MOST]
        tests = sorted((ROOT / "tests/runtime").glob("test_*.py"))
        naming = [str(test.relative_to(ROOT)) for test in tests if path.name in test.read_text(encoding="utf-8")]
        return [*naming, *found[:MOST], *OWN_PROGRAMS]

    def _in_python(self, path: Path) -> dict[int, set[str]]:
        told = self.data.contexts_by_lineno(str(ROOT / path))
        return {line: {context.partition("|")[0] for context in contexts if context} for line, contexts in told.items()}

    def _ordered(self, tests: set[str], stem: str) -> list[str]:
        """By what it costs to run a test and the quicker ones of its module, in powers of two, so that no module is begun often; those
        of a module called like the source come before others that cost four times as much.
        """
        cost: dict[str, float] = {}
        spent = defaultdict(lambda: SETTING_UP)
        for test in sorted(self.seconds.keys() & tests, key=lambda test: (self.seconds[test], test)):
            module = test.partition("::")[0]
            spent[module] += self.seconds[test]
            cost[test] = spent[module] / (4 if stem.removeprefix("ncgen_").removesuffix("s") in Path(module).name else 1)
        return sorted(cost, key=lambda test: (math.ceil(math.log2(cost[test])), test.partition("::")[0], cost[test]))


def _before(fault: Fault, lines: Iterable[int]) -> Iterable[int]:
    """Lines that are run if the one with the fault is, the last one first; none where it is run by an import."""
    if fault.file.endswith(".c"):
        return sorted((line for line in lines if line <= fault.line), reverse=True)  # of a block the first line is known
    tree = ast.parse((ROOT / fault.file).read_text(encoding="utf-8"))
    bodies = [node.body for node in ast.walk(tree) if isinstance(node, (ast.FunctionDef, ast.Lambda))]
    spans = [(body[0].lineno, body[-1].end_lineno) if isinstance(body, list) else (body.lineno, body.end_lineno) for body in bodies]
    if not any(first <= fault.line <= (last or first) for first, last in spans):
        return []
    return range(fault.line, fault.line - REACH, -1)
