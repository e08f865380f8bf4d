"""The runtime's factors of a quasidefinite matrix, called from C: pivots of the right sign are kept, others replaced."""

from __future__ import annotations

import subprocess

import pytest

from ncgen.emit.runtime_files import needed_by, runtime_files

DRIVER = r"""
#include <stdio.h>
#include "ncgen_sparse.h"
/* [a b; b c]: a coordinate, whose pivots are positive, and a row, whose are negative. */
static const int order[] = {0, 1}, row_start[] = {0, 0, 1}, row_columns[] = {0}, row_positions[] = {0};
static const int column_start[] = {0, 1, 1}, column_rows[] = {1};
static const int entry_start[] = {0, 1, 2}, entry_columns[] = {0, 0}, entry_values[] = {0, 1};
int main(void)
{
    const ncgen_elimination plan = {2, 1, order, row_start, row_columns, row_positions, column_start, column_rows,
                                    entry_start, entry_columns, entry_values};
    double numbers[32] = {0}, c, right[2], x[2];
    ncgen_space space = {numbers, 0};
    ncgen_kkt k;
    ncgen_kkt_layout(&k, &plan, 2, &space);
    k.min_pivot[0] = 0.5, k.min_pivot[1] = -0.5;
    k.replacement[0] = 8, k.replacement[1] = -1e30;
    if (scanf("%lf %lf %lf %lf %lf", &k.values[0], &k.values[1], &c, &right[0], &right[1]) != 5) return 9;
    k.diagonal[1] = c;
    const int status = ncgen_kkt_factor(&k);
    ncgen_kkt_solve(&k, right, x);
    printf("%.17g %.17g %ld\n", x[0], x[1], k.perturbed);
    return status;
}
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sparse")
    names = needed_by("ncgen_sparse.c")
    for name, text in runtime_files(*names).items():
        (folder / name).write_text(text)
    (folder / "main.c").write_text(DRIVER)
    sources = [name for name in names if name.endswith(".c")]
    subprocess.run(["cc", "-std=c99", "-O0", "main.c", *sources, "-o", "main", "-lm"], cwd=folder, check=True)
    return folder / "main"


@pytest.mark.parametrize(
    ("numbers", "expected", "replaced"),
    [
        ((4, 2, -3, 8, 0), (1.5, 1), 0),  # [4 2; 2 -3] x = [8, 0]: pivots 4 and -4
        ((-4, 2, -3, 8, 1), (13 / 14, 2 / 7), 1),
        ((0.25, 0, -3, 8, 6), (1, -2), 1),
        ((4, 2, 3, 8, 0), (2, 0), 0),
        ((4, 2, 0.75, 8, 0), (2, 0), 0),
    ],
    ids=["right signs", "a negative mass", "hardly a mass", "a row of the wrong sign", "hardly a row"],
)
def test_pivots(program, numbers, expected, replaced):
    """Solutions by hand: a replaced mass is 8 and counted, a replaced row has a multiplier of zero."""
    done = subprocess.run([program], input=" ".join(map(str, numbers)), capture_output=True, text=True, check=True)
    *x, perturbed = map(float, done.stdout.split())
    assert x == pytest.approx(expected, abs=1e-12) and perturbed == replaced
