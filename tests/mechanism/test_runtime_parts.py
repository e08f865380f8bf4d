"""The runtime comes in two parts: most runs take the one without implicit methods, which is half as long to compile."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import ncgen
from ncgen.emit.runtime import explicit_names, runtime_names
from ncgen.mechanism import runtime
from ncgen.methods.table import AUTO, INTEGRATORS

PROGRAM = """
import sys
import ncgen
from ncgen.mechanism import runtime

asked, once = [], runtime._runtime
runtime._runtime = lambda number, part: asked.append(part) or once(number, part)
kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")
ncgen.simulate(kernels, 0.1, engine="c", **eval(sys.argv[1]))
print(*sorted(set(asked)))
"""


@pytest.mark.parametrize(("given", "parts"), [("{}", "explicit"), ("{'integrator': 'radau'}", "whole")])
def test_a_run_takes_the_part_that_it_needs(given, parts):
    assert subprocess.run([sys.executable, "-c", PROGRAM, given], capture_output=True, text=True, check=True).stdout.split() == [parts]


def test_the_part_without_implicit_methods_is_smaller():
    left_out = set(runtime_names()) - set(explicit_names())
    assert {"ncgen_radau.c", "ncgen_rattle.c", "ncgen_jacobian.c"} <= left_out
    assert not {"ncgen_run.c", "ncgen_explicit.c", "ncgen_driven.c", "ncgen_tree.c"} & left_out


@pytest.mark.parametrize("name", [name for name, entry in INTEGRATORS.items() if entry.in_c])
def test_explicit_methods_have_the_same_bits_in_both_and_others_are_refused(name, robot, monkeypatch):
    assert runtime.part_for(name) == ("explicit" if INTEGRATORS[name].tableau else "whole")
    assert runtime.part_for(AUTO) == "explicit"
    found = {}
    for part in ("explicit", "whole"):
        monkeypatch.setattr(runtime, "part_for", lambda _, part=part: part)
        try:
            found[part] = ncgen.simulate(robot, 0.01, formalism=_formalism(name), integrator=name, max_step=1e-3, points=3, engine="c").q
        except ncgen.NcgenError as error:
            found[part] = str(error)
    if INTEGRATORS[name].tableau:
        assert np.array_equal(found["explicit"], found["whole"])
    else:
        assert isinstance(found["explicit"], str) and not isinstance(found["whole"], str)


def _formalism(integrator: str) -> str:
    return "ali3p" if INTEGRATORS[integrator].steps == ("ali3p",) else "lagrange" if INTEGRATORS[integrator].steps else "null-space"
