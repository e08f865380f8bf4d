"""`bench.py all --defaults`: the default call next to the best method that could have been named."""

from benchmarks import defaults


def test_the_default_beside_named_methods(monkeypatch):
    """Two tolerances of one method that is the default's own: the finer one is as exact and no quicker."""
    monkeypatch.setattr(defaults, "LADDER", (1e-5, 1e-9))
    monkeypatch.setattr(defaults, "methods", lambda: [("lagrange", "dop853"), ("lagrange", "rattle")])
    (record,) = defaults.default_records(["robot"])
    assert record["chosen"] == "lagrange, dop853" and record["best"] == "lagrange, dop853 at 1e-09"
    assert record["best_error"] <= record["error"] and record["tolerances"] < 100
    assert record["ratio"] == record["seconds"] / record["best_seconds"]
    head, line = defaults.default_lines([record])
    assert line.startswith("robot") and "1e-09" in line and len(line) == len(head)
