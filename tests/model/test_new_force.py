"""A force element that somebody adds, as docs/contributing.md does: an entry and a builder method, and nothing else knows of it."""

from __future__ import annotations

import re
from pathlib import Path

import mpmath
import numpy as np
import pytest

import ncgen
from ncgen.exchange import words
from ncgen.exchange.toml_reader import load_toml
from ncgen.exchange.toml_writer import to_toml
from ncgen.model import forces, loads
from ncgen.view.figure import figure

FILE = """
name = "oscillator"

[[point]]
name = "wall"
position = [0, 0]
fixed = true

[[point]]
name = "mass"
position = [1.3, 0]
fixed = "y"

[[body]]
name = "bob"
points = ["mass"]
mass = 2.0

[[parameter]]
name = "k3"
default = 300.0

[[cubic_spring]]
start = "wall"
end = "mass"
stiffness = 20.0
cubic = "k3"
damping = 0.4
free_length = 1.0
"""

K, K3, C, FREE, MASS = 20.0, 300.0, 0.4, 1.0, 2.0
GUIDE = Path(__file__).resolve().parents[2] / "docs" / "contributing.md"


@pytest.fixture(autouse=True)
def added(monkeypatch):
    """The guide's two texts, each at its place in the package."""
    section = GUIDE.read_text(encoding="utf-8").partition("## A force element")[2].partition("\n## ")[0]
    entry, method = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    places = vars(forces) | vars(loads)
    for text in (entry, method):
        exec("from __future__ import annotations\n" + text, places)
    monkeypatch.setattr(ncgen.Model, "cubic_spring", places["cubic_spring"], raising=False)
    words.words.cache_clear()
    yield
    words.words.cache_clear()
    words.signature_of.cache_clear()


def oscillator(damping):
    """A mass on a line, held by the new spring, and a second point beside it that it does not act on."""
    m = ncgen.Model("oscillator")
    wall, mass = m.point("wall", (0, 0), fixed=True), m.point("mass", (1.3, 0), fixed="y")
    m.body("bob", [mass], mass=MASS)
    m.cubic_spring(wall, mass, K, m.parameter("k3", K3), damping, FREE)
    return m


def test_its_force_energy_and_power_are_those_of_the_formula():
    """Tension k s + k3 s³ + c ṡ, energy k s²/2 + k3 s⁴/4, power −c ṡ², in the kernels of both languages."""
    s, v = 0.37, -0.8
    for backend in ("numpy", "auto"):
        kernels = ncgen.compile(oscillator(C), backend=backend)
        assert kernels.force([FREE + s], [v]) == pytest.approx([-(K * s + K3 * s**3 + C * v)], rel=1e-14)
        assert kernels.energy([FREE + s], [v]) == pytest.approx([MASS * v**2 / 2, K * s**2 / 2 + K3 * s**4 / 4, -C * v**2], rel=1e-14)
        assert kernels.stiffness([FREE + s], [v], [0.0], []).toarray() == pytest.approx(np.array([[K + 3 * K3 * s**2]]), rel=1e-14)


def test_its_motion_is_duffings():
    """s = A cn(ω t, m) with ω² = (k + k3 A²)/M and m = k3 A²/(2 M ω²); the energy stays."""
    A = 0.3
    omega = np.sqrt((K + K3 * A**2) / MASS)
    run = ncgen.simulate(ncgen.compile(oscillator(0.0), backend="numpy"), 2.0, rtol=1e-11, atol=1e-12, points=9)
    expected = [A * float(mpmath.ellipfun("cn", omega * t, m=K3 * A**2 / (2 * MASS * omega**2))) for t in run.t]
    assert run.point("mass")[:, 0] - FREE == pytest.approx(expected, abs=1e-9)
    assert run.energy_drift < 1e-9 and not np.any(run.work)


def test_a_file_says_it(tmp_path):
    """The word is the method's, its keys are the arguments; a model that was written and read gives the same code."""
    path = tmp_path / "oscillator.toml"
    path.write_text(FILE)
    files = ncgen.generate(oscillator(C)).files
    assert ncgen.generate(load_toml(path)).files == files
    path.write_text(to_toml(oscillator(C)))
    assert ncgen.generate(load_toml(path)).files == files
    path.write_text(path.read_text().replace("damping =", "dampin ="))
    with pytest.raises(ncgen.ModelError, match=r"oscillator\.toml, line \d+: .*did you mean damping"):
        load_toml(path)


def test_it_is_drawn_and_told_and_carried():
    """A dashed line between its ends, its law in listings, and its pull in the loads of a joint that holds the point."""
    m = oscillator(C)
    assert [line.get_gid() for line in figure(m).axes[0].lines].count("spring") == 1
    (term,) = [term for term in ncgen.compile(m, backend="numpy").programs.equations.forces if term.equation]
    assert term.equation.endswith("damper c with a = mass-wall, k = 20, k3 = k3, c = 0.4, L0 = 1")
    m = ncgen.Model("held")
    wall, hinge, end = m.point("wall", (0, 1), fixed=True), m.point("hinge", (0, 0), fixed=True), m.point("end", (2, 1))
    m.body("bar", [hinge, end], mass=1e-9, com=hinge.initial, inertia=1e9)
    m.cubic_spring(wall, end, K, K3, 0.0, FREE)
    run = ncgen.simulate(ncgen.compile(m, backend="numpy"), 1e-3, points=2)
    assert run.reactions().force("bar", "hinge")[0] == pytest.approx([K + K3, 0, 0], rel=1e-6)
