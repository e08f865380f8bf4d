"""The runtime comes in parts: most runs take the one without implicit methods, partitioning and tables, a third of it to compile."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import ncgen
from ncgen.emit.runtime_files import explicit_names, ordinary_names, runtime_names, stiff_names
from ncgen.exchange.examples import example_module
from ncgen.mechanism import prepared_run, runtime_library
from ncgen.methods.table import AUTO, INTEGRATORS
from ncgen.solver.engines.acceleration_forms import expected_component
from ncgen.solver.runs.simulation_options import check_simulation

PROGRAM = """
import sys
import ncgen
from ncgen.mechanism import prepared_run, runtime_library

asked, once = [], runtime_library.runtime_of
prepared_run.runtime_of = runtime_library.runtime_of = lambda number, part: asked.append(part) or once(number, part)
kernels = ncgen.compile(ncgen.load("robot"), backend="c")
ncgen.simulate(kernels, 0.1, **eval(sys.argv[1]))
print(*sorted(set(asked)))
"""


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        ("{}", ["ordinary"]),
        ("{'integrator': 'radau'}", ["stiff"]),
        ("{'formalism': 'coordinate-partitioning'}", ["explicit"]),
        ("{'integrator': 'rattle', 'max_step': 0.01}", ["whole"]),
    ],
)
def test_a_run_takes_the_part_that_it_needs(given, parts):
    assert subprocess.run([sys.executable, "-c", PROGRAM, given], capture_output=True, text=True, check=True).stdout.split() == parts


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ({}, "ordinary"),
        ({"integrator": "radau"}, "stiff"),
        ({"formalism": "coordinate-partitioning"}, "explicit"),
        ({"engine": "c"}, "explicit"),
        ({"integrator": "rattle", "max_step": 0.01}, "whole"),
    ],
)
def test_the_part_is_known_before_the_kernels_are(options, part):
    """`ncgen run` compiles it while they are derived: the parts of the runs above, and of a long arm that of loops over tables."""
    robot, quadruped, arm = ncgen.load("robot"), ncgen.load("quadruped"), example_module("arm").build(21)
    for model in (robot, quadruped):
        assert expected_component(model, check_simulation(model, **options)) == part
    tree = {"ordinary": "ordinary tree", "stiff": "stiff tree"}.get(part, part)
    assert expected_component(arm, check_simulation(arm, **options)) == tree


def test_the_part_without_implicit_methods_is_smaller():
    left_out = set(runtime_names()) - set(explicit_names())
    assert {"ncgen_radau.c", "ncgen_rattle.c", "ncgen_jacobian.c"} <= left_out
    assert not {"ncgen_run.c", "ncgen_explicit.c", "ncgen_driven.c", "ncgen_tree.c"} & left_out


def test_the_ordinary_part_and_that_for_stiff_mechanisms_have_what_they_need_alone():
    ordinary, stiff = set(ordinary_names()), set(stiff_names())
    assert not {"ncgen_tree.c", "ncgen_partitioning.c", "ncgen_driven.c", "ncgen_radau.c"} & ordinary
    assert {"ncgen_radau.c", "ncgen_reduced.c"} <= stiff
    assert not {"ncgen_tree.c", "ncgen_partitioning.c", "ncgen_rattle.c", "ncgen_ali3p.c", "ncgen_correction.c"} & stiff


@pytest.mark.parametrize("name", [name for name, entry in INTEGRATORS.items() if entry.in_c])
def test_explicit_methods_have_the_same_bits_in_both_and_others_are_refused(name, robot, monkeypatch):
    assert runtime_library.part_for(name) == ("explicit" if INTEGRATORS[name].tableau else "whole")
    assert runtime_library.part_for(AUTO) == "explicit"
    found = {}
    for part in ("explicit", "whole"):
        monkeypatch.setattr(prepared_run, "part_for", lambda *_, part=part: part)
        try:
            given = {"formalism": _formalism(name), "integrator": name, "max_step": 1e-3, "points": 3, "engine": "c"}
            found[part] = ncgen.simulate(anew(robot), 0.01, **given).q
        except ncgen.NcgenError as error:
            found[part] = str(error)
    if INTEGRATORS[name].tableau:
        assert np.array_equal(found["explicit"], found["whole"])
    else:
        assert isinstance(found["explicit"], str) and not isinstance(found["whole"], str)


@pytest.mark.parametrize(("name", "part"), [("dop853", "ordinary"), ("radau", "stiff")])
def test_a_small_part_has_the_bits_of_the_whole(name, part, robot, monkeypatch):
    assert runtime_library.part_for(name, "emitted") == part
    found = []
    for taken in (part, "whole"):
        monkeypatch.setattr(prepared_run, "part_for", lambda *_, taken=taken: taken)
        found.append(ncgen.simulate(anew(robot), 0.1, formalism="lagrange", integrator=name, points=3, engine="auto"))
    assert {run.engine for run in found} == {"emitted"} and np.array_equal(found[0].q, found[1].q)


@pytest.mark.parametrize(("name", "part"), [("dop853", "ordinary tree"), ("radau", "stiff tree")])
def test_a_small_part_for_trees_has_the_bits_of_the_whole(name, part, monkeypatch):
    assert runtime_library.part_for(name, "tree") == part
    kernels, found = ncgen.compile(example_module("arm").build(21), backend="c"), []
    for taken in (part, "whole"):
        monkeypatch.setattr(prepared_run, "part_for", lambda *_, taken=taken: taken)
        found.append(ncgen.simulate(anew(kernels), 0.05, formalism="lagrange", integrator=name, points=3))
    assert {run.engine for run in found} == {"tree"} and np.array_equal(found[0].q, found[1].q)


@pytest.mark.parametrize(
    "given", [{"formalism": "coordinate-partitioning"}, {"formalism": "lagrange", "integrator": "rattle", "max_step": 0.01}]
)
def test_a_small_part_refuses_what_it_has_not(given, robot, monkeypatch):
    monkeypatch.setattr(prepared_run, "part_for", lambda *_: "ordinary")
    with pytest.raises(ncgen.NcgenError):
        ncgen.simulate(anew(robot), 0.1, engine="c", **given)


def anew(kernels: ncgen.Kernels) -> ncgen.Kernels:
    """Other kernels of a mechanism: those that have run keep the part that they took."""
    return ncgen.compile(kernels.model, backend="c")


def _formalism(integrator: str) -> str:
    return "ali3p" if INTEGRATORS[integrator].steps == ("ali3p",) else "lagrange" if INTEGRATORS[integrator].steps else "null-space"
