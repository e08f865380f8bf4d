"""Keys of JSON, of studies' files and of archives are terms of the field, and files of before are read."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from test_plain_names import DIALECT, VAGUE_IN_PYTHON

from ncgen.report import gallery

PACKAGE = Path(__file__).resolve().parents[1] / "ncgen"

RECORDS = (
    "cli/measuring.py", "cli/models.py", "cli/studies.py", "comparisons/batches.py", "comparisons/bench.py", "comparisons/compare.py",
    "comparisons/comparison.py", "comparisons/derivative_parts.py", "comparisons/falls.py", "comparisons/hard.py",
    "report/precision.py", "comparisons/robots.py", "report/derivative.py", "report/gallery.py", "report/inspection.py",
    "report/machine.py", "report/rounds.py", "report/run_report.py", "solver/trajectories/trajectory_files.py", "studies/columns.py",
    "studies/study_folder.py",
)  # fmt: skip
"""Modules that make what `--json` prints, what a study's folder holds and what an archive of a trajectory says of itself."""

OTHERS = {"closing", "doubt", "freedom", "freedoms", "row", "rows", "taken", "against", "each"}
"""Words that such keys had, for which readers know others: projection or positions, error, DOF, constraint, chosen, reference."""

ALLOWED = {
    "doubt": "an entry of the cache of references (report/precision.py), which users do not see",
    "degrees of freedom": "the term itself",
}
"""{key: why it may stay}."""

FORMER = ("FORMER",)
"""Tables of names of before, which are read on."""


def keys(tree: ast.Module) -> set[str]:
    """Names of entries that a module writes into dictionaries and archives, but for those of its tables of former names."""
    former = [node for node in tree.body if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)]
    skipped = {id(node) for each in former if each.targets[0].id in FORMER for node in ast.walk(each)}  # type: ignore[union-attr]
    written = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Dict) and id(node) not in skipped:
            written |= {key.value for key in node.keys if isinstance(key, ast.Constant) and isinstance(key.value, str)}
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("np.savez", "_print_results", "dict"):
            written |= {keyword.arg for keyword in node.keywords if keyword.arg}
    return written


def vague(key: str) -> bool:
    """True if a part of a key is a word for which there is a better one."""
    return bool({word.lower() for word in re.findall("[A-Za-z]+", key)} & (VAGUE_IN_PYTHON | DIALECT | OTHERS))


def test_keys_are_terms():
    written = {name: keys(ast.parse((PACKAGE / name).read_text(encoding="utf-8"))) for name in RECORDS}
    assert {"dof", "constraints"} <= written["report/inspection.py"] and "evaluation" in written["comparisons/robots.py"]
    assert {name: wrong for name, of in written.items() if (wrong := {key for key in of - set(ALLOWED) if vague(key)})} == {}


def test_examples_in_an_older_cache_are_counted_again(monkeypatch):
    monkeypatch.setattr(gallery, "kept", lambda kind, key: {"coordinates": 1, "rows": 2, "dof": 3, "redundant": 4})
    monkeypatch.setattr(gallery, "keep", lambda kind, key, facts: None)
    assert gallery._facts("pendulum") == {"coordinates": 6, "constraints": 1, "dof": 1, "redundant": 0}  # one bar of constant length


def test_the_check_sees_such_keys():
    tree = ast.parse('FORMER = {"said": "messages"}\nrecord = {"rows": 1, "what": 2, "dof": 3}\nnp.savez(b, slopes=4)\n')
    assert {key for key in keys(tree) if vague(key)} == {"rows", "what", "slopes"}
