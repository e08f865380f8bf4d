"""What is kept of MuJoCo's compiled models: the same robot, without MuJoCo, until any file that it is made of changes."""

from __future__ import annotations

import re
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.exchange import robots
from ncgen.exchange.robots import mjcf_compiled, mjcf_kept, read_robot
from ncgen.model.digest import digest

mujoco = pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo: pip install 'ncgen[robots]'")

HERE = Path(__file__).parent

BODY = """<body name="a" pos="0 0 1"><joint name="j" axis="0 1 0"/><geom type="mesh" mesh="tetra" density="{}"/></body>"""
CORNERS = "v 0 0 0\nv {} 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture(autouse=True)
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path / "cache"))


@pytest.fixture
def compilations(monkeypatch) -> list[Path]:
    """Files that MuJoCo compiles."""
    seen, run = [], mjcf_compiled._run

    def counted(path, *others):
        seen.append(path)
        return run(path, *others)

    monkeypatch.setattr(mjcf_compiled, "_run", counted)
    return seen


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", ["gantry.xml", "fourbar.xml"])
def test_the_same_model_without_mujoco(name, compilations):
    first = ncgen.load(HERE / name)
    assert len(compilations) == 1
    second = ncgen.load(HERE / name)
    assert len(compilations) == 1
    assert digest(second) == digest(first) and second.left_out == first.left_out


def test_a_start_imports_what_it_needs_of_mujoco():
    """The first one its classes, without plugins, windows and pictures, a second one nothing."""
    program = f"import sys, ncgen; ncgen.load({str(HERE / 'gantry.xml')!r}); print(*(x in sys.modules for x in sys.argv[1:]))"
    command = [sys.executable, "-W", "ignore", "-c", program, "mujoco._structs", "mujoco", "glfw"]
    said = [subprocess.run(command, capture_output=True, text=True, check=True) for _ in range(2)]
    assert [each.stdout.strip() for each in said] == ["True False False", "False False False"]


def test_mujoco_can_be_imported_whole_later(tmp_path):
    """With sensors by plugins, whose models crash where these are not loaded; both packages then know the same classes."""
    plugin = '<extension><plugin plugin="mujoco.sensor.touch_grid"/></extension>'
    setting = '<plugin plugin="mujoco.sensor.touch_grid" objtype="site" objname="s"><config key="size" value="7 7"/>'
    setting += '<config key="fov" value="10 10"/><config key="gamma" value="0"/><config key="nchannel" value="3"/></plugin>'
    body = '<worldbody><body><joint name="j"/><geom size="1"/><site name="s"/></body></worldbody>'
    path = write(tmp_path / "r.xml", f"<mujoco>{plugin}{body}<sensor>{setting}</sensor></mujoco>")
    program = f"""import ncgen
from ncgen.exchange.robots.mjcf_bindings import bindings
ncgen.load({str(path)!r})
first = bindings().MjModel
import mujoco
data = mujoco.MjData(mujoco.MjModel.from_xml_path({str(path)!r}))
mujoco.mj_step(data.model, data)
print(first is mujoco.MjModel, mujoco is bindings(), data.time == data.model.opt.timestep, hasattr(mujoco, "GLContext"))"""
    said = subprocess.run([sys.executable, "-W", "ignore", "-c", program], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "True True True True"


def test_every_field_that_is_read_is_kept():
    """What is kept has all fields of MuJoCo's model but those of NOT_KEPT, equal ones; no module that reads models reads one of these."""
    model = mujoco.MjModel.from_xml_path(str(HERE / "gantry.xml"))
    mjcf_kept.keep_model("0" * 40, model, ["a warning"], [])
    kept, messages = mjcf_kept.kept_model("0" * 40)
    assert messages == ["a warning"]
    for mine, theirs in ((kept, model), (kept.opt, model.opt)):
        names = [name for name in dir(theirs) if name[0] != "_" and not callable(getattr(theirs, name))]
        names = [name for name in names if not mjcf_kept.NOT_KEPT.fullmatch(name) and name not in ("opt", "vis", "stat")]
        assert len(names) > 20
        for name in names:
            value, expected = getattr(mine, name), getattr(theirs, name)
            assert np.array_equal(value, expected) and np.shape(value) == np.shape(expected), name
            assert np.asarray(value).dtype == np.asarray(expected).dtype, name
    for kind, count in (("body", model.nbody), ("joint", model.njnt), ("sensor", model.nsensor), ("site", model.nsite)):
        assert [getattr(kept, kind)(i).name for i in range(count)] == [getattr(model, kind)(i).name for i in range(count)]
    sources = "".join(path.read_text() for path in Path(robots.__file__).parent.glob("mjcf*.py") if path.stem != "mjcf_kept")
    read = set(re.findall(r"\bm(?:odel)?\.(\w+)", sources)) & set(dir(model))
    assert len(read) > 60
    assert not [name for name in read if mjcf_kept.NOT_KEPT.fullmatch(name)]


LAYOUTS = {
    "next to it": ("<compiler/>", "tetra.obj", "tetra.obj"),
    "in a folder": ('<compiler meshdir="meshes"/>', "tetra.obj", "meshes/tetra.obj"),
    "in a folder that an included file names": ('<include file="settings.xml"/>', "tetra.obj", "deep/tetra.obj"),
    "without the folder of its name": ('<compiler strippath="true" assetdir="meshes"/>', "C:\\\\cad\\\\tetra.obj", "meshes/tetra.obj"),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_changed_mesh_is_seen(layout, tmp_path, compilations):
    settings, named, place = LAYOUTS[layout]
    write(tmp_path / "settings.xml", '<mujoco><compiler meshdir="deep"/></mujoco>')
    assets = f'<asset><mesh name="tetra" file="{named}"/></asset>'
    path = write(tmp_path / "r.xml", f"<mujoco>{settings}{assets}<worldbody>{BODY.format(600)}</worldbody></mujoco>")
    for count, length in enumerate((1, 2, 1, 2), 1):
        write(tmp_path / place, CORNERS.format(length))
        (link,) = [link for link in read_robot(path).links.values() if link.mass]
        assert link.mass.mass == pytest.approx(100 * length)  # density times a sixth of the edges' product
        assert len(compilations) == min(count, 2)


def test_a_changed_included_file_is_seen(tmp_path):
    path = write(tmp_path / "r.xml", '<mujoco><include file="parts/a.xml"/><asset><mesh name="tetra" file="tetra.obj"/></asset></mujoco>')
    write(tmp_path / "tetra.obj", CORNERS.format(1))
    for density in (600, 1200):
        write(tmp_path / "parts" / "a.xml", f"<mujoco><worldbody>{BODY.format(density)}</worldbody></mujoco>")
        (link,) = [link for link in read_robot(path).links.values() if link.mass]
        assert link.mass.mass == pytest.approx(density / 6)


def test_a_file_that_appears_is_seen(tmp_path):
    """A mesh that was missing is left out of the picture, and is in it once it is there."""
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    body = f'<body><joint/>{inertial}<geom type="mesh" mesh="tetra"/></body>'
    path = write(tmp_path / "r.xml", f'<mujoco><asset><mesh name="tetra" file="t.obj"/></asset><worldbody>{body}</worldbody></mujoco>')
    for there in (False, False, True, True):
        if there:
            write(tmp_path / "t.obj", CORNERS.format(1))
        (link,) = [link for link in read_robot(path).links.values() if link.mass]
        assert len(link.shapes) == there


def test_warnings_come_again(tmp_path, monkeypatch):
    path = write(tmp_path / "r.xml", '<mujoco><worldbody><body><joint/><geom size="1"/></body></worldbody></mujoco>')
    run = mjcf_compiled._run
    monkeypatch.setattr(mjcf_compiled, "_run", lambda *others: [*run(*others), "a word of MuJoCo's"])
    for _ in range(2):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            ncgen.load(path)
        assert "r.xml: a word of MuJoCo's" in [str(each.message) for each in caught]


def test_a_damaged_entry_is_made_anew(compilations, tmp_path):
    first = ncgen.load(HERE / "gantry.xml")
    (entry,) = (tmp_path / "cache" / "mjcf").glob("*.json")
    entry.write_bytes(entry.read_bytes()[:-40])
    assert digest(ncgen.load(HERE / "gantry.xml")) == digest(first)
    assert len(compilations) == 2


def test_plugins_with_settings_are_not_kept(tmp_path, compilations):
    """They may read files that nobody else knows of."""
    plugin = '<extension><plugin plugin="mujoco.pid"/></extension>'
    body = '<worldbody><body><joint name="j"/><geom size="1"/></body></worldbody>'
    plugin += '<actuator><plugin plugin="mujoco.pid" joint="j"><config key="kp" value="1"/></plugin></actuator>'
    path = write(tmp_path / "r.xml", f"<mujoco>{plugin}{body}</mujoco>")
    for count in (1, 2):
        ncgen.load(path)
        assert len(compilations) == count


def test_plugins_whose_settings_are_shapes_are_kept(tmp_path, compilations):
    """They read no files, and making the shapes takes longer than all else."""
    instance = '<instance name="ring"><config key="radius1" value="{}"/></instance>'
    plugin = f'<extension><plugin plugin="mujoco.sdf.torus">{instance}</plugin></extension>'
    mesh = '<asset><mesh name="ring"><plugin instance="ring"/></mesh></asset>'
    body = '<worldbody><body><joint/><geom type="sdf" mesh="ring"><plugin instance="ring"/></geom></body></worldbody>'
    for radius, count in ((0.3, 1), (0.3, 1), (0.35, 2)):
        path = write(tmp_path / "r.xml", f"<mujoco>{plugin.format(radius)}{mesh}{body}</mujoco>")
        ncgen.load(path)
        assert len(compilations) == count
