"""Loads between bodies as a program: those of the body-by-body kernels, and complex steps."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import load
from ncgen.model.elements import Vector
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.motions.full_loads import assemble_loads, loaded_elements
from ncgen.solver.loads.reactions import reactions

COMPLEX = {name: getattr(np, f.numpy) for name, f in FUNCTIONS.items()}


@pytest.mark.parametrize("name", ["fourbar", "doublependulum", "suspension", "slidercrank3d"])
def test_loads_are_those_of_reactions(name):
    """Every force and moment at the end of a short motion; their changes along a direction are complex steps."""
    kernels = ncgen.compile(load(name))
    program, slope = assemble_loads(kernels.programs.equations)
    options = {k: v for k, v in kernels.model.simulation_options.items() if k in ("zd0", "z")}
    run = ncgen.simulate(kernels, 0.05, points=2, **options)
    known = reactions(run)
    state = [run.t[-1:], run.q[-1], run.qd[-1], run.qdd[-1], run.lam[-1], kernels.p0]
    names = ("t", "q", "qd", "qdd", "lam", "p")

    def inputs(values):
        return dict(zip(names, values, strict=True)) | {"t": values[0][0]}

    found = np.reshape(evaluate(program, inputs(state)), (-1, 3))
    expected = [
        known.moment(body.name, element.name)[-1] if isinstance(element, Vector) else known.force(body.name, element.name)[-1]
        for body, element in loaded_elements(kernels.programs.equations)
    ]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.max(np.abs(expected)))
    rng = np.random.default_rng(4)
    rates = [rng.standard_normal(len(x)) for x in state]
    dt, dq, dqd, dqdd, dlam, dp = rates
    moved = evaluate(program, inputs([x + 1e-30j * dx for x, dx in zip(state, rates, strict=True)]), functions=COMPLEX)
    wanted = np.imag(moved) / 1e-30
    more = {"seed": np.concatenate([dt, dq, dqd, dp]), "change": np.concatenate([dqd, dqdd, dlam])}
    np.testing.assert_allclose(evaluate(slope, inputs(state) | more), wanted, rtol=0, atol=1e-12 * np.max(np.abs(wanted)))
