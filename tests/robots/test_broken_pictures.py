"""Pictures never stop the dynamics: what is wrong in a visual, a collision or a shape is listed, and the robot is read."""

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError

URDF = """<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
<{tag}>{inside}</{tag}></link><joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>"""
SDF = """<sdf version="1.9"><model name="m"><link name="a"/><link name="b"><inertial><mass>1</mass></inertial>
<{tag} name="v">{inside}</{tag}></link>
<joint name="j" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""
BOX = "<geometry><box {}/></geometry>"
BOX_OF_SDF = "<geometry><box><size>{}</size></box></geometry>"

BROKEN = [
    (URDF, '<geometry><mesh filename="x.stl" scale="${s} 1 1"/></geometry>'),
    (URDF, '<geometry><mesh filename="x.stl" scale="1 1"/></geometry>'),
    (URDF, '<geometry><mesh filename="${d}/x.stl"/></geometry>'),
    (URDF, "<geometry><mesh/></geometry>"),
    (URDF, ""),
    (URDF, '<xacro:shape name="x"/>'),
    (URDF, '<geometry><xacro:if value="1"><box size="1 1 1"/></xacro:if></geometry>'),
    (URDF, '<origin xyz="${x} 0 0"/>' + BOX.format('size="1 1 1"')),
    (URDF, '<origin quat_xyzw="1 0 0 0"/>' + BOX.format('size="1 1 1"')),
    (URDF, BOX.format('size="${a} 1 1"')),
    (URDF, BOX.format("")),
    (URDF, '<geometry><cylinder radius="1e400" length="nan"/></geometry>'),
    (URDF, BOX.format('size="1 1 1"') + '<material name="m"><color rgba="${c}"/></material>'),
    (SDF, "<geometry><mesh><uri>x.stl</uri><scale>${s}</scale></mesh></geometry>"),
    (SDF, "<geometry><mesh/></geometry>"),
    (SDF, "<geometry/>"),
    (SDF, "<xacro:shape/>"),
    (SDF, "<pose>${x} 0 0 0 0 0</pose>" + BOX_OF_SDF.format("1 1 1")),
    (SDF, '<pose relative_to="none">0 0 0 0 0 0</pose>' + BOX_OF_SDF.format("1 1 1")),
    (SDF, BOX_OF_SDF.format("${a}")),
    (SDF, "<geometry><cylinder><radius>1</radius></cylinder></geometry>"),
    (SDF, BOX_OF_SDF.format("1 1 1") + "<material><diffuse>a b c</diffuse></material>"),
]


@pytest.mark.parametrize("tag", ["visual", "collision"])
@pytest.mark.parametrize(("text", "inside"), BROKEN)
def test_urdf_and_sdf(tmp_path, tag, text, inside):
    path = tmp_path / ("r.urdf" if text is URDF else "r.sdf")
    path.write_text(text.format(tag=tag, inside=inside))
    model = ncgen.load(path)
    (said,) = model.left_out
    assert said.startswith(("shapes of other kinds", "meshes that are not there") if tag == "visual" else "collision shapes"), said
    assert model.bodies["b"].inertia.mass == 1.0 and not model.drawing.solids


MJCF = """<mujoco><compiler meshdir="m"/><asset><mesh name="x" file="{file}"{scale}/>{asset}</asset><worldbody>
<body name="b" pos="0 0 1">{inertial}<joint name="j" axis="0 1 0"/><geom type="mesh" mesh="x" contype="0" conaffinity="0"/>
<geom type="sphere" size="0.1" contype="0" conaffinity="0"/>{geom}</body></worldbody></mujoco>"""
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
INERTIAL = '<inertial pos="0.1 0 0" mass="3" diaginertia="1 1 1"/>'


def mjcf(folder, **parts):
    (folder / "m").mkdir()
    (folder / "m" / "here.obj").write_text(OBJ)
    words = {"file": "here.obj", "scale": "", "asset": "", "geom": "", "inertial": INERTIAL} | parts
    (folder / "r.xml").write_text(MJCF.format(**words))
    return folder / "r.xml"


@pytest.mark.parametrize(
    ("parts", "missing"),
    [
        ({}, ""),
        ({"file": "none.obj"}, "none.obj"),
        ({"scale": ' scale="${s} 1 1"'}, "here.obj"),
        ({"geom": '<geom name="box" type="box" size="${a} 1 1"/>'}, "box"),
        ({"geom": '<geom name="rod" type="cylinder" size="0.1" fromto="0 0 0 ${a} 1 1"/>'}, "rod"),
        ({"asset": '<texture name="t" type="2d" file="no.png"/><material name="s" texture="t"/>'}, "no.png"),
        ({"asset": '<hfield name="h" file="no.png" size="1 1 1 1"/>'}, "no.png"),
        ({"asset": '<skin name="s" file="no.skn"/>'}, "no.skn"),
    ],
)
def test_mjcf(tmp_path, parts, missing):
    """MuJoCo refuses such a file: it is read without the picture, others are seen, and the body has its <inertial>."""
    pytest.importorskip("mujoco")
    model = ncgen.load(mjcf(tmp_path, **parts))
    said = [each for each in model.left_out if each.startswith("meshes")]
    assert len(said) == bool(missing) and all(f"{missing} first (1)" in each for each in said)
    assert model.bodies["b"].inertia.mass == 3.0
    assert len(model.drawing.solids) == 2 - (missing in ("none.obj", "here.obj"))


def test_mjcf_whose_inertia_is_that_of_a_shape_is_refused(tmp_path):
    pytest.importorskip("mujoco")
    with pytest.raises(ModelError, match=r"r.xml: Error: Error opening file '.*none.obj'"):
        ncgen.load(mjcf(tmp_path, file="none.obj", inertial=""))


def test_textures_are_not_read(tmp_path):
    """Where nothing but a texture is made of a picture, MuJoCo does not decode it, which takes longer than all else; no body depends on it.

    Of several textures in one picture each has a dot at least.
    """
    pytest.importorskip("mujoco")
    folder = tmp_path / "m" / "pictures"
    asset = '<texture name="t" type="2d" file="pictures/one.png"/><material name="s" texture="t"/>'
    asset += '<texture name="c" type="cube" gridsize="3 4" gridlayout=".U..LFRB.D.." file="pictures/grid.png"/>'
    path = mjcf(tmp_path, asset=asset)
    folder.mkdir()
    for name in ("one", "grid"):
        (folder / f"{name}.png").write_bytes(b"no picture")
    model = ncgen.load(path)
    assert model.bodies["b"].inertia.mass == 3.0 and not [each for each in model.left_out if each.startswith("meshes")]


def test_a_picture_that_is_a_height_field_is_read(tmp_path):
    pytest.importorskip("mujoco")
    path = mjcf(tmp_path, asset='<texture type="2d" file="h.png"/><hfield name="h" file="h.png" size="1 1 1 1"/>')
    (tmp_path / "m" / "h.png").write_bytes(b"no picture")
    with pytest.raises(ModelError, match=r"h\.png"):
        ncgen.load(path)


@pytest.mark.parametrize("name", ["no.obj", "no.STL"])
def test_meshes_are_not_read_where_masses_are_given(tmp_path, name):
    """Where no inertia is that of a mesh, MuJoCo does not read it, which takes longer than all else; the file says where it is seen."""
    pytest.importorskip("mujoco")
    path = mjcf(tmp_path, file=name, scale=' scale="1 2 3"')
    path.write_text(path.read_text().replace('type="mesh"', 'type="mesh" pos="0.1 0.2 0.3"', 1))
    (tmp_path / "m" / name).write_bytes(b"no mesh")
    model = ncgen.load(path)
    mesh, _ = model.drawing.solids
    assert model.bodies["b"].inertia.mass == 3.0 and mesh.sizes == (1.0, 2.0, 3.0) and mesh.file.endswith(name)
    assert mesh.position == pytest.approx([0.1, 0.2, 1.3], abs=1e-15) and mesh.rotation == pytest.approx(np.eye(3), abs=1e-15)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (INERTIAL, ""),
        ("<compiler", '<compiler inertiafromgeom="true"'),
        ('type="mesh"', 'type="box"'),
        ("</body>", '</body><body><geom type="mesh" mesh="x"/></body>'),
        ("</mujoco>", '<sensor><framepos objtype="geom" objname="g"/></sensor></mujoco>'),
        ("<asset>", '<default><geom mesh="x"/></default><asset>'),
    ],
)
def test_meshes_are_read_where_more_than_looks_depends_on_them(tmp_path, old, new):
    pytest.importorskip("mujoco")
    path = mjcf(tmp_path, geom='<geom name="g" type="mesh" mesh="x"/>')
    path.write_text(path.read_text().replace(old, new, 1))
    (tmp_path / "m" / "here.obj").write_bytes(b"no mesh")
    with pytest.raises(ModelError, match="at least 4 vertices required"):
        ncgen.load(path)
