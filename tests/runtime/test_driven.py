"""A motion that goes on from call to call in C: its workspace fits the arrays that exports give it."""

from __future__ import annotations

import pytest
from every_example import EVERY

import ncgen
from ncgen.emit.runtime_files import row_vectors, runtime_text, widest_tableau
from ncgen.mechanism.moving import Moving, Stepping
from ncgen.methods.method import Method
from ncgen.solver.engines import acceleration_forms, capabilities
from ncgen.solver.positions.rank import freedom


def most(n: int, m: int, nonzeros: int, factor: int, vectors: int, width: int, p_copy: int) -> int:
    """NCGEN_DRIVEN_WORKSPACE, read from the header."""
    text = runtime_text("ncgen_driven.h").split("#define NCGEN_DRIVEN_WORKSPACE")[1]
    formula = text[text.index("\\") + 1 : text.index("\n\n")].strip()
    return eval(formula, {"NCGEN_GAPS": 0}, locals())  # parts have gaps between them under AddressSanitizer alone


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("method", ["dop853", "rk4"])
def test_workspace(name, method):
    kernels = ncgen.compile(ncgen.load(name))
    if capabilities.refusal(kernels, Method.of("lagrange", method), "c", "double"):
        pytest.skip("it does not run in C")
    for form in ("dense", "emitted"):
        dynamics = acceleration_forms.all_coordinates(kernels, form=form)
        rank = freedom(kernels).rank
        moving = Moving(Stepping(dynamics, method, rank, 1e-8, 1e-10, None, 1e-12))
        prepared = dynamics.prepared
        p_copy = len(kernels.p0) + prepared if prepared else 0
        nonzeros = kernels.mass_pattern.nonzeros + kernels.phi_q_pattern.nonzeros
        bound = most(kernels.n, kernels.m, nonzeros, dynamics.plan.nonzeros, row_vectors(kernels.m, rank), widest_tableau(), p_copy)
        assert moving.workspace <= bound
        if form == "emitted" and method == "dop853" and dynamics.is_emitted:
            assert moving.workspace == bound  # nothing is given away where all of it is used
