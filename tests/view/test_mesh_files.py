"""Files of meshes that show nothing: one line says why, and the picture goes without them."""

import struct
import sys

import numpy as np
import pytest

from ncgen.view import meshes
from ncgen.view.meshes import mesh_of

pytest.importorskip("trimesh")


def stl(triangles):
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(corners), 0) for corners in triangles)
    return bytes(80) + struct.pack("<I", len(triangles)) + body


DAE = b"<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' version='1.4.1'></COLLADA>"

NOTHING = {
    "collinear.stl": (stl([[(k, 0, 0), (k + 1, 0, 0), (k + 2, 0, 0)] for k in range(600)]), "no triangle in it has an area"),
    "two.stl": (stl([[(0, 0, 0), (1, 1, 0), (2, 2, 0)]] * 2), "no triangle in it has an area"),
    "point.stl": (stl([[(1, 1, 1)] * 3]), "no triangle in it has an area"),
    "far.obj": (b"v 1e300 0 0\nv 0 1e300 0\nv 0 0 1e300\nf 1 2 3\n", r"it has a corner at 1e\+300 m, and 1e\+09 are shown"),
    "infinite.obj": (b"v 1e400 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n", "numbers that are not finite"),
}


@pytest.mark.parametrize("name", NOTHING)
def test_what_shows_nothing_is_told_in_one_line(name, tmp_path):
    data, words = NOTHING[name]
    (tmp_path / name).write_bytes(data)
    with pytest.warns(UserWarning, match=words) as told:
        assert mesh_of(tmp_path / name) is None
    assert len(told) == 1 and "\n" not in str(told[0].message)


def test_a_triangle_is_shown(tmp_path):
    (tmp_path / "one.stl").write_bytes(stl([[(0, 0, 0), (1, 0, 0), (0, 1, 0)]]))
    assert mesh_of(tmp_path / "one.stl").triangles.shape == (1, 3)


def test_dae_without_its_reader(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "collada", None)
    monkeypatch.setattr(meshes, "find_spec", lambda name: None)
    (tmp_path / "a.dae").write_bytes(DAE)
    with pytest.warns(UserWarning, match=r"pycollada, which reads DAE, is missing: pip install 'ncgen\[robots\]'"):
        assert mesh_of(tmp_path / "a.dae") is None


def test_the_reader_of_others_is_quiet(tmp_path, caplog):
    """trimesh logs a traceback of its own for a broken file, which Python prints; one line is all that is told."""
    lines = ["solid s", "facet normal 0 [ 1", "outer loop", "vertex 0 0 0", "vertex 1e300 0 0", "vertex 0 1e300 0", "endloop", "endfacet"]
    (tmp_path / "a.stl").write_text("\n".join([*lines, "endsolid s", ""]))
    with pytest.warns(UserWarning) as told:
        assert mesh_of(tmp_path / "a.stl") is None
    assert len(told) == 1 and "a.stl: it " in str(told[0].message) and not caplog.records
