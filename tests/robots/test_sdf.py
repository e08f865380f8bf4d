"""SDF as its standard says it (sdformat.org): names, frames, nested models, includes, free bodies, and masses that follow from shapes."""

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.robots import read_robot

MASS = "<inertial><mass>2</mass><inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.25</izz></inertia></inertial>"
HINGE = '<joint name="{}" type="revolute"><parent>{}</parent><child>{}</child><axis><xyz>0 1 0</xyz></axis></joint>'


@pytest.fixture
def read(tmp_path):
    def robot(inside, version="1.12", name="m.sdf"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f'<sdf version="{version}">{inside}</sdf>', encoding="utf-8")
        return read_robot(path)

    return robot


def model(inside, name="m", more=""):
    return f'<model name="{name}"{more}>{inside}</model>'


def link(name, pose="", more="", mass=MASS):
    return f'<link name="{name}"><pose{more}>{pose}</pose>{mass}</link>'


def stands(robot):
    """{link: position in the world}, and how its axes are turned."""
    return {name: frame for name, frame in robot.frames(robot.base).items()}


def test_links_joints_and_frames_have_names_of_their_own(read):
    """Up to 1.6 a link, a joint and a frame may have one name; a pose means the link then."""
    robot = read(
        model(link("a", "0 0 1 0 0 0") + link("b", "1 0 1 0 0 0") + HINGE.format("b", "a", "b") + HINGE.format("a", "world", "a")), "1.5"
    )
    assert [joint.name for joint in robot.joints] == ["a", "b"]
    np.testing.assert_allclose(stands(robot)["b"].position, [1, 0, 1])


def test_frames_are_ends_of_joints(read):
    """The joint is between the links that the frames move with, and stands in its child frame."""
    frames = '<frame name="tip" attached_to="a"><pose>0.5 0 0 0 0 0</pose></frame><frame name="flange" attached_to="tip"/>'
    frames += '<frame name="root" attached_to="b"><pose relative_to="flange">0 0 0.25 0 0 0</pose></frame>'
    robot = read(model(link("a") + link("b", "3 0 0 0 0 0") + frames + HINGE.format("j", "flange", "root")))
    (joint,) = robot.joints
    assert (joint.parent, joint.child, robot.floats) == ("a", "b", True)
    np.testing.assert_allclose(stands(robot)["b"].position, [0.5, 0, 0.25])
    np.testing.assert_allclose(robot.links["b"].mass.com, [2.5, 0, -0.25])


def test_poses_are_relative_in_degrees_and_as_quaternions(read):
    """a is turned by 90° about z, b stands 1 m along its x, c is turned by a quaternion about x."""
    s = np.sqrt(0.5)
    robot = read(
        model(
            link("a", "1 2 3 0 0 90", ' degrees="true"')
            + link("b", "1 0 0 0 0 0", ' relative_to="a"')
            + link("c", f"0 0 0 {s} 0 0 {s}", ' rotation_format="quat_xyzw" relative_to="b"')
            + "".join(f'<joint name="{j}" type="fixed"><parent>a</parent><child>{j}</child></joint>' for j in "bc")
        )
    )
    frames = stands(robot)
    np.testing.assert_allclose(frames["b"].position, [1, 3, 3], atol=1e-15)
    np.testing.assert_allclose(frames["a"].rotation @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(frames["c"].rotation @ [0, 1, 0], [0, 0, 1], atol=1e-15)


@pytest.mark.parametrize(
    ("pose", "said"),
    [
        (' rotation_format="quat_xyzw">0 0 0 1 1 1 1', "the quaternion has length 2; divide it by that"),
        (' rotation_format="quat_xyzw" degrees="true">0 0 0 0 0 0 1', "a quaternion has no degrees"),
        (' rotation_format="euler_zyx">0 0 0 0 0 0', "a rotation is euler_rpy or quat_xyzw, not 'euler_zyx'"),
        (' degrees="maybe">0 0 0 0 0 0', "'maybe' is neither true nor false"),
    ],
)
def test_rotations_that_are_none(read, pose, said):
    with pytest.raises(ModelError, match=f"m.sdf, line 1: .*{said}"):
        read(model(f'<link name="a"><pose{pose}</pose></link>'))


INNER = model(link("base", "0 0 0.5 0 0 0") + link("arm", "1 0 0.5 0 0 0") + HINGE.format("elbow", "base", "arm"), "inner", "{}")


def test_nested_models_have_names_of_their_own(read):
    """The inner model is placed so that its arm stands where its pose says; its base hangs on the outer link."""
    inside = link("base") + INNER.format(' placement_frame="arm"').replace("<link", "<pose>2 0 0 0 0 0</pose><link", 1)
    robot = read(model(inside + HINGE.format("shoulder", "base", "inner::base")))
    assert [joint.name for joint in robot.joints] == ["shoulder", "inner::elbow"]
    frames = stands(robot)
    np.testing.assert_allclose(frames["inner::arm"].position, [2, 0, 0])
    np.testing.assert_allclose(frames["inner::base"].position, [1, 0, 0])


def test_a_model_as_the_end_of_a_joint_is_its_canonical_link(read):
    inside = link("base") + INNER.format(' canonical_link="arm"') + HINGE.format("shoulder", "base", "inner")
    robot = read(model(inside))
    assert {joint.name: (joint.parent, joint.child) for joint in robot.joints} == {
        "shoulder": ("base", "inner::arm"), "inner::elbow": ("inner::arm", "inner::base")
    }  # fmt: skip


@pytest.mark.parametrize(("uri", "merge"), [("inner.sdf", ""), ("model://shelf", ""), ("shelf", ""), ("shelf", ' merge="true"')])
def test_includes_are_found_beside_the_file(read, tmp_path, uri, merge):
    """A file, or a folder with a description that names one; its pose and name are those of the include."""
    text = f'<sdf version="1.8">{INNER.format("")}</sdf>'
    (tmp_path / "inner.sdf").write_text(text)
    (tmp_path / "shelf").mkdir()
    (tmp_path / "shelf" / "model.config").write_text('<model><sdf version="1.4">old.sdf</sdf><sdf version="1.8">new.sdf</sdf></model>')
    (tmp_path / "shelf" / "new.sdf").write_text(text)
    include = f"<include{merge}><uri>{uri}</uri><name>tool</name><pose>0 0 2 0 0 0</pose></include>"
    inside = '<link name="floor"/>' + include + HINGE.format("j", "floor", "arm" if merge else "tool::arm")
    robot = read(model(inside))
    prefix = "" if merge else "tool::"
    assert set(robot.links) == {"floor", f"{prefix}base", f"{prefix}arm"}
    np.testing.assert_allclose(stands(robot)[f"{prefix}arm"].position, [1, 0, 2.5])


def test_a_file_that_includes_itself_is_refused(read):
    with pytest.raises(ModelError, match="more than 20 files include each other"):
        read(model("<link name='a'/><include><uri>m.sdf</uri></include>"))


def test_several_models_are_free_bodies_and_a_floor(read):
    """The static one rests, and takes no part in the names; the others fall."""
    floor = model("<static>true</static>" + link("slab"), "floor")
    world = "<world name='w'>{}</world>"
    robot = read(world.format(floor + model(link("a", "0 0 1 0 0 0"), "cup")))
    assert [(joint.kind, joint.child) for joint in robot.joints] == [("fixed", "floor::slab"), ("floating", "a")]
    assert robot.gravity == (0.0, 0.0, -9.8)
    robot = read(world.format(floor + model(link("a"), "cup") + model(link("a") + link("b"), "plate")))
    assert [joint.child for joint in robot.joints if joint.kind == "floating"] == ["cup::a", "plate::a", "plate::b"]


def test_several_free_bodies_fall(tmp_path):
    """12 degrees of freedom, and each centre of mass falls with g."""
    (tmp_path / "m.sdf").write_text(f'<sdf version="1.7">{model(link("a") + link("b", "1 0 0 0.3 0 0"))}</sdf>')
    kernels = ncgen.compile(ncgen.load(tmp_path / "m.sdf"), "numpy")
    assert ncgen.freedom(kernels).dof == 12
    run = ncgen.simulate(kernels, 0.2, points=2)
    np.testing.assert_allclose(run["r_b.z"][-1], -0.5 * 9.81 * 0.04, rtol=1e-9)


def test_a_link_without_gravity_has_no_weight(tmp_path):
    """A bar that turns about y on a base that rests: of two links fixed to each other one has weight, m g l cos ψ over both inertias."""
    arm = link("arm", "0.5 0 0 0 0 0") + link("tip", "1 0 0 0 0 0").replace("<inertial>", "<gravity>false</gravity><inertial>")
    joint = HINGE.format("j", "world", "arm").replace("<parent>", "<pose>-0.5 0 0 0 0 0</pose><parent>")
    text = model(arm + joint + '<joint name="f" type="fixed"><parent>arm</parent><child>tip</child></joint>')
    (tmp_path / "m.sdf").write_text(f'<sdf version="1.7">{text}</sdf>')
    space = ncgen.joint_space(ncgen.compile(ncgen.load(tmp_path / "m.sdf"), "numpy"))
    inertia = 2 * 0.2 + 2 * (0.25 + 1.0)
    for psi in (0.0, 0.4):
        found = space.forward_dynamics(space.position({"j": psi}))
        assert found == pytest.approx([2 * 9.81 * 0.5 * np.cos(psi) / inertia], rel=1e-12)


def test_nothing_of_a_static_model_moves(read):
    robot = read(model("<static>1</static>" + link("a") + link("b") + HINGE.format("j", "a", "b")))
    assert [(joint.kind, joint.parent) for joint in robot.joints] == [("fixed", "world")] * 2
    assert robot.omitted == ("joints of models that rest (1)",)


def test_joints_are_turned_where_a_link_would_hang_on_two(tmp_path):
    """Both joints name c as their child, so a or b would hang on nothing: the motion is that of the chain a, c, b said from end to end."""
    bodies = link("a") + link("c", "1 0 0 0 0 0") + link("b", "2 0 0 0 0 0") + HINGE.format("held", "world", "a")
    second = '<joint name="two" type="revolute"><pose relative_to="b">-0.5 0 0 0 0 0</pose><parent>{}</parent><child>{}</child>'
    second += "<axis><xyz expressed_in='__model__'>0 {} 0</xyz></axis></joint>"
    runs = []
    for text in (second.format("b", "c", 1), second.format("c", "b", -1)):
        (tmp_path / "m.sdf").write_text(f'<sdf version="1.9">{model(bodies + HINGE.format("one", "a", "c") + text)}</sdf>')
        kernels = ncgen.compile(ncgen.load(tmp_path / "m.sdf"), "numpy")
        assert ncgen.freedom(kernels).dof == 3
        run = ncgen.simulate(kernels, 0.3, zd0={"one": 0.5, "two": -1.0}, rtol=1e-10, points=4)
        runs.append([run[name] for name in ("held", "one", "two")])
    assert np.ptp(runs[0][2]) > 0.1
    np.testing.assert_allclose(runs[0], runs[1], rtol=0, atol=1e-9)


def test_a_link_without_inertia_has_that_of_the_standard(read):
    mass = read(model('<link name="a"/>')).links["a"].mass
    assert mass.mass == 1.0 and np.array_equal(mass.tensor, np.eye(3)) and np.array_equal(mass.com, np.zeros(3))


SHAPES = {
    "<box><size>1 2 3</size></box>": (6.0, 1 / 12 * np.array([13, 10, 5])),
    "<sphere><radius>2</radius></sphere>": (32 / 3 * np.pi, np.full(3, 2 / 5 * 4)),
    "<ellipsoid><radii>1 2 3</radii></ellipsoid>": (8 * np.pi, 1 / 5 * np.array([13, 10, 5])),
    "<cylinder><radius>2</radius><length>3</length></cylinder>": (12 * np.pi, np.array([1.75, 1.75, 2.0])),
    "<cone><radius>2</radius><length>3</length></cone>": (4 * np.pi, np.array([0.9375, 0.9375, 1.2])),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_inertia_of_a_shape(read, shape):
    """Textbook values; a shape's own density comes before its link's, that before 1000 kg/m³, and a mass scales all."""
    collision = f"<collision name='c'><pose>0 0 1 0 0 0</pose><geometry>{shape}</geometry>{{}}</collision>"
    volume, squares = SHAPES[shape]
    for own, inertial, mass in (
        ("", "<inertial auto='true'/>", 1000 * volume),
        ("", "<inertial auto='true'><density>7</density></inertial>", 7 * volume),
        ("<density>3</density>", "<inertial auto='true'><density>7</density></inertial>", 3 * volume),
        ("<density>3</density>", "<inertial auto='1'><mass>5</mass></inertial>", 5.0),
    ):
        found = read(model(f"<link name='a'>{inertial}{collision.format(own)}</link>")).links["a"].mass
        assert found.mass == pytest.approx(mass, rel=1e-14)
        np.testing.assert_allclose(found.tensor, mass * np.diag(squares), rtol=1e-14, atol=1e-14 * mass)
        np.testing.assert_allclose(found.com, [0, 0, 0.25 if "cone" in shape else 1.0], rtol=1e-14)


def test_inertia_of_a_capsule_is_that_of_its_volume(read):
    """Against a sum over thin discs along its axis."""
    shape = "<capsule><radius>0.3</radius><length>0.8</length></capsule>"
    found = read(model(f"<link name='a'><inertial auto='true'/><collision name='c'><geometry>{shape}</geometry></collision></link>"))
    z, weights = np.polynomial.legendre.leggauss(40)
    parts = [(0.4 * z, 0.4 * weights, np.full(40, 0.09))]
    parts += [(side * (0.4 + 0.15 * (z + 1)), 0.15 * weights, 0.09 - (0.15 * (z + 1)) ** 2) for side in (1, -1)]
    mass = sum(np.sum(1000 * np.pi * w * r2) for _, w, r2 in parts)
    along = sum(np.sum(1000 * np.pi * w * r2 * r2 / 2) for _, w, r2 in parts)
    across = sum(np.sum(1000 * np.pi * w * r2 * (r2 / 4 + z * z)) for z, w, r2 in parts)
    own = found.links["a"].mass
    assert own.mass == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(own.tensor, np.diag([across, across, along]), rtol=1e-12, atol=1e-12)


CUBE = "\n".join(f"v {x} {y} {z}" for z in (1, 2) for y in (0, 2) for x in (0, 3)) + "\n" + "\n".join(
    f"f {face}" for face in ("1 3 4", "1 4 2", "5 6 8", "5 8 7", "1 2 6", "1 6 5", "3 7 8", "3 8 4", "1 5 7", "1 7 3", "2 4 8", "2 8 6")
)  # fmt: skip


@pytest.mark.parametrize("scale", ["1 1 1", "0.5 2 -1"])
def test_inertia_of_a_mesh_is_that_of_what_it_encloses(read, tmp_path, scale):
    """A block of 3 x 2 x 1 m with a corner at the origin's height 1, scaled, also mirrored."""
    pytest.importorskip("trimesh")
    (tmp_path / "block.obj").write_text(CUBE)
    mesh = f"<geometry><mesh><uri>block.obj</uri><scale>{scale}</scale></mesh></geometry>"
    mass = read(model(f"<link name='a'><inertial auto='true'/><collision name='c'>{mesh}</collision></link>")).links["a"].mass
    sizes = np.array([3, 2, 1]) * np.abs(np.array(scale.split(), dtype=float))
    total = 1000 * sizes.prod()
    assert mass.mass == pytest.approx(total, rel=1e-13)
    np.testing.assert_allclose(mass.com, np.array([1.5, 1, 1.5]) * np.array(scale.split(), dtype=float), rtol=1e-13)
    np.testing.assert_allclose(mass.tensor, total / 12 * np.diag(sizes @ sizes - sizes**2), rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        ("<inertial auto='true'/>", "its inertia is that of its collision shapes, and it has none; give it a <collision>"),
        (
            "<inertial auto='true'/><collision name='c'><geometry><plane/></geometry></collision>",
            "nothing is known of the inertia of a shape of kind plane; write the <inertial> out",
        ),
        (
            "<inertial auto='true'/><collision name='c'><geometry><mesh><uri>no.stl</uri></mesh></geometry></collision>",
            "its inertia is that of mesh 'no.stl': there is no such file here",
        ),
        ("<inertial><pose relative_to='b'/></inertial>", "the pose of an <inertial> is relative to its link"),
    ],
)
def test_inertias_that_are_not_computed(read, inside, said):
    with pytest.raises(ModelError) as refused:
        read(model(f"<link name='a'>{inside}</link><link name='b'/>"))
    assert said in str(refused.value) and str(refused.value).startswith("m.sdf, line 1: ")


@pytest.mark.parametrize(
    ("said", "pitch"),
    [("", 1.0), ("<screw_thread_pitch>0.02</screw_thread_pitch>", 0.02), ("<thread_pitch>-10</thread_pitch>", np.pi / 5)],
)
def test_the_pitch_of_a_screw(read, said, pitch):
    """m a turn; before 1.10 rad/m, positive left-handed; 1 m a turn without a word."""
    screw = f'<joint name="s" type="screw"><parent>world</parent><child>a</child><axis><xyz>0 0 1</xyz></axis>{said}</joint>'
    assert read(model(link("a") + screw)).joints[0].pitch == pytest.approx(pitch, rel=1e-15)


LEFT = [
    ("<gravity>false</gravity>", None),
    ("<kinematic>true</kinematic>", "kinematic links, which move as others do (1)"),
    ("<velocity_decay><linear>0.1</linear><angular>0</angular></velocity_decay>", "decay of links' velocities (1)"),
    ("<velocity_decay/>", None),
    ("<inertial><fluid_added_mass><xx>3</xx></fluid_added_mass></inertial>", "masses of a fluid that moves along (1)"),
    ("<sensor name='s' type='imu'/>", "sensors (1)"),
    ("<wheel/>", "<wheel> in <link>, which is none of the format's elements (1)"),
    ("<pose offset='1'/>", "the attribute offset of <pose>, which is none of the format's (1)"),
    (
        "<visual name='v'><geometry><box><size>a b</size></box></geometry></visual>",
        "shapes of other kinds, visual that cannot be read first (1)",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("inside", "said"), LEFT)
def test_what_is_not_modelled_is_listed(read, inside, said):
    assert read(model(f"<link name='a'>{inside}</link>")).omitted == ((said,) if said else ())


@pytest.mark.parametrize(
    ("kind", "inside", "said"),
    [
        ("ball", "<axis><xyz>0 0 1</xyz></axis>", None),
        ("ball", "<axis><xyz>0 1 0</xyz></axis>", "axes of joints that have none (1)"),
        (
            "universal",
            "<axis><xyz>1 0 0</xyz><dynamics><damping>3</damping></dynamics></axis><axis2><xyz>0 1 0</xyz></axis2>",
            "damping of joints with several degrees of freedom or none (1)",
        ),
        ("revolute", "<axis><xyz>0 1 0</xyz><limit><effort>30</effort><velocity>-1</velocity></limit></axis>", "effort limits (1)"),
        (
            "revolute",
            "<axis><xyz>0 1 0</xyz></axis><physics><ode><max_force>3</max_force></ode></physics>",
            "motors of physics engines (1)",
        ),
        ("fixed", "<thread_pitch>3</thread_pitch>", "screws and gears of joints that are none (1)"),
    ],
)
def test_what_is_not_modelled_of_joints_is_listed(read, kind, inside, said):
    joint = f"<joint name='j' type='{kind}'><parent>a</parent><child>b</child>{inside}</joint>"
    assert read(model(link("a") + link("b") + joint)).omitted == ((said,) if said else ())


def test_words_of_included_files_are_accounted_for(read, tmp_path):
    tool = model(link("t") + "<plugin name='p' filename='p.so'/>", "tool")
    (tmp_path / "tool.sdf").write_text(f'<sdf version="1.9">{tool}</sdf>')
    world = "<world name='w'><include><uri>tool.sdf</uri></include></world>"
    assert read(world).omitted == ("plugins (1)",)


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        (model(link("a") + link("a")), "there are two links 'a'; rename one"),
        (model(link("a") + HINGE.format("j", "a", "a")), "joint j: its parent and its child are both a"),
        (model(link("a") + model("", "n") + HINGE.format("j", "a", "n")), "joint j: its child 'n' is no link, frame or model here"),
        ("<world name='a'/><world name='b'/>", "2 worlds; a file that is read has one"),
    ],
)
def test_what_is_wrong_is_told(read, inside, said):
    with pytest.raises(ModelError, match=said):
        read(inside)


def test_old_files_are_refused(read):
    with pytest.raises(ModelError, match="SDF 1.0 is not read; convert it to 1.4 or later"):
        read(model(link("a")), "1.0")


@pytest.mark.parametrize("ends", [("world", "nut"), ("nut", "world")])
def test_a_screw_has_the_name_and_the_zero_of_the_file(tmp_path, ends):
    """A nut on a vertical screw of pitch p sinks: ψ̈ = −m g k / (I + m k²), k = p/2π m/rad; its coordinate begins at 0."""
    screw = f'<joint name="lead" type="screw"><pose relative_to="nut"/><parent>{ends[0]}</parent><child>{ends[1]}</child>'
    screw += "<axis><xyz>0 0 1</xyz></axis><screw_thread_pitch>0.5</screw_thread_pitch></joint>"
    (tmp_path / "m.sdf").write_text(f'<sdf version="1.10">{model(link("nut", "0.3 0 1 0 0 0.7") + screw)}</sdf>')
    kernels = ncgen.compile(ncgen.load(tmp_path / "m.sdf"), "numpy")
    assert kernels.q0[kernels.index["lead"]] == pytest.approx(0.0, abs=1e-15)
    run = ncgen.simulate(kernels, 0.8, rtol=1e-10, points=3)
    k, sign = 0.5 / (2 * np.pi), 1 if ends[0] == "world" else -1
    expected = -2 * 9.81 * k / (0.25 + 2 * k * k) * 0.8**2 / 2
    assert run["lead"][-1] == pytest.approx(sign * expected, rel=1e-8)
    assert run["lead_slide"][-1] == pytest.approx(sign * k * expected, rel=1e-8)


def test_a_canonical_link_that_is_not_there_is_refused(read):
    with pytest.raises(ModelError, match="canonical_link: model 'm' has no link 'z'; name one of its links"):
        read(model(link("a"), more=' canonical_link="z"'))


def test_a_screw_turns_about_its_own_axis(tmp_path):
    """Where the link that carries it has points elsewhere: the nut turns about the axis, and goes k ψ along it."""
    joints = '<joint name="rail" type="prismatic"><parent>world</parent><child>a</child><axis><xyz>1 0 0</xyz></axis></joint>'
    joints += (
        '<joint name="lead" type="screw"><pose>0.5 0.2 0 0 0 0</pose><parent>a</parent><child>nut</child><axis><xyz>0 0 1</xyz></axis>'
    )
    joints += "<screw_thread_pitch>0.5</screw_thread_pitch></joint>"
    (tmp_path / "m.sdf").write_text(f'<sdf version="1.10">{model(link("a") + link("nut", "0 1 0 0 0 0") + joints)}</sdf>')
    loaded, angle, axis = ncgen.load(tmp_path / "m.sdf"), 0.7, np.array([0.5, 1.2, 0.0])
    kernels, moved = ncgen.compile(loaded, "numpy"), np.array([0.0, 0.0, 0.5 / (2 * np.pi) * angle])
    turn, q = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]), np.array(kernels.q0)
    for element in set(loaded.bodies["nut"].elements) - set(loaded.bodies["a"].elements):
        is_point = element in loaded.bodies["nut"].points
        value = axis + turn @ (element.initial - axis) + moved if is_point else turn @ element.initial
        for component, each in zip(element.components, value, strict=True):
            q[kernels.index[component.name]] = each
    q[kernels.index["lead"]], q[kernels.index["lead_slide"]] = angle, moved[2]
    assert np.max(np.abs(kernels.phi(q, 0.0, kernels.p0))) < 1e-14


def test_inertias_that_no_body_has_are_balanced_where_that_is_asked_for(tmp_path):
    """By their mean, with a warning; others stay as they are."""
    flat = "<inertial><mass>2</mass><inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.6</izz></inertia></inertial>"
    (tmp_path / "m.sdf").write_text(f'<sdf version="1.7">{model(link("a", mass=flat) + link("b") + HINGE.format("j", "a", "b"))}</sdf>')
    with pytest.raises(ModelError, match="body a: no body has principal moments of inertia 0.1, 0.2, 0.6"):
        ncgen.load(tmp_path / "m.sdf")
    with pytest.warns(UserWarning, match=r"m: moments of inertia that no body has are replaced by their mean, those of a first \(1\)"):
        bodies = ncgen.load(tmp_path / "m.sdf", inertias="balanced").bodies
    np.testing.assert_allclose(bodies["a"].inertia.tensor.astype(float), 0.3 * np.eye(3), rtol=1e-15)
    np.testing.assert_allclose(bodies["b"].inertia.tensor.astype(float), np.diag([0.1, 0.2, 0.25]), rtol=1e-15)
    with pytest.raises(ModelError, match="inertias: 'guessed' given; give 'refused', 'balanced' or 'as given'"):
        ncgen.load(tmp_path / "m.sdf", inertias="guessed")


def test_motors_have_the_effort_limits_of_the_file(read):
    """A negative one is none."""
    for effort, expected in (("30", (-30.0, 30.0)), ("-1", None), ("inf", None)):
        joint = HINGE.format("j", "a", "b").replace("</axis>", f"<limit><effort>{effort}</effort></limit></axis>")
        assert read(model(link("a") + link("b") + joint)).joints[0].effort == expected
