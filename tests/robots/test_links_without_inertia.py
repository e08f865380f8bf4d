"""Joints that move nothing that has inertia: forces do not say how they move, so a run is refused by their names before it begins.

MuJoCo refuses such files as well ("mass and inertia of moving bodies must be larger than mjMINVAL").
"""

import pytest

import ncgen
from ncgen.errors import SingularError

NECK = """<robot name="r"><link name="chest"/>
<link name="neck"><inertial><mass value="0.1"/><inertia ixx="{neck}" iyy="{neck}" izz="{neck}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="head"><inertial><origin xyz="0 {aside} 0.2"/><mass value="1.3"/>
<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="roll" type="continuous"><parent link="chest"/><child link="neck"/><axis xyz="1 0 0"/><dynamics damping="1"/></joint>
<joint name="yaw" type="continuous"><parent link="neck"/><child link="head"/><axis xyz="0 0 1"/><dynamics damping="1"/></joint></robot>"""
"""A head whose mass is a point, as iCub's is: no joint turns it about its own axis."""


def head(folder, **values):
    (folder / "r.urdf").write_text(NECK.format(**values))
    return ncgen.compile(ncgen.load(folder / "r.urdf"), "c")


WORDS = "^r: a motion of the mechanism has no inertia: yaw can move without any; give head moments of inertia$"


@pytest.mark.parametrize("move", [lambda kernels: ncgen.simulate(kernels, 1.0), ncgen.start])
def test_a_point_mass_on_the_axis_is_refused(tmp_path, move):
    with pytest.raises(SingularError, match=WORDS):
        move(head(tmp_path, neck=1e-3, aside=0))


def test_a_point_mass_beside_the_axis_moves(tmp_path):
    """About roll, hanging from it: θ̈ = m g c_z sin θ / (m c_z² + neck), and yaw has m c_y²."""
    run = ncgen.simulate(head(tmp_path, neck=1e-3, aside=0.1), 0.5)
    assert run.energy_drift < 1e-6 and run.statistics.evaluations < 1000


def test_what_lacks_mass_is_named(tmp_path):
    text = NECK.format(neck=1e-3, aside=0.1).replace('<mass value="1.3"/>', '<mass value="0"/>')
    (tmp_path / "r.urdf").write_text(text)
    with pytest.raises(SingularError, match="yaw can move without any; give head a mass and moments of inertia$"):
        ncgen.simulate(ncgen.compile(ncgen.load(tmp_path / "r.urdf"), "c"), 1.0, zd0={"yaw": 1.0})
