"""`ncgen compare`: kernels and derivatives by hand, generated, and by differentiation of every other kind; error beside time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ncgen.compiler import compile
from ncgen.model import Model
from ncgen.report.clock import Spread, measure
from ncgen.report.rivals import Inputs, Rival, all_rivals, by_differences, exact, relative_error, scale
from ncgen.report.rivals.base import KERNELS, differentiable
from ncgen.report.state_jacobian import StateJacobian

COMPARED = ("phi_q", "gamma", "mass")
TITLES = {
    "phi_q": "Φ_q, the Jacobian",
    "gamma": "γ, of the accelerations",
    "mass": "M, the mass matrix",
    "all": "Φ, Φ_q and γ together",
    "state": "∂ẏ/∂y of the state derivative",
}
NOISY = 0.3
"""Distance of the quartiles, relative to the median, from which a time is marked."""


def compare(model: Model, users: list[str] = ()) -> Iterator[tuple[str, list[dict]]]:
    """(kernel, records) for Φ_q, γ, M, for Φ, Φ_q and γ together, and for ∂ẏ/∂y, as far as the mechanism has them.

    users: functions of the user's own, see ncgen.report.rivals.user
    A record has kernel, tool, place ("C" or "Python": where the timing loop is), seconds, low, high (median and quartiles
    per call, of a batch per state), noisy, error (relative to the largest entry), ulps_max and ulps_rms (in ulps of what is
    added up in the entry), generation, compilation (seconds), operations, code (bytes); None where that is not known.
    """
    kernels = compile(model, "c")
    names = tuple(k for k in (*KERNELS, "mass") if k in kernels.programs.programs)
    if kernels.m and names:
        inputs = Inputs.typical(kernels)
        yield from _kernel_sections(model, kernels, inputs, names, list(users))
    yield from _state_section(kernels)


def _kernel_sections(model, kernels, inputs, names, users):
    found = all_rivals(model, inputs, names, users)
    spent = measure({(r.name, k): run for r in found for k, run in r.runs.items() if k in (*COMPARED, "all")})
    judges = {k: _Judge(kernels, k, inputs) for k in names}
    for kernel in (*COMPARED, "all"):
        parts = KERNELS if kernel == "all" else (kernel,)
        if not set(parts) <= set(names):
            continue
        records = [_record(r, kernel, spent[r.name, kernel], [judges[k](r) for k in parts]) for r in found if kernel in r.runs]
        yield kernel, sorted(records, key=lambda record: record["seconds"])


class _Judge:
    """What a kernel should give, found with 50 digits and, for derivatives, from Φ alone."""

    def __init__(self, kernels, kernel: str, inputs: Inputs):
        self.kernel = kernel
        alone = kernel in ("phi_q", "gamma") and differentiable(kernels)
        self.reference = (by_differences if alone else exact)(kernels, kernel, inputs)
        self.scale = scale(kernels, kernel, inputs)

    def __call__(self, rival: Rival) -> tuple[float, float, float]:
        """Relative error, largest and root mean square ulps."""
        value = rival.values(self.kernel)
        ulps = np.abs(value - self.reference) / self.scale / rival.epsilon
        return relative_error(value, self.reference), float(np.max(ulps)), float(np.sqrt(np.mean(ulps**2)))


def _record(rival: Rival, kernel: str, spread: Spread, errors) -> dict:
    error, largest, rms = (max(column) for column in zip(*errors, strict=True))
    each = rival.calls
    return {
        "kernel": kernel,
        "tool": rival.name,
        "place": rival.place,
        "seconds": spread.median / each,
        "low": spread.low / each,
        "high": spread.high / each,
        "noisy": spread.high - spread.low > NOISY * spread.median,
        "error": error,
        "ulps_max": largest,
        "ulps_rms": rms,
        "generation": rival.generation,
        "compilation": rival.compilation,
        "operations": rival.operations.get(kernel),
        "code": rival.code.get(kernel),
    }


def _state_section(kernels):
    state = StateJacobian(kernels)
    if not state.possible:
        return
    found = state.rivals()
    spent = measure({r.name: r.runs["state"] for r in found}, rounds=9)
    reference = state.exact()
    size = np.max(np.abs(reference), axis=1, keepdims=True) + np.finfo(float).tiny
    records = []
    for rival in found:
        value = rival.values("state")
        ulps = np.abs(value - reference) / size / rival.epsilon
        errors = relative_error(value, reference), float(np.max(ulps)), float(np.sqrt(np.mean(ulps**2)))
        records.append(_record(rival, "state", spent[rival.name], [errors]))
    yield "state", sorted(records, key=lambda record: record["seconds"])


# -- for people --------------------------------------------------------------------------------------------------------

HEAD = ("", "from C, ns", "from Python, µs", "quartiles", "ratio", "error", "ulps", "rms", "generated, s", "compiled, s", "operations", "bytes")


def table(records: list[dict]) -> list[tuple[str, ...]]:
    """Rows of cells, titles first; the ratio is to the quickest generated code in the table."""
    own = [r["seconds"] for r in records if r["tool"].startswith("generated")]
    rows = [HEAD]
    for r in records:
        unit = 1e9 if r["place"] == "C" else 1e6
        time = f"{unit * r['seconds']:.{0 if unit == 1e9 else 2}f}"
        spread = f"{unit * r['low']:.3g}-{unit * r['high']:.3g}" + (" noisy" if r["noisy"] else "")
        cells = [r["tool"], *((time, "") if r["place"] == "C" else ("", time)), spread, f"{r['seconds'] / min(own):.3g}"]
        cells += [f"{r['error']:.1e}", f"{r['ulps_max']:.2g}", f"{r['ulps_rms']:.2g}"]
        cells += ["" if r[key] is None else f"{r[key]:.2f}" for key in ("generation", "compilation")]
        rows.append((*cells, *("" if r[key] is None else str(r[key]) for key in ("operations", "code"))))
    return rows


def chart(records: list[dict], title: str):
    """Error against time, both logarithmic: the lower left corner is where one wants to be."""
    from ncgen.view.chart import GRID, empty

    figure = empty(8.0, 4.8)
    figure.set_layout_engine("constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel="seconds a call", ylabel="relative error", title=title)
    axes.grid(**GRID)
    axes.set_axisbelow(True)
    for number, r in enumerate(records):
        generated = r["tool"].startswith("generated")
        style = dict(color="#c8102e" if generated else "#30506b", marker="o" if r["place"] == "C" else "s")
        axes.plot(r["seconds"], max(r["error"], 1e-17), linestyle="", markersize=5, **style)
        axes.annotate(r["tool"], (r["seconds"], max(r["error"], 1e-17)), xytext=(4, 4 + 7 * (number % 3)), textcoords="offset points", fontsize=6)
    axes.margins(0.12)
    return figure
