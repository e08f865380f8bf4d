"""What robots look like: shapes of files stand on the bodies of models where the file says, and nothing is opened or fetched for them."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.exchange.robots import robot_text
from ncgen.exchange.toml_writer import to_toml
from ncgen.model.shapes import rotation_of

TRIANGLE = "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid t\n"

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'

URDF = f"""<robot name="looking">
  <material name="orange"><color rgba="1 0.5 0 1"/></material>
  <link name="base">
    <visual><geometry><box size="0.2 0.4 0.6"/></geometry><material name="orange"/></visual>
  </link>
  <link name="arm">{INERTIAL}
    <visual><origin xyz="0 0 0.5" rpy="0 1.5707963267948966 0"/><geometry><cylinder radius="0.1" length="1"/></geometry></visual>
    <visual><geometry><mesh filename="package://looks/meshes/hand.stl" scale="0.1 0.2 0.3"/></geometry></visual>
    <visual><geometry><mesh filename="https://a.example/hand.stl"/></geometry></visual>
    <visual><geometry><mesh filename="missing.stl"/></geometry></visual>
    <visual><geometry><torus radius="1"/></geometry></visual>
    <visual><geometry><sphere radius="0"/></geometry></visual>
  </link>
  <link name="hand">{INERTIAL}
    <visual><origin xyz="0 0 0.1"/><geometry><sphere radius="0.05"/></geometry></visual>
  </link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="0 0 1" rpy="0 0 1.5707963267948966"/></joint>
  <joint name="grip" type="fixed"><parent link="arm"/><child link="hand"/><origin xyz="1 0 0"/></joint>
</robot>
"""

SDF = """<sdf version="1.7"><model name="looking"><link name="body"><pose>0 0 1 0 0 0</pose>
  <inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>
  <visual name="a"><pose>1 0 0 0 0 1.5707963267948966</pose><geometry><box><size>1 2 3</size></box></geometry>
    <material><diffuse>0 0 1 1</diffuse></material></visual>
  <visual name="b"><geometry><capsule><radius>0.1</radius><length>0.4</length></capsule></geometry></visual>
  <visual name="c"><geometry><ellipsoid><radii>1 2 3</radii></ellipsoid></geometry></visual>
  <visual name="d"><geometry><mesh><uri>hand.stl</uri><scale>1 1 2</scale></mesh></geometry></visual>
  <visual name="e"><geometry><plane><normal>0 0 1</normal></plane></geometry></visual>
</link></model></sdf>
"""

MJCF = """<mujoco model="looking"><asset><mesh name="hand" file="hand.obj" scale="1 1 2"/></asset><worldbody>
  <geom type="plane" size="1 1 1"/><geom type="box" size="1 2 3" pos="0 0 -3" rgba="1 0 0 1"/>
  <body pos="0 0 1"><freejoint/>
    <geom type="capsule" fromto="0 0 0 0 1 0" size="0.1"/><geom type="sphere" size="0.2" group="3"/>
    <geom type="ellipsoid" size="0.1 0.2 0.3"/><geom type="mesh" mesh="hand" euler="0 0 90"/>
  </body></worldbody></mujoco>
"""

OBJ = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def loaded(tmp_path, name: str, text: str, **options: bool) -> ncgen.Model:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return ncgen.load(path, **options)


def solids(model: ncgen.Model, body: str) -> list:
    return [solid for solid in model.drawing.solids if solid.body.name == body]


def test_urdf(tmp_path):
    """Poses compose through joints, and those of links that are fixed to one another; materials are named; a package is looked for."""
    (tmp_path / "looks" / "meshes").mkdir(parents=True)
    (tmp_path / "looks" / "meshes" / "hand.stl").write_text(TRIANGLE)
    model = loaded(tmp_path / "looks", "looking.urdf", URDF)
    (base,) = solids(model, "ground")
    assert (base.kind, base.sizes, base.colour) == ("box", (0.2, 0.4, 0.6), "#ff8000")
    cylinder, mesh, ball = solids(model, "arm")
    assert (cylinder.kind, cylinder.sizes, cylinder.colour) == ("cylinder", (0.1, 1.0), None)
    np.testing.assert_allclose(cylinder.position, [0, 0, 1.5], atol=1e-15)
    np.testing.assert_allclose(cylinder.rotation[:, 2], [0, 1, 0], atol=1e-15)  # z of the cylinder is x of the link, which is y
    assert (mesh.kind, mesh.sizes, mesh.file) == ("mesh", (0.1, 0.2, 0.3), str(tmp_path / "looks" / "meshes" / "hand.stl"))
    np.testing.assert_allclose(mesh.rotation, rotation_of((0, 0, np.pi / 2)), atol=1e-15)
    assert ball.kind == "ellipsoid" and ball.sizes == (0.05,) * 3
    np.testing.assert_allclose(ball.position, [0, 1, 1.1], atol=1e-15)
    assert model.left_out == (
        "meshes that are not there, https://a.example/hand.stl first (2)", "shapes of other kinds, torus first (2)",
    )  # fmt: skip


def test_a_floating_base_takes_its_shapes_along(tmp_path):
    model = loaded(tmp_path, "looking.urdf", URDF, floating=True)
    assert [solid.kind for solid in solids(model, "base")] == ["box"] and solids(model, "ground") == []


def test_sdf(tmp_path):
    (tmp_path / "hand.stl").write_text(TRIANGLE)
    model = loaded(tmp_path, "looking.sdf", SDF)
    box, capsule, ellipsoid, mesh = solids(model, "body")
    assert (box.kind, box.sizes, box.colour, box.position.tolist()) == ("box", (1, 2, 3), "#0000ff", [1, 0, 1])
    np.testing.assert_allclose(box.rotation @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    assert (capsule.kind, capsule.sizes, ellipsoid.kind, ellipsoid.sizes) == ("capsule", (0.1, 0.4), "ellipsoid", (1, 2, 3))
    assert (mesh.file, mesh.sizes) == (str(tmp_path / "hand.stl"), (1, 1, 2))
    assert model.left_out == ("shapes of other kinds, plane first (1)",)


def test_mjcf(tmp_path):
    """Half sizes; groups that the viewer hides are not seen; MuJoCo moves meshes, and a corner of the file is where MuJoCo has it."""
    mujoco = pytest.importorskip("mujoco")
    (tmp_path / "hand.obj").write_text(OBJ)
    model = loaded(tmp_path, "looking.xml", MJCF)
    (box,) = solids(model, "ground")
    assert (box.sizes, box.position.tolist(), box.colour) == ((2, 4, 6), [0, 0, -3], "#ff0000")
    capsule, ellipsoid, mesh = solids(model, "body1")
    assert capsule.sizes == (0.1, 1.0) and ellipsoid.sizes == (0.1, 0.2, 0.3) and capsule.colour is None
    np.testing.assert_allclose(capsule.position, [0, 0.5, 1], atol=1e-15)
    np.testing.assert_allclose(np.abs(capsule.rotation[:, 2]), [0, 1, 0], atol=1e-15)
    compiled = mujoco.MjModel.from_xml_path(str(tmp_path / "looking.xml"))
    data = mujoco.MjData(compiled)
    mujoco.mj_kinematics(compiled, data)
    g = compiled.ngeom - 1
    theirs = compiled.mesh_vert @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g]
    file = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]]) * mesh.sizes
    mine = file @ mesh.rotation.T + mesh.position
    gaps = np.linalg.norm(theirs[:, None] - mine, axis=2).min(axis=0)
    assert mesh.file == str(tmp_path / "hand.obj") and gaps.max() < 1e-6


@pytest.mark.parametrize(("suffix", "hidden"), [(".urdf", 0), (".sdf", 1), (".xml", 0)])
def test_shapes_go_out_and_come_back(tmp_path, suffix, hidden):
    """Where they were, with their sizes and colours. What rests is the world in SDF, which has no shapes there."""
    if suffix == ".xml":
        pytest.importorskip("mujoco")
    (tmp_path / "hand.obj").write_text(OBJ)
    text = URDF.replace("package://looks/meshes/hand.stl", "hand.obj")
    first = loaded(tmp_path, "looking.urdf", text)
    second = loaded(tmp_path, f"back{suffix}", robot_text(first, suffix))
    assert [solid.kind for solid in second.drawing.solids] == ["box", "cylinder", "mesh", "ellipsoid"][hidden:]
    for a, b in zip(first.drawing.solids[hidden:], second.drawing.solids, strict=True):
        assert (a.body.name, a.sizes, a.colour, a.file) == (b.body.name, b.sizes, b.colour, b.file)
        np.testing.assert_allclose(b.position, a.position, atol=1e-14)
        np.testing.assert_allclose(b.rotation[:, 2], a.rotation[:, 2], atol=1e-14)


def test_a_robot_goes_through_a_model_file(tmp_path):
    """Shapes and all."""
    model = loaded(tmp_path, "looking.urdf", URDF)
    text = to_toml(model)
    again = loaded(tmp_path, "looking.toml", text)
    assert len(again.drawing.solids) == len(model.drawing.solids) == 3 and to_toml(again) == text
