"""Motions that are long to compile: each program is a file, and they move as they did in one."""

import subprocess

import numpy as np
import pytest
from benchmarks.arms import random_arm

import ncgen
from ncgen.mechanism import runtime_library
from ncgen.toolchain.compilers import DISABLED_PASSES, FLAGS, FLAGS_FOR_LONG_CODE, LONG_LINES, LONG_SOURCE, _groups, find_compiler


@pytest.fixture(scope="module")
def arm():
    return ncgen.compile(random_arm(12, 1))


def test_a_long_motion_is_what_the_equations_say(arm, tmp_path):
    """Its files move the arm as the dense matrix in Python does; in one header they compile, too."""
    start = {"zd0": {name: 0.4 for name in arm.model.chosen_independent}, "points": 2}
    run = ncgen.simulate(arm, 0.05, **start)
    expected = ncgen.simulate(arm, 0.05, formalism="lagrange", integrator="dop853", rtol=1e-10, engine="python", **start)
    assert run.engine == "emitted" and np.max(np.abs(run.q[-1] - expected.q[-1])) < 1e-7
    ncgen.export(arm.model, "c", tmp_path)
    assert {"random_arm_projected.c", "random_arm_projected_parts2.c", "random_arm_newton.c"} <= {
        path.name for path in (tmp_path / "src").iterdir()
    }
    (tmp_path / "one.c").write_text('#define RANDOM_ARM_IMPLEMENTATION\n#include "single/random_arm_single.h"\n')
    command = [*find_compiler().command, "-std=c99", "-O0", "-Wall", "-Werror", "-c", "one.c", "-o", "one.o"]
    subprocess.run(command, cwd=tmp_path, check=True)


def test_long_sources_are_compiled_side_by_side(monkeypatch):
    """One for each processor; short ones share a compiler unless they are many."""
    monkeypatch.setattr("os.cpu_count", lambda: 4)
    short = {f"{i}.c": 1000 for i in range(5)}
    assert len(_groups(short)) == 1
    assert sorted(map(len, _groups(short | {"a.c": LONG_SOURCE, "b.c": 3 * LONG_SOURCE}))) == [1, 6]
    assert len(_groups({f"{i}.c": LONG_SOURCE for i in range(9)})) == 4


def test_long_lines_are_compiled_with_what_they_need(monkeypatch):
    """All flags but -O3, and what of it a straight line gains by; short ones with -O3."""
    asked: list[set[str]] = []
    monkeypatch.setattr(runtime_library, "load", lambda files, declarations, base, flags, *table: asked.append(set(flags)))
    for length in (LONG_LINES, LONG_LINES + 1):
        runtime_library.load_with_headers({"lines.c": " " * length}, "double", "")
    assert asked[0] >= set(FLAGS)
    assert asked[1] - asked[0] == {"-O1", *FLAGS_FOR_LONG_CODE, *DISABLED_PASSES} and asked[0] - asked[1] == {"-O3"}
