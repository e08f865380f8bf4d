"""`ncgen bench robots`: every number of a file, and no file that keeps the others waiting."""

from pathlib import Path
from xml.etree.ElementTree import canonicalize

import pytest

from ncgen.comparisons import robots
from ncgen.comparisons.changed_robot import changed_copy
from ncgen.errors import ModelError

FILES = Path(__file__).parents[1] / "robots"

BROKEN = '<robot name="broken"><link name="a"/><joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint></robot>'

BALL = (
    """<mujoco><worldbody><geom type="plane" size="2 2 1"/><body><joint/><geom type="capsule" size="0.5 1"/></body></worldbody></mujoco>"""
)


def test_a_file_is_measured_and_a_broken_one_is_refused_in_a_line(tmp_path):
    """A crane has four joints; the reason of the other one is the message that its reader gives."""
    (tmp_path / "broken.urdf").write_text(BROKEN)
    records = list(robots.robot_records([FILES / "crane.urdf", tmp_path / "broken.urdf"]))
    crane, broken = records
    assert crane["reason"] is None and crane["dof"] >= 3 and crane["duration"] == 1.0
    assert 0 < crane["evaluation"] < crane["cached"] <= 3 * crane["cold"]
    assert crane["changed"] > 0 and crane["changed_reason"] is None
    assert crane["evaluations"] > 20 and crane["error"] < 1e-3 and crane["drift"] < 1e-3 and crane["fallbacks"] == 0
    assert "broken.urdf" in broken["reason"] and "\n" not in broken["reason"] and broken["cold"] is None
    assert "crane.urdf" in robots.robot_line(crane) and broken["reason"] in robots.robot_line(broken)
    said = list(robots.summary(records))
    assert said[-1] == "2 files, 1 without a run to the end" and any("median" in line and "worst" in line for line in said)


@pytest.mark.parametrize(
    "name, old, new",
    [
        ("crane.urdf", '<mass value="0.4"', '<mass value="0.404"'),
        ("fourbar.sdf", "<mass>2<", "<mass>2.02<"),
        ("fourbar.xml", 'mass="2"', 'mass="2.02"'),
        ("gantry.xml", 'mass="0.4"', 'mass="0.404"'),
    ],
)
def test_one_mass_of_the_copy_is_another(tmp_path, name, old, new):
    """The middle one of the file, and nothing else."""
    text = (FILES / name).read_text()
    assert text.count(old) == 1
    copy = changed_copy(FILES / name, tmp_path)
    assert copy is not None and copy.name == name
    assert canonicalize(copy.read_text()) == canonicalize(text.replace(old, new))


def test_a_size_is_changed_where_no_mass_is_written(tmp_path):
    """The first one inside a body: that of the ground moves nothing."""
    (tmp_path / "ball.xml").write_text(BALL)
    copy = changed_copy(tmp_path / "ball.xml", tmp_path)
    assert copy is not None and 'size="0.505 1"' in copy.read_text() and 'size="2 2 1"' in copy.read_text()


def test_of_several_files_one_is_changed_and_the_others_are_linked(tmp_path):
    """Where the first one has no number, one of those that it includes; meshes and folders are where the file says they are."""
    home = tmp_path / "home"
    (home / "parts").mkdir(parents=True)
    (home / "meshes").mkdir()
    include = '<mujoco><compiler meshdir="../meshes"/><include file="arm.xml"/></mujoco>'
    (home / "parts" / "all.xml").write_text(include)
    arm = '<worldbody><body><geom mass="2"/></body></worldbody><asset><mesh file="a.stl"/></asset>'
    (home / "parts" / "arm.xml").write_text(f"<mujocoinclude>{arm}</mujocoinclude>")
    (home / "meshes" / "a.stl").write_text("solid")
    copy = changed_copy(home / "parts" / "all.xml", tmp_path)
    assert copy == tmp_path / "changed" / "parts" / "all.xml" and copy.read_text() == include
    assert 'mass="2.02"' in (copy.parent / "arm.xml").read_text()
    assert (tmp_path / "changed" / "meshes" / "a.stl").resolve() == home / "meshes" / "a.stl"


@pytest.mark.parametrize(
    "name, text",
    [
        ("model.toml", "[model]"),
        ("mesh.xml", BALL.replace("<worldbody>", '<asset><mesh name="m" file="m.stl"/></asset><worldbody>')),
        ("parts.sdf", "<sdf><include><uri>arm</uri></include><model><link><inertial><mass>1</mass></inertial></link></model></sdf>"),
        ("light.urdf", '<robot name="a"><link name="b"><inertial><mass value="1e-7"/></inertial></link></robot>'),
    ],
)
def test_files_that_need_others_or_have_no_mass_are_not_copied(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    assert changed_copy(tmp_path / name, tmp_path) is None and [file.name for file in tmp_path.iterdir()] == [name]


def test_a_file_whose_time_is_over_is_stopped():
    """A tenth of a second is not enough for the import."""
    (record,) = robots.robot_records([FILES / "crane.urdf"], limit=0.1)
    assert record["reason"] == "the file's time was over in cold" and record["cold"] is None


def test_files_are_found_below_folders(tmp_path):
    """Only those of robots; a path that leads to none is named."""
    found = robots.robot_files([FILES, FILES / "crane.urdf"])
    assert [file.name for file in found] == ["crane.urdf", "fourbar.sdf", "fourbar.xml", "gantry.xml", "crane.urdf"]
    with pytest.raises(ModelError, match="no such file"):
        robots.robot_files([tmp_path])
    with pytest.raises(ModelError, match="name robots' files"):
        robots.robot_files([])
