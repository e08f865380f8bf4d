"""`ncgen compare`: kernels and derivatives by hand, generated and by differences; error next to time."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ncgen.comparisons.rivals import Inputs, Others, Rival, all_rivals, by_differences, exact, nobody, relative_error, scale
from ncgen.comparisons.rivals.base import KERNELS, differentiable
from ncgen.compiler import compile
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.report.clock import Spread, is_noisy, measure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COMPARED = ("phi_q", "gamma", "mass")
TITLES = {"phi_q": "Φ_q, the Jacobian", "gamma": "γ, of the accelerations", "mass": "M, the mass matrix", "all": "Φ, Φ_q and γ together"}


def compare(model: Model, users: Sequence[str] = (), others: Others = nobody) -> Iterator[tuple[str, list[dict]]]:
    """(kernel, records) for Φ_q, γ, M, and for Φ, Φ_q and γ together, as far as the mechanism has them.

    users: functions of the user's own, see ncgen.comparisons.rivals.user; others: what else is set next to them
    A record has kernel, tool, language ("C" or "Python": that of the timing loop), seconds, low, high (median and quartiles
    per call, of a batch per state), noisy, error (relative to the largest entry), ulps_max and ulps_rms (in ulps of what is
    added up in the entry), generation, compilation (seconds), operations, code (bytes); None where that is not known.
    """
    kernels = compile(model, "c")
    names = tuple(k for k in (*KERNELS, "mass") if k in kernels.programs.programs)
    if not (kernels.m and names):
        return
    inputs = Inputs.typical(kernels)
    tools = all_rivals(model, inputs, names, list(users), others)
    spent = measure({(r.name, k): run for r in tools for k, run in r.runs.items() if k in (*COMPARED, "all")})
    judges = {k: _Judge(kernels, k, inputs) for k in names}
    for kernel in (*COMPARED, "all"):
        parts = KERNELS if kernel == "all" else (kernel,)
        if not set(parts) <= set(names):
            continue
        records = [record_of(r, kernel, spent[r.name, kernel], [judges[k](r) for k in parts]) for r in tools if kernel in r.runs]
        yield kernel, sorted(records, key=lambda record: record["seconds"])


class _Judge:
    """What a kernel should give, found with 50 digits and, for derivatives, from Φ alone."""

    def __init__(self, kernels: Kernels, kernel: str, inputs: Inputs) -> None:
        self.kernel = kernel
        alone = kernel in ("phi_q", "gamma") and differentiable(kernels)
        self.reference = (by_differences if alone else exact)(kernels, kernel, inputs)
        self.scale = scale(kernels, kernel, inputs)

    def __call__(self, rival: Rival) -> tuple[float, float, float]:
        return errors(rival, rival.values(self.kernel), self.reference, self.scale)


def errors(rival: Rival, value: np.ndarray, reference: np.ndarray, size: np.ndarray) -> tuple[float, float, float]:
    """Relative error, largest and root mean square ulps."""
    ulps = np.abs(value - reference) / size / rival.epsilon
    return relative_error(value, reference), float(np.max(ulps)), float(np.sqrt(np.mean(ulps**2)))


def record_of(rival: Rival, kernel: str, spread: Spread, errors: Sequence[tuple[float, float, float]]) -> dict:
    """found: what `errors` says of each part of the kernel."""
    error, largest, rms = (max(column) for column in zip(*errors, strict=True))
    return {
        "kernel": kernel,
        "tool": rival.name,
        "language": rival.language,
        **spread.seconds(rival.calls),
        "noisy": is_noisy(spread.low, spread.median, spread.high),
        "error": error,
        "ulps_max": largest,
        "ulps_rms": rms,
        "generation": rival.generation,
        "compilation": rival.compilation,
        "operations": rival.operations.get(kernel),
        "code": rival.code.get(kernel),
    }


def as_csv(records: list[dict]) -> str:
    """Records as a table for machines, a line each."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(dict.fromkeys(key for r in records for key in r)), lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return text.getvalue()


# -- for people --------------------------------------------------------------------------------------------------------

MIN_DRAWN_ERROR = 1e-20
"""The least error that is drawn: numbers without one have a place, too."""

HEAD = (
    "", "from C, ns", "from Python, µs", "quartiles", "ratio", "error", "ulps", "rms", "generated, s", "compiled, s", "operations",
    "bytes",
)  # fmt: skip


def table(records: list[dict]) -> list[tuple[str, ...]]:
    """Rows of cells, titles first; the ratio is to the quickest generated code in double."""
    seconds = [r["seconds"] for r in records if r["tool"].startswith("generated") and not r["tool"].endswith("float")]
    rows: list[tuple[str, ...]] = [HEAD]
    for number, r in enumerate(records, 1):
        unit = 1e9 if r["language"] == "C" else 1e6
        time = f"{unit * r['seconds']:.{0 if unit == 1e9 else 2}f}"
        spread = f"{unit * r['low']:.3g}-{unit * r['high']:.3g}" + (" noisy" if r["noisy"] else "")
        cells = [
            f"{number:2}  {r['tool']}",
            *((time, "") if r["language"] == "C" else ("", time)),
            spread,
            f"{r['seconds'] / min(seconds):.3g}",
        ]
        cells += [f"{r['error']:.1e}", f"{r['ulps_max']:.2g}", f"{r['ulps_rms']:.2g}"]
        cells += ["" if r[key] is None else f"{r[key]:.2f}" for key in ("generation", "compilation")]
        rows.append((*cells, *("" if r[key] is None else str(r[key]) for key in ("operations", "code"))))
    return rows


def figure(drawn: dict[str, list[dict]]) -> Figure:
    """Error against time of every tool, both logarithmic, a panel a title: the lower left corner is where one wants to be."""
    from ncgen.view.chart import GRID, empty

    chart = empty(9.0, 4.2 * max(len(drawn), 1))
    chart.set_layout_engine("constrained")
    for panel, (title, records) in enumerate(drawn.items(), 1):
        axes = chart.add_subplot(len(drawn), 1, panel, xscale="log", yscale="log", ylabel="relative error", title=title)
        axes.set_xlabel("time of a call (s)")
        axes.grid(**GRID)
        axes.set_axisbelow(True)
        for number, r in enumerate(records, 1):
            x, y = r["seconds"], max(r["error"], MIN_DRAWN_ERROR)
            generated = r["tool"].startswith("generated")
            axes.plot(x, y, "o" if r["language"] == "C" else "s", color="#c8102e" if generated else "#30506b", markersize=5)
            axes.annotate(str(number), (x, y), xytext=(0, 5 + 8 * (number % 2)), textcoords="offset points", fontsize=7, ha="center")
        names = "\n".join(f"{n}  {r['tool']}" for n, r in enumerate(records, 1))
        axes.text(1.02, 1.0, names, transform=axes.transAxes, fontsize=7, va="top")
        axes.margins(0.1)
        errors = [max(r["error"], MIN_DRAWN_ERROR) for r in records]
        axes.set_ylim(min(errors) / 30, max(errors) * 30)
    return chart
