"""A linearisation as a header in C: what a compiler reads from it are the same numbers, at places with the same names."""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import pytest

import ncgen
from ncgen.errors import NcgenError

pytestmark = pytest.mark.skipif(not shutil.which("cc"), reason="compiles with cc")

PROGRAM = """
#include <stdio.h>
#include "near_upright.h"
#define PRINT(m) for (unsigned i = 0; i < sizeof m / sizeof m[0]; ++i) \\
    for (unsigned j = 0; j < sizeof m[0] / sizeof m[0][0]; ++j) printf("%.17g\\n", m[i][j])
int main(void)
{
    PRINT(near_upright_A); PRINT(near_upright_B); PRINT(near_upright_C); PRINT(near_upright_D);
    printf("%g\\n", near_upright_A[NEAR_UPRIGHT_STATE_RATE_PHI][NEAR_UPRIGHT_STATE_PHI]);
    return 0;
}
"""


def test_a_compiler_reads_the_same_numbers(tmp_path):
    near = ncgen.linearise(ncgen.compile(ncgen.load("cartpole")))
    assert near.to_c(tmp_path / "near_upright.h") == tmp_path / "near_upright.h"
    (tmp_path / "main.c").write_text(PROGRAM)
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    subprocess.run(["cc", *flags, "main.c", "-o", "main"], cwd=tmp_path, check=True)
    *found, last = map(float, subprocess.run(["./main"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout.split())
    assert found == np.concatenate([near.A.ravel(), near.B.ravel(), near.C.ravel(), near.D.ravel()]).tolist()
    expected = near.A[near.states.index("rate(phi)"), near.states.index("phi")]
    assert last == pytest.approx(expected, rel=1e-5) and expected != 0.0


@pytest.mark.filterwarnings("ignore:.*neither rest in equilibrium")
def test_without_inputs_there_is_a_alone(tmp_path):
    near = ncgen.linearise(ncgen.compile(ncgen.load("pendulum")))
    with pytest.raises(NcgenError, match="^output: 3 given; name a file$"):
        near.to_c(3)
    text = near.to_c(tmp_path / "swing.h").read_text()
    assert "swing_A[2][2]" in text and "swing_B" not in text and "swing_D" not in text
