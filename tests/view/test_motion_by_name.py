"""What a motion gives by name: accelerations, velocities of points, tables, plots over another quantity, and films.

A rod turned by a driver, φ = ω t: its end is at L (cos φ, sin φ), moves at L ω (−sin φ, cos φ), and is accelerated by −ω² times its place.
"""

from __future__ import annotations

import importlib
import os
import stat
import sys

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ModelError, NcgenError
from ncgen.view.film import film_instants

L, OMEGA = 0.5, 3.0


@pytest.fixture(scope="module")
def run():
    m = Model("rod")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (L, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("bar", [A, B], mass=1.0, inertia=1 / 48)
    phi = m.angle("phi", start=x, end=B - A, axis=z)
    m.drive(phi, OMEGA * m.time)
    m.output("height", B.y.symbol, "m")
    return ncgen.simulate(ncgen.compile(m, "numpy"), 0.4, points=9, engine="python", formalism="lagrange")


def test_accelerations_by_name(run):
    turned = OMEGA * run.t
    np.testing.assert_allclose(run["rate(rate(B.x))"], -L * OMEGA**2 * np.cos(turned), atol=1e-8)
    np.testing.assert_allclose(run["rate(rate(phi))"], 0.0, atol=1e-8)
    assert "rate(rate(B.x))" in run and "rate(rate(B.q))" not in run
    with pytest.raises(ModelError, match="rod has no free coordinate B.q"):
        run["rate(rate(B.q))"]
    with pytest.raises(ModelError, match=r"rod has no free coordinate rate\(B.x\)"):
        run["rate(rate(rate(B.x)))"]


def test_velocity_and_acceleration_of_a_point(run):
    turned, zero = OMEGA * run.t, np.zeros_like(run.t)
    np.testing.assert_allclose(run.velocity("B"), L * OMEGA * np.column_stack([-np.sin(turned), np.cos(turned), zero]), atol=1e-7)
    np.testing.assert_allclose(run.acceleration("B"), -(OMEGA**2) * run.point("B"), atol=1e-7)
    assert not run.velocity("A").any() and not run.acceleration("x").any()
    with pytest.raises(ModelError, match="rod has no point or vector C; it has A, B, x, z"):
        run.velocity("C")


def test_the_table(run):
    """Everything that has a name, as columns of one length; with pandas as a DataFrame over the time."""
    table = run.table()
    assert list(table) == ["t", "B.x", "B.y", "phi", *(f"rate({c})" for c in ("B.x", "B.y", "phi")), "height",
                           *(f"rate(rate({c}))" for c in ("B.x", "B.y", "phi"))]  # fmt: skip
    assert all(np.array_equal(column, run.t if name == "t" else run[name]) for name, column in table.items())
    pandas = pytest.importorskip("pandas")
    frame = run.dataframe()
    assert isinstance(frame, pandas.DataFrame) and frame.index.name == "t"
    assert np.array_equal(frame["rate(phi)"], run["rate(phi)"]) and np.array_equal(frame.index, run.t)


def test_without_pandas(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(NcgenError, match=r"pandas is not installed; pip install 'ncgen\[tables\]', or take run.table\(\)"):
        run.dataframe()


def test_a_plot_over_another_quantity(run, tmp_path):
    (axes,) = run.plot(names="B.y", against="B.x").axes
    line = axes.get_lines()[0]
    assert np.array_equal(line.get_xdata(), run["B.x"]) and np.array_equal(line.get_ydata(), run["B.y"])
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("B.x", "B.y", "rod")
    (axes,) = run.plot(names=["height", "rate(B.x)"], against="phi").axes
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["height", "rate(B.x)"]
    assert run.plot(tmp_path / "over.svg", names="B.y", against="B.x").stat().st_size > 1000
    with pytest.raises(ModelError, match="no free coordinate psi"):
        run.plot(names="B.y", against="psi")


def test_pictures_of_a_film_are_even_in_time():
    """Instants that are not: most of them in the first tenth."""
    t = np.r_[np.linspace(0, 0.1, 91), np.linspace(0.2, 1.0, 9)]
    chosen = film_instants(t)
    assert len(chosen) == 26 and (chosen[0], chosen[-1]) == (0, len(t) - 1)
    assert np.all(np.diff(chosen) >= 0) and np.max(np.abs(t[chosen] - np.linspace(0, 1, 26))) <= 0.05
    assert len(film_instants(np.linspace(0, 1000, 9999))) == 250


def test_a_gif_lasts_as_long_as_the_motion(run, tmp_path):
    image = importlib.import_module("PIL.Image")
    path = run.animate(tmp_path / "rod.gif")
    with image.open(path) as film:
        assert film.format == "GIF" and film.info["loop"] == 0
        lengths = []
        for k in range(film.n_frames):
            film.seek(k)
            lengths.append(film.info["duration"])
    assert sum(lengths) == pytest.approx(400 * len(lengths) / (len(lengths) - 1), rel=0.05)
    assert path.read_bytes() == run.animate(tmp_path / "again.gif").read_bytes()


def test_an_mp4_is_made_of_the_pictures_by_ffmpeg(run, tmp_path, monkeypatch):
    """A program in the place of ffmpeg takes as many pictures as a film has."""
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(NcgenError, match="there is no program ffmpeg to write an .mp4; install it, or write a .gif or .html"):
        run.animate(tmp_path / "rod.mp4")
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\nexec /usr/bin/env PATH=/usr/bin:/bin grep -a -o -c 'IHDR' -\n", encoding="utf-8")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    assert int(run.animate(tmp_path / "rod.mp4").read_bytes()) >= len(set(film_instants(run.t)))
    program.write_text("#!/bin/sh\necho 'no codec' >&2\nexit 1\n", encoding="utf-8")
    with pytest.raises(NcgenError, match="ffmpeg writes no film: no codec; write a .gif or .html"):
        run.animate(tmp_path / "other.mp4")
    assert os.listdir(tmp_path) and not (tmp_path / "other.mp4").exists()
