"""`ncgen bench robots`: every number of a file, and no file that keeps the others waiting."""

from pathlib import Path

import pytest

from ncgen.comparisons import robots
from ncgen.errors import ModelError

FILES = Path(__file__).parents[1] / "robots"

BROKEN = '<robot name="broken"><link name="a"/><joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint></robot>'


def test_a_file_is_measured_and_a_broken_one_is_refused_in_a_line(tmp_path):
    """A crane has four joints; the reason of the other one is the message that its reader gives."""
    (tmp_path / "broken.urdf").write_text(BROKEN)
    records = list(robots.robot_records([FILES / "crane.urdf", tmp_path / "broken.urdf"]))
    crane, broken = records
    assert crane["reason"] is None and crane["dof"] >= 3 and crane["duration"] == 1.0
    assert 0 < crane["evaluation"] < crane["cached"] <= 3 * crane["cold"]
    assert crane["evaluations"] > 20 and crane["error"] < 1e-3 and crane["drift"] < 1e-3 and crane["fallbacks"] == 0
    assert "broken.urdf" in broken["reason"] and "\n" not in broken["reason"] and broken["cold"] is None
    assert "crane.urdf" in robots.robot_line(crane) and broken["reason"] in robots.robot_line(broken)
    said = list(robots.summary(records))
    assert said[-1] == "2 files, 1 without a run to the end" and any("median" in line and "worst" in line for line in said)


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
