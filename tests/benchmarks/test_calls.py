"""`bench.py all --calls`: what a call from Python costs beside the run in C that it makes."""

from benchmarks import calls


def test_a_call_beside_its_run(monkeypatch):
    monkeypatch.setattr(calls, "CALLS", 5)
    (record,) = calls.call_records(["fourbar"])
    assert 0 < record["in_c"] and 0 < record["least"] <= record["beside"] and 0 < record["changed"]
    own = calls.calls_of(lambda: calls.simulate(KERNELS, calls.DURATION))
    assert own <= record["functions"] < own + 10  # those of the clock
    head, line, last = calls.call_lines([record])
    assert line.startswith("fourbar") and len(line) == len(head) and last.startswith("beside C: median")


def test_other_calls(monkeypatch):
    """A step is a call of C with next to nothing around it."""
    monkeypatch.setattr(calls, "CALLS", 5)
    records = {record["call"]: record for record in calls.other_records("fourbar")}
    assert records["start().step"]["functions"] < 15 and all(record["seconds"] > 0 for record in records.values())
    head, *lines = calls.other_lines("fourbar", records.values())
    assert len(lines) == len(records) and {len(line) for line in lines} == {len(head)}


KERNELS = calls.compile(calls.load("fourbar"), "c")
