"""Every example with its lengths and inertias as parameters, swept without another compile, beside models built with those numbers."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.data import with_data, with_data_as_parameters

import ncgen
from ncgen.exchange.examples import example_names
from ncgen.exchange.toml_reader import model_of
from ncgen.exchange.toml_writer import to_toml
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.runs.run import Initial
from ncgen.solver.runs.simulation_options import simulation_of
from ncgen.solver.runs.start import begin

NUMBER = r"(?<![\w\"*(.])-?\d+\.?\d*(?:e[+-]?\d+)?(?![\w\"*(.])"
"""A number of a model file that stands alone, in no expression."""

LENGTHS = {
    *(("point", "position"), ("body", "com"), ("rolling", "radius")),
    *(("distance", "length"), ("vector_segment", "length"), ("angle", "lengths")),
}
INERTIAS = {("body", "mass"), ("body", "inertia")}
SWEEP = (0.8, 1.0, 1.3)


def written(text, value):
    """A model file in whose lengths and inertias every number x is what `value` makes of it and of the name of its factor: the size of all,
    and the weight of each body."""
    bodies, table, found = 0, "", []
    for line in text.splitlines():
        if line.startswith("["):
            table = line.strip("[]")
            bodies += table == "body"
        key, _, rest = line.partition(" = ")
        factor = "size" if (table, key) in LENGTHS else f"weight{bodies}" if (table, key) in INERTIAS else None
        if factor:
            of_unit_vectors = "1.0" if key == "lengths" else None
            line = f"{key} = {re.sub(NUMBER, lambda x: x[0] if x[0] == of_unit_vectors else value(x[0], factor), rest)}"
        found.append(line)
    names = ["size", *(f"weight{k + 1}" for k in range(bodies))]
    return "\n".join(found), names


def factors(names, size):
    """{name: number}: a weight of its own for every body."""
    return {name: size if k == 0 else 1.0 + 0.1 * np.sin(k + 10 * size) for k, name in enumerate(names)}


def started(kernels, p):
    """Where the example starts, closed, with the rates that it has there."""
    given = {name: value for name, value in simulation_of(kernels.model).items() if name in ("zd0", "qd0", "z")}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return begin(kernels, Initial.from_arguments(kernels, p=p, **given), partitioned=False)


def accelerations_at(kernels, state):
    return accelerations_by("lagrange").motion(kernels, state.q, state.qd, 0.0, state.p, {}).qdd


def accelerations(kernels, p):
    return accelerations_at(kernels, started(kernels, p))


FLAT = ("delta", "flyball")
"""Bodies whose points lie in a plane but for rounding: with the size as a parameter ncgen cannot tell whether they always do, and says
so."""


@pytest.mark.slow
@pytest.mark.parametrize("name", example_names())
def test_a_sweep_without_compiling(name):
    """Accelerations at the closed start, to 1e-12 of the largest, at three sizes of the whole with other weights of every body."""
    text, names = written(to_toml(ncgen.load(name)), lambda x, factor: x if float(x) == 0 else f'"{factor}*({x})"')
    declared = "".join(f'[[parameter]]\nname = "{factor}"\ndefault = 1.0\n\n' for factor in names)
    first = text.index("[[")
    whole = text[:first] + declared + text[first:]
    if name in FLAT:
        with pytest.raises(
            ncgen.ModelError, match="lies on the line or in the plane of the body's other elements only at the default of size"
        ):
            model_of(whole, Path("swept.toml"))
        whole = re.sub(r'"size\*\(([^)]*)\)"', r"\1", whole)  # its inertias alone
    model = model_of(whole, Path("swept.toml"))
    swept = ncgen.compile(model)
    for size in SWEEP:
        chosen = factors(names, 1.0 if name in FLAT else size)
        plain = written(to_toml(ncgen.load(name)), lambda x, factor: repr(float(float(x) * chosen[factor])))[0]
        built = ncgen.compile(model_of(plain, Path("built.toml")), backend="numpy")
        wanted = accelerations(built, None)
        found = accelerations(swept, {factor: value for factor, value in chosen.items() if factor in swept.parameters})
        both = [name for name in swept.coordinates if name in built.index]  # helping vectors are taken where they are needed
        assert len(both) >= 0.9 * built.n
        mine, theirs = (x[[kernels.index[name] for name in both]] for x, kernels in ((found, swept), (wanted, built)))
        assert np.max(np.abs(mine - theirs)) <= 1e-12 * max(1.0, np.max(np.abs(theirs))), size


SIZED = ("bennett", "chain", "delta", "flyball")
"""They move, or their bodies are what they are, at special lengths alone: of these the size of the whole is the datum."""

ELSEWHERE = ("robot", "tree")
"""Their positions are not those of the lengths beside them, so that the start closes elsewhere. Both are compared where the built model
closes."""


class Others:
    """Other numbers for data, a hundredth aside, the moments of a body all by the same share; p: these as parameters."""

    def __init__(self, share):
        self.share, self.factors = share, {}

    def __call__(self, kind, number):
        key = (kind, abs(number))
        if key not in self.factors:
            alike = (factor for (other, _), factor in self.factors.items() if kind == other and kind.startswith("inertia"))
            self.factors[key] = next(alike, 1.0 + self.share * np.sin(1.0 + len(self.factors)))
        return number * self.factors[key]

    @property
    def p(self):
        return {f"datum_{k}": size * factor for k, ((_, size), factor) in enumerate(self.factors.items(), 1)}


def carried_over(kernels, state, built, there):
    """The state of another model without drivers, with the helping vectors that the rows here ask for."""
    q, qd = state.q.copy(), state.qd.copy()
    both = [name for name in kernels.coordinates if name in built.index]
    assert len(both) == built.n
    known, theirs = ([k.index[name] for name in both] for k in (kernels, built))
    q[known], qd[known] = there.q[theirs], there.qd[theirs]
    helping = np.setdiff1d(np.arange(kernels.n), known)
    for _ in range(5):
        q[helping] -= np.linalg.lstsq(kernels.phi_q(q, 0.0, state.p).toarray()[:, helping], kernels.phi(q, 0.0, state.p))[0]
    assert np.max(np.abs(kernels.phi(q, 0.0, state.p))) < 1e-12
    rows = kernels.phi_q(q, 0.0, state.p).toarray()
    qd[helping] = np.linalg.lstsq(rows[:, helping], -rows[:, known] @ qd[known])[0]
    return replace(state, q=q, qd=qd)


@pytest.mark.slow
@pytest.mark.parametrize("name", example_names())
def test_every_datum_is_swept_without_compiling(name):
    """Lengths, directions, inertia, springs and gravity, each by a share of its own: accelerations at the closed start are those of a model
    that was built with these numbers, to 1e-12 of the largest."""
    model, size_alone = ncgen.load(name), name in SIZED
    swept = ncgen.compile(with_data_as_parameters(model, size_alone), backend="numpy")
    for share in (-0.01, 0.0, 0.01):
        others = Others(share)
        built = ncgen.compile(with_data(model, others, size_alone), backend="numpy")
        there, here = started(built, None), started(swept, others.p)
        if name in ELSEWHERE:
            here = carried_over(swept, here, built, there)
        wanted, found = accelerations_at(built, there), accelerations_at(swept, here)
        assert name in ELSEWHERE or swept.coordinates == built.coordinates
        same = [swept.index[name] for name in built.coordinates]
        assert np.max(np.abs(found[same] - wanted)) <= 1e-12 * max(1.0, np.max(np.abs(wanted))), share
