"""MJCF that MuJoCo itself is no match for: one line each, in a bounded time, and this process lives."""

from __future__ import annotations

import os
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.robots import mjcf_compiled, read_robot

pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo: pip install 'ncgen[robots]'")

ROBOT = '<mujoco>{}<worldbody><body name="a"><joint axis="0 1 0"/><geom size="1"/>{}</body></worldbody></mujoco>'
FIELD = '<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>'
PICTURE = '<asset><texture name="t" type="2d" builtin="flat" width="100000" height="100000"/></asset>'


def refused(path: Path, text: str) -> str:
    path.write_text(text)
    with pytest.raises(ModelError) as caught:
        ncgen.load(path)
    said = str(caught.value)
    assert "\n" not in said and len(said) <= 300
    return said


def test_too_much_memory(tmp_path):
    """A height field of 40 GB is a segmentation fault of MuJoCo, a picture of 30 GB is told by it."""
    assert refused(tmp_path / "r.xml", ROBOT.format(FIELD, "")).startswith("r.xml: MuJoCo's process ended by SIG")
    assert "r.xml: Error: Could not allocate memory" in refused(tmp_path / "r.xml", ROBOT.format(PICTURE, ""))


@pytest.mark.parametrize(
    "more, said",
    [
        ('<replicate count="1000000"><geom size="1"/></replicate>', "line 1: <replicate> asks for 1000000 copies, and 100000 are read"),
        ('<replicate count="999">\n<replicate count="999"><geom size="1"/></replicate></replicate>', "line 2: <replicate> asks for 998001"),
        ('<flexcomp name="f" type="grid" count="1000 1000 1000"/>', "<flexcomp> asks for 1000000000 copies"),
        ('<composite type="cable" count="1000000 1 1"/>', "<composite> asks for 1000000 copies"),
        ('<replicate count="300"><body><geom size="1"/></body></replicate>', "it has 302 bodies, and 200 are read; take fewer"),
    ],
)  # fmt: skip
def test_too_many_copies(tmp_path, more, said, monkeypatch):
    """They are counted before MuJoCo makes them, and bodies afterwards."""
    monkeypatch.setattr(mjcf_compiled, "MAX_COUNTS", {"nbody": 200})
    assert said in refused(tmp_path / "r.xml", ROBOT.format("", more))


def test_no_end_in_sight(tmp_path, monkeypatch):
    """What takes longer than MuJoCo may is ended by the system."""
    monkeypatch.setattr(mjcf_compiled, "SECONDS", 1)
    more, began = '<replicate count="100000" offset="1 0 0"><body><geom size="1"/></body></replicate>', time.monotonic()
    assert "MuJoCo is not done with it after 1 s" in refused(tmp_path / "r.xml", ROBOT.format("", more))
    assert time.monotonic() - began < 60


def test_included_files_are_looked_at(tmp_path):
    """Wherever MuJoCo finds them: beside the first one, and beside the one that includes them."""
    (tmp_path / "sub").mkdir()
    main, inner = tmp_path / "r.xml", tmp_path / "sub" / "inner.xml"
    main.write_text(ROBOT.format('<include file="sub/outer.xml"/>', ""))
    (tmp_path / "sub" / "outer.xml").write_text('<mujoco><include file="inner.xml"/></mujoco>')
    for text, said in (
        ("<!DOCTYPE x [<!ENTITY a 'b'>]><mujoco/>", "inner.xml, line 1: document types and entities are not read"),
        ("<mujoco>\n<worldbody></mujoco>", "inner.xml, line 2: no XML"),
        ("<mujoco>" + "<body>" * 200 + "</body>" * 200 + "</mujoco>", "inner.xml, line 1: elements are more than 100 deep"),
        (ROBOT.format("", '<replicate count="1000000"/>'), "inner.xml, line 1: <replicate> asks for 1000000 copies"),
    ):
        inner.write_text(text)
        assert said in refused(main, main.read_text())
    inner.unlink()
    assert "Could not open file" in refused(main, main.read_text()) or "inner.xml" in refused(main, main.read_text())
    inner.write_bytes(b"\xff\xfe")
    assert "inner.xml, line 1: byte 0xff is no UTF-8 text" in refused(main, main.read_text())
    inner.unlink()
    os.mkfifo(inner)
    assert "outer.xml, line 1: 'inner.xml' is no ordinary file" in refused(main, main.read_text())


def test_meshes_are_ordinary_files(tmp_path):
    """MuJoCo would wait for a pipe; it is told with the line, in the folder of meshes as well."""
    (tmp_path / "meshes").mkdir()
    os.mkfifo(tmp_path / "meshes" / "m.stl")
    said = refused(tmp_path / "r.xml", ROBOT.format('<compiler meshdir="meshes"/><asset>\n<mesh file="m.stl"/></asset>', ""))
    assert said.startswith("r.xml, line 2: 'm.stl' is no ordinary file")


TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def test_shifted_meshes_of_included_files(tmp_path):
    """A mesh with refpos is not drawn in a wrong place, wherever its element stands."""
    (tmp_path / "m.obj").write_text(TETRAHEDRON)
    assets = '<asset><mesh name="m" file="m.obj" refpos="1 0 0"/></asset>'
    (tmp_path / "assets.xml").write_text(f"<mujoco>{assets}</mujoco>")
    for name, text in (("own.xml", assets), ("other.xml", '<include file="assets.xml"/>')):
        (tmp_path / name).write_text(ROBOT.format(text, '<geom type="mesh" mesh="m"/>'))
        robot = read_robot(tmp_path / name)
        assert any("mesh with refpos" in what for what in robot.omitted), name
        assert not any(shape.kind == "mesh" for link in robot.links.values() for shape in link.shapes)


def test_what_comes_back_is_what_mujoco_reads(tmp_path):
    """All numbers of the compiled model, to the last bit, and MuJoCo's warnings."""
    import mujoco

    path = Path(__file__).parent / "gantry.xml"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mine, theirs = mjcf_compiled.compiled(path), mujoco.MjModel.from_xml_path(str(path))
    for name in ("body_pos", "body_quat", "body_inertia", "body_mass", "jnt_axis", "dof_armature", "geom_pos", "qpos0", "jnt_range"):
        np.testing.assert_array_equal(getattr(mine, name), getattr(theirs, name), err_msg=name)
    assert mine.paths == theirs.paths and mine.names == theirs.names


@pytest.mark.parametrize(
    "old, new, said",
    [
        ('quat="0.9 0.1 -0.2 0.3"', 'quat="0.9 1e300 -0.2 0.3"', "body wrist has no direction (quat)"),
        ('pos="0.1 0.2 -0.1"', 'pos="0.1 1e300 -0.1"', "body wrist has the number 1e+300 (pos); the largest number is 1e+100"),
        ('gravity="0 0.5 -9.7"', 'gravity="1e300 0 0"', "gravity is not finite, or larger than 1e+100"),
    ],
)  # fmt: skip
def test_numbers_that_mujoco_takes(tmp_path, old, new, said):
    """As those of other formats, they are refused with their owner."""
    text = (Path(__file__).parent / "gantry.xml").read_text()
    assert old in text
    assert said in refused(tmp_path / "g.xml", text.replace(old, new, 1))
