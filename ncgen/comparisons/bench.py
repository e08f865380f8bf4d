"""`ncgen bench`: times beside errors, of generated code and of whatever else can do the same work."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial

from rich.console import Console
from rich.text import Text

from ncgen.comparisons import arms
from ncgen.comparisons.batches import RUNS, STATES, batch_records
from ncgen.comparisons.data import data_records
from ncgen.comparisons.falls import fall_records
from ncgen.comparisons.generation import generation_records
from ncgen.comparisons.gradients import STEPS, gradient_records
from ncgen.comparisons.libraries import MOTIONS, library_records
from ncgen.comparisons.libraries import STEPS as LIBRARY_STEPS
from ncgen.comparisons.rates import arithmetic_rate, derivative_records
from ncgen.comparisons.rivals import KERNELS, Inputs, exact, relative_error, rivals
from ncgen.compiler import compile
from ncgen.exchange.examples import example_names
from ncgen.model import Model
from ncgen.program.ir.cost import cost
from ncgen.report.clock import Spread, measure

LETTERS = {"phi": "Φ", "phi_q": "Φ_q", "gamma": "γ", "all": "together"}


def bench(model: Model, seed: int = arms.SEED) -> Iterator[tuple[str, list[dict]]]:
    """(title, records) of one measurement after the other.

    seed: of the random arms beside the example
    A record has at least case, tool, error and seconds (per call); error None where there is nothing to compare with.
    """
    kernels = compile(model, "c")
    rate = arithmetic_rate()
    title = f"kernels of {model.name}: ns per call, error against 50 digits relative to the largest entry"
    yield title, kernel_records(model, rate)
    title = f"state derivative: ns; floor at {rate / 1e9:.1f} operations a nanosecond, the measured rate of plain arithmetic"
    yield title, derivative_records(kernels, rate) if kernels.m else []
    yield "simulation: ms, error of the end position (m, rad)", list(fall_records(kernels))
    yield "generation and compilation, seconds", generation_records(model.name) if model.name in example_names() else []
    title = f"batch of {STATES:,} states, of {RUNS:,} simulations: ns a state, gain over one at a time, relative difference"
    yield title, list(batch_records(kernels))
    if model.name == "arm":
        yield from ((arms.title(records[0]), records) for records in arms.arm_records(seed=seed))


def gradient_section(model: Model) -> Iterator[tuple[str, list[dict]]]:
    """(title, records) of derivatives of a whole motion."""
    title = f"derivatives of a motion of {model.name} with {STEPS} steps of rk4 by its data: ms, error relative to the largest"
    yield title, list(gradient_records(model))
    yield from data_section([model])


def library_section(model: Model) -> Iterator[tuple[str, list[dict]]]:
    """(title, records) of many motions inside other libraries."""
    what = f"{MOTIONS:,} motions of {model.name} with {LIBRARY_STEPS} steps of rk4, and their gradients by all data"
    title = f"{what}: ms a motion, difference from ncgen"
    yield title, list(library_records(model))


def data_section(models: Iterable[Model]) -> Iterator[tuple[str, list[dict]]]:
    """(title, records) of what data as parameters cost."""
    title = "operations of the state derivative over all coordinates: with numbers, and with parameters in their place"
    yield title, [record for model in models for record in data_records(model)]


def kernel_records(model: Model, rate: float) -> list[dict]:
    """Every kernel, and all one after the other, by every tool; `ratio` is to all of them by the first tool, generated C."""
    kernels = compile(model, "c")
    names = tuple(name for name in KERNELS if name in kernels.programs.programs)
    if not names:
        return []
    inputs = Inputs.typical(kernels)
    found = rivals(model, inputs, names)
    reference = {name: exact(kernels, name, inputs) for name in names}
    spent = measure({(rival.name, case): run for rival in found for case, run in rival.runs.items()})
    records = []
    for case in (*names, "all"):
        parts = names if case == "all" else (case,)
        operations = sum(cost(kernels.programs.programs[name]).total for name in parts)
        for rival in (r for r in found if case in r.runs):
            error = max(relative_error(rival.values(name), reference[name]) for name in parts)
            records.append(_record(case, rival.name, error, spent[rival.name, case], spent[found[0].name, "all"]))
        records.append({"case": case, "tool": "floor", "error": None, "seconds": operations / rate, "operations": operations})
    return records


def _record(case: str, tool: str, error: float, spread: Spread, fastest: Spread) -> dict:
    return {"case": case, "tool": tool, "error": error, **spread.seconds(), "ratio": spread.median / fastest.median}


# -- for people --------------------------------------------------------------------------------------------------------


def show(console: Console, title: str, records: list[dict]) -> None:
    """One section as a table; nothing where nothing could be measured."""
    if not records:
        return
    tables = {"state derivative": _derivative_rows, "simulation": _simulation_rows, "batch": _batch_rows, "generation": generation_rows}
    tables |= {"gradients": _gradient_rows, "libraries": partial(_gradient_rows, digits=4), "operations": _operation_rows, "arm": arms.rows}
    console.print(Text(title, style="bold"))
    for line in aligned(tables.get(records[0]["case"], _kernel_rows)(records)):
        console.print(line, markup=False)
    console.print()


def aligned(rows: list[tuple[str, ...]]) -> list[str]:
    """Rows of text as lines: the first column to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for first, *others in rows:
        cells = [first.ljust(widths[0]), *(cell.rjust(w) for cell, w in zip(others, widths[1:], strict=True))]
        lines.append(f"  {'  '.join(cells)}".rstrip())
    return lines


def _kernel_rows(records: list[dict]) -> list[tuple[str, ...]]:
    cases = list(dict.fromkeys(r["case"] for r in records))
    rows: list[tuple[str, ...]] = [("", *(LETTERS[case] for case in cases), "quartiles", "ratio", "error")]
    for tool in dict.fromkeys(r["tool"] for r in records):
        mine = [r for r in records if r["tool"] == tool]
        errors = [r["error"] for r in mine if r["error"] is not None]
        last = mine[-1]
        ratio = f"{last['ratio']:.2f}" if "ratio" in last else ""
        seconds = {r["case"]: r["seconds"] for r in mine}
        times = (f"{1e9 * seconds[case]:.0f}" if case in seconds else "" for case in cases)
        rows.append((tool, *times, _quartiles(last), ratio, _error(max(errors, default=None))))
    return rows


def _derivative_rows(records: list[dict]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [("", "ns", "quartiles", "operations", "floor", "error", "worst")]
    for r in records:
        floor = f"{1e9 * r['floor']:.0f}" if "floor" in r else ""
        operations = str(r.get("operations", ""))
        rows.append((r["tool"], f"{1e9 * r['seconds']:.0f}", _quartiles(r), operations, floor, _error(r["error"]), _error(r["worst"])))
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
        what = LETTERS[r["what"]] if r["what"] in LETTERS else r["what"]
        tool = r["tool"] + " (chosen)" * r.get("chosen", False)
        rows.append((what, tool, f"{1e9 * r['seconds']:.0f}", _quartiles(r), f"{r['ratio']:.2f}", _error(r["error"])))
    return rows


def _gradient_rows(records: list[dict], digits: int = 2) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [("", "ms", "quartiles", "ratio", "error")]
    for r in records:
        low, median, high = (f"{1e3 * r[name]:.{digits}f}" for name in ("low", "seconds", "high"))
        rows.append((r["tool"], median, f"{low}-{high}", f"{r['ratio']:.2f}", _error(r["error"])))
    return rows


def _operation_rows(records: list[dict]) -> list[tuple[str, ...]]:
    """A line a model: its own numbers, then what stands in their place, each with its ratio to these."""
    tools = list(dict.fromkeys(r["tool"] for r in records))
    rows: list[tuple[str, ...]] = [("", tools[0], *(title for tool in tools[1:] for title in (tool, "data", "ratio")))]
    for model in dict.fromkeys(r["model"] for r in records):
        mine = {r["tool"]: r for r in records if r["model"] == model}
        cells = [f"{mine[tools[0]]['operations']:,}"]
        for r in map(mine.get, tools[1:]):
            cells += [f"{r['operations']:,}", str(r["data"] or ""), f"{r['ratio']:.3f}"] if r else [""] * 3
        rows.append((model, *cells))
    return rows


def generation_rows(records: list[dict]) -> list[tuple[str, ...]]:
    """Titles and lines; what takes longest has columns of its own."""
    stages = ("symbolic", "program", "emit", "build")
    moves = any("steps" in r for r in records)
    motion = ("processor", "freedom", "first run", "again", "a step, us", "engine", "by the matrix, us") if moves else ()
    rows: list[tuple[str, ...]] = [("", "in all", *stages, "code, bytes", *motion)]
    for r in records:
        parts = [f"{r['stages'][stage]:.3f}" if stage in r["stages"] else "" for stage in stages]
        if moves:
            taken = (f"{r[name]:.3f}" for name in ("processor", "freedom", "first", "short"))
            motion = (*taken, f"{1e6 * r['steps']:.0f}", r["engine"], f"{1e6 * r['matrix']:.0f}")
        rows.append((r["tool"], f"{r['seconds']:.3f}", *parts, f"{r['code']:,}", *motion))
    return rows


def _quartiles(record: dict) -> str:
    return f"{1e9 * record['low']:.0f}-{1e9 * record['high']:.0f}" if "low" in record else ""


def _error(value: float | None) -> str:
    return "" if value is None else f"{value:.1e}"
