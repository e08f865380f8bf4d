"""Pictures as SVG text: where things are drawn."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from ncgen.model import Model
from ncgen.program.ir.blocks import Pattern
from ncgen.view import curve_pictures, sketch
from ncgen.view.curve_pictures import curves as drawn
from ncgen.view.scene import scene_of
from ncgen.view.spots import MAX_CELLS, spots
from ncgen.view.svg import SvgDrawing, below_each_other

SVG = "{http://www.w3.org/2000/svg}"


def lines(drawing: SvgDrawing) -> list[list[np.ndarray]]:
    """Of every path its pieces, (K, 2) each."""
    paths = [path.get("d") for path in ElementTree.fromstring(str(drawing)).iter(f"{SVG}path")]
    return [[np.array(re.findall(r"-?[\d.]+", piece), dtype=float).reshape(-1, 2) for piece in d.split("M")[1:]] for d in paths]


def test_a_planar_scene_keeps_its_shape():
    """Distances on the screen are those of the mechanism by one scale, up is up, and all lies within the picture."""
    m = Model("triangle")
    points = [m.point("A", (0, 0), fixed=True), m.point("B", (3, 0)), m.point("C", (3, 4))]
    m.line(*points)
    (path,) = lines(sketch.sketch(scene_of(m)))
    (ab, bc) = path
    assert np.linalg.norm(bc[1] - bc[0]) / np.linalg.norm(ab[1] - ab[0]) == pytest.approx(4 / 3, abs=0.01)
    assert bc[1, 1] < bc[0, 1] and ab[1, 0] > ab[0, 0]
    assert (np.vstack(path) >= 0).all() and (np.vstack(path) <= [sketch.WIDTH, sketch.HEIGHT]).all()


def test_what_cannot_move_is_square_and_springs_are_dashed():
    m = Model("springs")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("bob", points=[B], mass=1.0)
    m.spring(A, B, stiffness=1.0, free_length=1.0)
    svg = ElementTree.fromstring(str(sketch.sketch(scene_of(m))))
    assert len(list(svg.iter(f"{SVG}rect"))) == len(list(svg.iter(f"{SVG}circle"))) == 1
    (path,) = svg.iter(f"{SVG}path")
    assert path.get("stroke-dasharray")


def test_curves_are_where_their_numbers_are():
    """From the lower left corner to the upper right one, and half way between; broken where there is no number."""
    t = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    frame, (up,), broken = lines(drawn(t, {"up": t - 1.0, "broken": np.array([0.0, 1.0, np.nan, 1.0, 2.0])}, "s (m)"))
    corner, low, right = frame[0]
    assert up[0] == pytest.approx([low[0], low[1]]) and up[-1] == pytest.approx([right[0], corner[1]])
    assert up[2] == pytest.approx((up[0] + up[-1]) / 2, abs=0.06)
    assert [len(piece) for piece in broken] == [2, 2]


@pytest.mark.parametrize("values", [np.zeros(3), np.full(3, 5.0), np.full(3, np.nan), np.array([1e300, -1e300, 0.0])])
def test_curves_of_odd_numbers(values):
    for path in lines(drawn(np.array([0.0, 1.0, 2.0]), {"odd": values}, "q")):
        for piece in path:
            assert np.isfinite(piece).all() and (piece >= 0).all() and (piece <= curve_pictures.WIDTH).all()


def test_spots_share_cells_where_there_are_many():
    """A diagonal of 10,000 becomes one of at most a hundred cells."""
    n = 10_000
    drawn_cells = spots(Pattern((n, n), tuple(range(n + 1)), tuple(range(n))), "diagonal").content
    cells = re.findall(r"M(\d+) (\d+)h", drawn_cells)
    assert len(cells) == MAX_CELLS and all(a == b for a, b in cells)
    assert str(spots(Pattern((0, 0), (0,), ()), "empty")).startswith("<svg")


def test_a_file_is_whole_and_black_on_white():
    """As a file a picture brings its ground, its size and its name; within a page it takes those of the page."""
    run = drawn(np.array([0.0, 1.0]), {"up": np.array([0.0, 1.0])}, "s (m)")
    file = ElementTree.fromstring(run.file())
    assert float(file.get("width")) > curve_pictures.WIDTH and file.get("color") == "black" and file.get("aria-label") == run.label
    assert file.find(f"{SVG}rect").get("fill") == "white" and ElementTree.fromstring(str(run)).find(f"{SVG}rect") is None


def test_pictures_below_each_other_do_not_cover_each_other():
    one = drawn(np.array([0.0, 1.0]), {"up": np.array([0.0, 1.0])}, "s (m)")
    both = below_each_other([one, one], "twice")
    assert (both.width, both.height) == (one.width, 2 * one.height)
    first, second = ElementTree.fromstring(both.file()).findall(f"{SVG}g")
    assert (first.get("transform"), second.get("transform")) == ("translate(0 0)", f"translate(0 {one.height:g})")
