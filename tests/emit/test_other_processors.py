"""The same bytes on every processor: BLAS, LAPACK and vectorised functions round differently there, which is played here."""

from __future__ import annotations

import random

import numpy as np
import pytest
import scipy.linalg

import ncgen
from ncgen.exchange.examples import load
from ncgen.model import arithmetic
from ncgen.program.programs import Programs
from ncgen.resources import folder
from ncgen.solver.engines import acceleration_forms

ROUNDED = {
    np.linalg: ("norm", "solve", "lstsq", "det", "svd", "eigvalsh", "inv"),
    np: ("dot", "sin", "cos", "tan", "exp", "einsum"),
    scipy.linalg: ("qr", "solve", "svd", "lu"),
}
EPS = float(np.finfo(float).eps)


def moved(value: object, draw: random.Random) -> object:
    """A result with its numbers moved by a rounding or two."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        return value * (1 + EPS * np.array([draw.choice((-2, 0, 2)) for _ in range(value.size)]).reshape(value.shape))
    if isinstance(value, float):
        return type(value)(value * (1 + EPS * draw.choice((-2, 0, 2))))
    if isinstance(value, tuple):
        parts = [moved(part, draw) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value


@pytest.fixture
def other_processor(monkeypatch):
    """Let functions that depend on the processor round differently."""
    draw = random.Random(4)
    for module, names in ROUNDED.items():
        for name in names:
            own = getattr(module, name)
            monkeypatch.setattr(module, name, lambda *a, own=own, **k: moved(own(*a, **k), draw))


@pytest.mark.parametrize("name", ["andrews", "bennett", "cam", "delta", "disc", "flyball", "robot", "stewart"])
def test_generated_sources(name, other_processor):
    """What was written elsewhere is what is written here."""
    kept = folder("templates").parent / "generated" / name
    assert {f: (kept / f).read_text(encoding="utf-8") for f in (f"{name}.c", f"{name}.h")} == {
        f: text for f, text in ncgen.generate(load(name)).files.items() if f in (f"{name}.c", f"{name}.h")
    }


@pytest.mark.parametrize("name", ["bennett", "bricard", "nfourbar", "suspension"])
def test_written_motions(name, other_processor, monkeypatch):
    """Equal pivots, sizes that are measured and constants that are seen are decided alike."""
    from ncgen.mechanism import recall

    def afresh(programs: Programs, kind: str, make):
        return make()

    monkeypatch.setattr(recall, "derived", afresh)

    def text() -> str:
        from ncgen.mechanism.motion_sources import motion_source

        kernels = ncgen.compile(load(name), backend="numpy")
        return "".join(motion_source(kernels, lambda: acceleration_forms.own_positions(kernels), "motion").values())

    rounded = text()
    monkeypatch.undo()
    monkeypatch.setattr(recall, "derived", afresh)
    assert len(rounded) > 1000 and rounded == text()


def test_weights_are_exact():
    """Least squares of vectors with small integers have the fractions that they have on paper."""
    assert arithmetic.weights([(1, 2, 2), (0, 3, 1)], (2, 7, 5)) == [2.0, 1.0]
    assert arithmetic.weights([(1, 1, 0)], (1, 0, 5)) == [0.5]
    assert arithmetic.weights([(3, 0, 0), (1, 3, 0), (1, 1, 3)], (1, 0, 0)) == [1 / 3, 0.0, 0.0]


def test_lengths_and_products():
    """No square overflows or vanishes; a sum that cancels keeps its digits."""
    assert arithmetic.norm((3.0, 4.0, 12.0)) == 13.0
    assert arithmetic.norm((3e200, 4e200, 0.0)) == pytest.approx(5e200, rel=1e-15)
    assert arithmetic.norm((3e-200, 4e-200)) == pytest.approx(5e-200, rel=1e-15)
    assert arithmetic.norm((0.0, 0.0)) == 0.0 and arithmetic.norm((np.inf, 1.0)) == np.inf
    assert arithmetic.dot((1e16, 1.0, -1e16), (1.0, 1.0, 1.0)) == 1.0
    turned = arithmetic.product(np.array([[0.0, -1.0], [1.0, 0.0]]), np.array([[1.0, 2.0], [3.0, 4.0]]))
    assert turned.tolist() == [[-3.0, -4.0], [1.0, 2.0]]
