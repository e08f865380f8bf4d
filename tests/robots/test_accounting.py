"""Every word of a robot's file is modelled, only seen, listed or refused: the formats' tables against the published schemas."""

import warnings
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from vocabulary_of_sdf import ignored

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.robots.accounting import MEANINGS, WITHOUT_EFFECT, changes_motion, vocabulary

SCHEMAS = Path(__file__).parent / "schemas"
XS = "{http://www.w3.org/2001/XMLSchema}"


def covering(words, anchor, path, attribute=""):
    """The word that says what becomes of an element (tags below an anchor) or of its attribute; None where the table has none."""
    word = None
    for tag in path:
        word = words.get(f"{anchor}/{tag}")
        if word is None or word.meaning != "modelled":
            return word
        anchor = word.anchor or word.path
    return words.get(f"{anchor}@{attribute}") if attribute else word


def said_by_xsd(node, types, path=()):
    """(path, attribute, default) of all that an element's type has."""
    kind = types.get(node.get("type", ""))
    inside = kind if kind is not None else node
    for attribute in inside.iter(f"{XS}attribute"):
        yield path, attribute.get("name"), attribute.get("default")
    for element in inside.iter(f"{XS}element"):
        if element is not node:
            yield (*path, element.get("name")), "", None
            yield from said_by_xsd(element, types, (*path, element.get("name")))


def test_urdf_has_every_word_of_its_schema():
    schema = ET.parse(SCHEMAS / "urdf.xsd").getroot()
    types = {each.get("name"): each for each in schema.iter(f"{XS}complexType") if each.get("name")}
    words, seen = vocabulary("urdf"), 0
    for path, attribute, default in said_by_xsd(schema.find(f"{XS}element"), types):
        word = covering(words, "robot", path, attribute)
        assert word, (path, attribute)
        if attribute and word.path.endswith(f"@{attribute}") and default is not None:
            assert word.is_default(default), (path, attribute, default)
        seen += 1
    assert seen > 100


def said_by_descriptions():
    """{path: (versions, type, defaults)} of SDF, path beginning with a description's name."""
    lines = (SCHEMAS / "sdf.txt").read_text(encoding="utf-8").splitlines()
    return {path: (versions, kind, defaults) for path, versions, kind, defaults in (map(str.strip, line.split("|")) for line in lines)}


def test_sdf_has_every_word_of_its_descriptions():
    """From the root, through all descriptions that one includes; versions and defaults are the published ones."""
    published, words, seen = said_by_descriptions(), vocabulary("sdf"), 0
    inside: dict[str, list[str]] = {}
    for path in published:
        inside.setdefault(path.rpartition("@")[0] or path.rpartition("/")[0], []).append(path)
    waiting, known = [("root", "root")], set()
    while waiting:
        place, anchor = waiting.pop()
        for path in inside.get(place, []):
            mark = "@" if "@" in path else "/"
            word = words.get(f"{anchor}{mark}{path.rpartition(mark)[2]}")
            assert word, f"{path} in {anchor}"
            versions, kind, defaults = published[path]
            if path == word.path:
                assert word.versions in (versions, versions.partition("-")[0]), path
            assert all(word.is_default(default) for default in defaults.split(" or ") if default), path
            seen += 1
            if word.meaning == "modelled" and mark == "/":
                step = (kind[2:] if kind.startswith("= ") else path, word.anchor or word.path)
                waiting += [step] if step not in known else []
                known.add(step)
    assert seen > 200


def test_no_word_of_sdf_is_made_up():
    published = said_by_descriptions()
    assert [path for path in vocabulary("sdf") if path not in published] == []


@pytest.mark.parametrize("name", ["urdf", "sdf"])
def test_tables_can_be_walked(name):
    words = vocabulary(name)
    anchors = {word.anchor for word in words.values() if word.anchor}
    for word in words.values():
        assert word.meaning in MEANINGS
        assert word.meaning != "refused" or word.words, word
        if word.meaning == "no effect":
            assert word.words in WITHOUT_EFFECT, word
    assert all(any(path.startswith((f"{anchor}/", f"{anchor}@")) for path in words) for anchor in anchors)


def test_what_changes_the_motion_is_known():
    assert not changes_motion("sensors (3)") and not changes_motion("meshes that are not there, a.stl first (2)")
    assert changes_motion("limits of joints (4)") and changes_motion("<wheel> in <link>, which is none of the format's elements (1)")


URDF = """<robot name="r"><link name="a"/>
<link name="b"><inertial><origin xyz="0.5 0 0"{pose}/><mass value="2"/><inertia ixx="0.01" iyy="0.3" izz="0.3"/></inertial>{link}</link>
<joint name="j" type="{kind}"><parent link="a"/><child link="b"/>{joint}</joint></robot>"""


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"joint": '<dynamics damping="1"/>', "kind": "planar"}, ["damping of joints that do not move along one coordinate (1)"]),
        ({"joint": '<dynamics damping="0"/>', "kind": "planar"}, []),
        ({"joint": '<limit lower="-1" upper="1"/>', "kind": "continuous"}, ["limits that joints of their type do not have (2)"]),
        ({"joint": '<dynamics damping="1" stiffness="3"/>'}, ["the attribute stiffness of <dynamics>, which is none of the format's (1)"]),
        ({"joint": '<safety_controller k_velocity="3"/>'}, ["safety controllers (1)"]),
        ({"link": "<inertial><mass value='7'/></inertial>"}, ["the attribute value of <mass> that nothing reads (1)"]),
    ],
)
def test_what_nobody_reads_of_urdf_is_listed(tmp_path, change, told):
    (tmp_path / "r.urdf").write_text(URDF.format(**{"pose": "", "link": "", "joint": "", "kind": "revolute"} | change))
    assert list(ncgen.load(tmp_path / "r.urdf").left_out) == told


@pytest.mark.parametrize(
    ("joint", "said"),
    [
        ('<limit lower="-1" upper="1" effort="5" velocity="0"/><dynamics friction="1"/>', "2 things that change the motion are"),
        ('<limit lower="-1" upper="1"/>', "1 thing that changes the motion is"),
        ('<calibration rising="1"/>', ""),
    ],
)
def test_loading_warns_once_of_what_changes_the_motion(tmp_path, joint, said):
    (tmp_path / "r.urdf").write_text(URDF.format(pose="", link="", joint=joint, kind="revolute"))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ncgen.load(tmp_path / "r.urdf")
    told = f"r.urdf: {said} not modelled, limits of joints first; model.left_out and `ncgen inspect` list all"
    assert [str(each.message) for each in caught] == ([told] if said else [])
    assert all(each.filename == __file__ and each.category is UserWarning for each in caught)


def test_a_rotation_that_is_not_read_is_refused(tmp_path):
    (tmp_path / "r.urdf").write_text(URDF.format(pose=' quat_xyzw="1 0 0 0"', link="", joint="", kind="revolute"))
    with pytest.raises(ModelError, match="r.urdf, line 2: quat_xyzw is not read; write the rotation as rpy"):
        ncgen.load(tmp_path / "r.urdf")


@pytest.mark.parametrize(("count", "seed"), [(8, 1), pytest.param(1700, 2, marks=pytest.mark.slow)])
def test_no_word_of_urdf_is_ignored(tmp_path, count, seed):
    """Pinocchio's accelerations are those of the model."""
    pytest.importorskip("pinocchio")
    from vocabulary_of_urdf import ignored_of_urdf

    found, nothing = ignored_of_urdf(count, seed, tmp_path)
    assert nothing == []
    assert found["files"] == count and found["modelled and checked"] + found["listed, and the rest checked"] > count // 3


@pytest.mark.parametrize(("count", "seed"), [(6, 4), pytest.param(1700, 2, marks=pytest.mark.slow)])
def test_no_word_of_mjcf_is_ignored(tmp_path, count, seed):
    """Without what is listed, MuJoCo's accelerations are those of the model."""
    pytest.importorskip("mujoco")
    from vocabulary_of_mjcf import ignored_of_mjcf

    found, nothing = ignored_of_mjcf(count, seed, tmp_path)
    assert nothing == []
    assert found["files"] == count and found["modelled and checked"] >= count // 10


@pytest.mark.parametrize(("count", "seed"), [(60, 1), pytest.param(5000, 2, marks=pytest.mark.slow)])
def test_no_word_of_sdf_is_ignored(tmp_path, count, seed):
    """A file with one word more is read as another robot, or lists the word, or is refused."""
    found, nothing = ignored(count, seed, tmp_path)
    assert nothing == []
    assert found["modelled or listed"] > found["refused"] > 0


@pytest.mark.slow
def test_no_word_of_sdf_is_ignored_next_to_drake(tmp_path):
    pytest.importorskip("pydrake", reason="pip install drake")
    from vocabulary_by_drake import ignored_by_drake

    found, nothing = ignored_by_drake(800, 2, tmp_path)
    assert nothing == []
    assert found["modelled and checked"] > 50
