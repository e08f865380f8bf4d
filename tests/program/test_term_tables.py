"""The generic kernels, which read a mechanism from a table, compute what its generated C computes."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.planar_models import Drawn
from oracles.term_tables import term_table

import ncgen
from ncgen.emit.c.generic import generic_files, types_source
from ncgen.errors import ModelError
from ncgen.symbolic.equations import build_equations
from ncgen.toolchain.abi import abi, declared
from ncgen.toolchain.loader import load

KERNELS = {
    "phi": lambda k, t, q, qd: k.phi(q, t),
    "phi_q": lambda k, t, q, qd: k.jacobian(q, t),
    "nu": lambda k, t, q, qd: k.nu(q, t),
    "gamma": lambda k, t, q, qd: k.gamma(q, qd, t),
    "mass": lambda k, t, q, qd: k.mass_matrix(q, t),
    "force": lambda k, t, q, qd: k.force(q, qd, t),
    "energy": lambda k, t, q, qd: k.energy(q, qd, t),
}
OF_VELOCITY = ("gamma", "force", "energy")
ROUNDING = 1e-13
"""Relative to the largest number of a kernel: sums of some dozen products in another order."""


class Generic:
    """The generic kernels in C."""

    def __init__(self) -> None:
        declarations = declared("ncgen_generic.h") + declared("ncgen_generic.h", "functions")
        self.ffi, self.library = load(generic_files(), declarations, abi())

    def is_table(self, table: np.ndarray) -> bool:
        return bool(self.library.ncgen_generic_is_table(self._pointer(table), len(table)))

    def kernel(self, name: str, table: np.ndarray, shape: tuple[int, ...], t: float, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        out = np.full(shape, np.nan)
        state = [self._pointer(q), *([self._pointer(qd)] if name in OF_VELOCITY else [])]
        assert getattr(self.library, f"ncgen_generic_{name}")(t, *state, self._pointer(table), self._pointer(out)) == 0
        return out

    def _pointer(self, array: np.ndarray) -> object:
        return self.ffi.from_buffer("double[]", array) if array.size else self.ffi.NULL


@pytest.fixture(scope="module")
def generic() -> Generic:
    return Generic()


def check(generic: Generic, kernels: ncgen.Kernels, seed: int = 1) -> None:
    """All kernels at a position beside the start, where constraints are violated."""
    table, random = term_table(kernels.programs.equations), np.random.default_rng(seed)
    assert generic.is_table(table)
    q, qd, t = kernels.q0 + 0.1 * random.standard_normal(kernels.n), random.standard_normal(kernels.n), 0.37
    for name, reference in KERNELS.items():
        wanted = reference(kernels, t, q, qd)
        found = generic.kernel(name, table, wanted.shape, t, q, qd)
        assert np.max(np.abs(found - wanted), initial=0.0) <= ROUNDING * np.max(np.abs(wanted), initial=1.0), name


@pytest.mark.parametrize("name", ["fourbar", "slidercrank", "andrews", "flyball"])
def test_examples_agree_with_their_generated_code(name, generic):
    check(generic, ncgen.compile(ncgen.load(name)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["jansen", "doublependulum", "nfourbar", "pendulum", "chain", "robot", "heavytop", "panels", "stewart", "bennett", "bricard", "tree"],
)
def test_more_examples_agree_with_their_generated_code(name, generic):
    check(generic, ncgen.compile(ncgen.load(name)))


@pytest.mark.parametrize("seed", [*range(2), *(pytest.param(k, marks=pytest.mark.slow) for k in range(2, 50))])
def test_random_planar_mechanisms_agree_with_their_generated_code(seed, generic):
    check(generic, ncgen.compile(Drawn(seed).model), seed)


def table_of(model: ncgen.Model) -> np.ndarray:
    return term_table(build_equations(model))


@pytest.mark.parametrize("name, where", [("cam", "the follower on the cam"), ("disc", "contact of disc"), ("cartpole", "motor")])
def test_what_no_type_describes_is_refused_by_its_name(name, where):
    with pytest.raises(ModelError, match=f"^{where}: "):
        table_of(ncgen.load(name))


def test_a_damaged_table_is_no_table(generic):
    """Whatever number of a table becomes one that is none, the check looks at it before a kernel does."""
    table = table_of(ncgen.load("fourbar"))
    assert generic.is_table(table)
    assert not generic.is_table(table[:-1]) and not generic.is_table(np.append(table, 0.0))
    for place, value in ((0, -1.0), (2, 1e9), (3, 99.0), (4, 99.0), (4, 0.5), (5, 4.0), (7, 1e6), (9, 5.0), (9, np.nan)):
        damaged = table.copy()
        damaged[place] = value
        assert not generic.is_table(damaged), (place, value)


def test_types_are_printed_the_same_every_time():
    assert types_source() == types_source()
