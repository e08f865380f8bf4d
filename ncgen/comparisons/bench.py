"""`ncgen bench`: times next to errors, of generated code and of what was written by hand.

What needs other people's programs, and measurements of ncgen itself, are in tests/benchmarks/.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from rich.console import Console
from rich.text import Text

from ncgen.comparisons.batches import RUNS, STATES, batch_records
from ncgen.comparisons.derivative_parts import arithmetic_rate, derivative_records
from ncgen.comparisons.falls import fall_records
from ncgen.comparisons.rivals import KERNELS, Inputs, Others, exact, nobody, relative_error, rivals
from ncgen.compiler import compile
from ncgen.model import Model
from ncgen.program.ir.cost import cost
from ncgen.report.clock import Spread, measure
from ncgen.report.document import Rows, aligned

LETTERS = {"phi": "Φ", "phi_q": "Φ_q", "gamma": "γ", "all": "together"}

KERNEL_TITLE = "kernels of {}: ns per call, error against 50 digits relative to the largest entry"
DERIVATIVE_TITLE = "state derivative: ns; floor at {:.1f} operations a nanosecond, the measured rate of plain arithmetic"
FALL_TITLE = "simulation: ms, error of the end position (m, rad)"
BATCH_TITLE = "batch of {:,} states, of {:,} simulations: ns a state, gain over one at a time, relative difference"


def bench(model: Model) -> Iterator[tuple[str, list[dict]]]:
    """(title, records) of one measurement after the other.

    A record has at least case, tool, error and seconds (per call); error None where there is nothing to compare with.
    """
    kernels = compile(model, "c")
    rate = arithmetic_rate()
    yield KERNEL_TITLE.format(model.name), kernel_records(model, rate)
    yield DERIVATIVE_TITLE.format(rate / 1e9), derivative_records(kernels, rate) if kernels.m else []
    yield FALL_TITLE, list(fall_records(kernels))
    yield BATCH_TITLE.format(STATES, RUNS), list(batch_records(kernels))


def kernel_records(model: Model, rate: float, others: Others = nobody) -> list[dict]:
    """Every kernel, and all one after the other, by every tool; `ratio` is to all of them by the first tool, generated C.

    others: what else is set next to them
    """
    kernels = compile(model, "c")
    names = tuple(name for name in KERNELS if name in kernels.programs.programs)
    if not names:
        return []
    inputs = Inputs.typical(kernels)
    tools = rivals(model, inputs, names) + others(kernels, inputs, names)
    reference = {name: exact(kernels, name, inputs) for name in names}
    spent = measure({(rival.name, case): run for rival in tools for case, run in rival.runs.items()})
    records = []
    for case in (*names, "all"):
        parts = names if case == "all" else (case,)
        operations = sum(cost(kernels.programs.programs[name]).total for name in parts)
        for rival in (r for r in tools if case in r.runs):
            error = max(relative_error(rival.values(name), reference[name]) for name in parts)
            records.append(_record(case, rival.name, error, spent[rival.name, case], spent[tools[0].name, "all"]))
        records.append({"case": case, "tool": "floor", "error": None, "seconds": operations / rate, "operations": operations})
    return records


def _record(case: str, tool: str, error: float, spread: Spread, fastest: Spread) -> dict:
    return {"case": case, "tool": tool, "error": error, **spread.seconds(), "ratio": spread.median / fastest.median}


# -- for people --------------------------------------------------------------------------------------------------------


def show(console: Console, title: str, records: list[dict], more: Mapping[str, Callable[[list[dict]], Rows]] | None = None) -> None:
    """One section as a table; nothing where nothing could be measured. more: {case: its rows} next to those known here."""
    if not records:
        return
    tables = {"state derivative": _derivative_rows, "simulation": _simulation_rows, "batch": _batch_rows} | dict(more or {})
    console.print(Text(title, style="bold"))
    for line in aligned(tables.get(records[0]["case"], _kernel_rows)(records)):
        console.print(line, markup=False)
    console.print()


def _kernel_rows(records: list[dict]) -> list[tuple[str, ...]]:
    cases = list(dict.fromkeys(r["case"] for r in records))
    rows: list[tuple[str, ...]] = [("", *(LETTERS[case] for case in cases), "quartiles", "ratio", "error")]
    for tool in dict.fromkeys(r["tool"] for r in records):
        records_of_tool = [r for r in records if r["tool"] == tool]
        errors = [r["error"] for r in records_of_tool if r["error"] is not None]
        last = records_of_tool[-1]
        ratio = f"{last['ratio']:.2f}" if "ratio" in last else ""
        seconds = {r["case"]: r["seconds"] for r in records_of_tool}
        times = (f"{1e9 * seconds[case]:.0f}" if case in seconds else "" for case in cases)
        rows.append((tool, *times, _quartiles(last), ratio, _error(max(errors, default=None))))
    return rows


def _derivative_rows(records: list[dict]) -> list[tuple[str, ...]]:
    worst = any(r["worst"] is not None for r in records)
    rows: list[tuple[str, ...]] = [("", "ns", "quartiles", "operations", "floor", "error", *["worst"] * worst)]
    for r in records:
        floor = f"{1e9 * r['floor']:.0f}" if "floor" in r else ""
        operations = str(r.get("operations", ""))
        rows.append(
            (r["tool"], f"{1e9 * r['seconds']:.0f}", _quartiles(r), operations, floor, _error(r["error"]), *[_error(r["worst"])] * worst)
        )
    return rows


def _simulation_rows(records: list[dict]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [("", "", "ms", "whole call", "error", "evaluations", "Newton", "us each")]
    for r in records:
        stopped = r["seconds"] is None
        milliseconds = "stopped" if stopped else f"{1e3 * r['seconds']:.2f}"
        total = f"{1e3 * r['total']:.1f}" if "total" in r else ""
        each = f"{1e6 * r['seconds'] / r['evaluations']:.2f}" if "evaluations" in r else ""
        counts = (str(r.get(name, "")) for name in ("evaluations", "newton_steps"))
        rows.append((r["tool"], r["setting"], milliseconds, total, _error(r["error"]), *counts, each))
    return rows


def _batch_rows(records: list[dict]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [("", "", "ns", "quartiles", "gain", "difference")]
    for r in records:
        quantity = LETTERS[r["quantity"]] if r["quantity"] in LETTERS else r["quantity"]
        tool = r["tool"] + " (chosen)" * r.get("chosen", False)
        rows.append((quantity, tool, f"{1e9 * r['seconds']:.0f}", _quartiles(r), f"{r['ratio']:.2f}", _error(r["error"])))
    return rows


def _quartiles(record: dict) -> str:
    return f"{1e9 * record['low']:.0f}-{1e9 * record['high']:.0f}" if "low" in record else ""


def _error(value: float | None) -> str:
    return "" if value is None else f"{value:.1e}"
