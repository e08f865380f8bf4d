"""Masses, centres of mass and moments of inertia of a robot from a file as parameters, a payload among them."""

import sysconfig
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.toml_reader import model_of
from ncgen.exchange.toml_writer import to_toml
from ncgen.program.motions.dynamics import assemble_motion
from ncgen.solver.engines.acceleration_forms import own_positions
from ncgen.solver.motions.step_preparation import outputs_at
from tests.robots.test_link_frames import ARM

ROBOTS = Path(sysconfig.get_paths()["purelib"], "cmeel.prefix/share/example-robot-data/robots")

NAMES = ["mass", *(f"centre.{a}" for a in "xyz"), *(f"inertia.{ij}" for ij in ("xx", "yy", "zz", "xy", "xz", "yz"))]

OTHER = {
    "hand.mass": 1.7, "hand.centre.x": 0.03, "hand.centre.y": -0.02, "hand.centre.z": 0.11, "hand.inertia.xx": 0.05,
    "hand.inertia.yy": 0.06, "hand.inertia.zz": 0.04, "hand.inertia.xy": 0.004, "hand.inertia.xz": -0.003, "hand.inertia.yz": 0.002,
    "tool0.mass": 0.8, "tool0.centre.x": 0.05, "tool0.centre.y": 0.01, "tool0.centre.z": -0.04, "tool0.inertia.xx": 0.003,
    "tool0.inertia.yy": 0.002, "tool0.inertia.zz": 0.002, "tool0.inertia.xy": 0.0001, "tool0.inertia.xz": 0.0, "tool0.inertia.yz": 0.0002,
}  # fmt: skip


def inertial(name):
    """A link's `<inertial>` with the numbers of OTHER."""
    mass, x, y, z, *moments = (OTHER[f"{name}.{what}"] for what in NAMES)
    entries = " ".join(f'i{ij}="{value}"' for ij, value in zip(("xx", "yy", "zz", "xy", "xz", "yz"), moments, strict=True))
    return f'<inertial><origin xyz="{x} {y} {z}"/><mass value="{mass}"/><inertia {entries}/></inertial>'


def changed_text():
    """The arm's file with the numbers of OTHER in it."""
    before, rest = ARM.split('<link name="hand">')
    after = rest.split("</link>", 1)[1]
    text = f'{before}<link name="hand">{inertial("hand")}</link>{after}'
    return text.replace('<link name="tool0"/>', f'<link name="tool0">{inertial("tool0")}</link>')


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The arm, and the same with other numbers."""
    folder = tmp_path_factory.mktemp("arm")
    (folder / "arm.urdf").write_text(ARM)
    (folder / "changed.urdf").write_text(changed_text())
    return folder / "arm.urdf", folder / "changed.urdf"


@pytest.fixture(scope="module")
def arm(files):
    """The arm whose inertia and payload are parameters, and the one with the other numbers in its file."""
    return (
        ncgen.compile(ncgen.load(files[0], parameters=["inertia", "tool0"])),
        ncgen.compile(ncgen.load(files[1]), "numpy"),
    )


def states(space, count=5):
    rng = np.random.default_rng(3)
    for _ in range(count):
        yield dict(zip(space.rates, rng.uniform(-1, 1, space.n).tolist(), strict=True)), rng.normal(size=space.n), rng.normal(size=space.n)


def test_names_units_and_values_are_the_files(files):
    model = ncgen.load(files[0], parameters=["inertia", "tool0"])
    assert list(model.parameters) == [f"{link}.{name}" for link in ("upper", "lower", "hand", "tool0") for name in NAMES]
    defaults = [model.parameters[f"upper.{name}"].default for name in NAMES]
    assert defaults == [2.0, 0.2, 0.0, 0.1, 0.02, 0.1, 0.1, 0.0, 0.0, 0.0]
    assert {model.parameters[f"tool0.{name}"].default for name in NAMES} == {0.0}
    assert [model.parameters[f"hand.{name}"].unit for name in ("mass", "centre.x", "inertia.xy")] == ["kg", "m", "kg m2"]


def test_other_values_are_those_of_a_file_that_has_them(arm):
    space, theirs = ncgen.joint_space(arm[0]).at(OTHER), ncgen.joint_space(arm[1])
    for values, v, a in states(space):
        q, q_theirs = space.position(values), theirs.position(values)
        pairs = [
            (space.inverse_dynamics(q, v, a), theirs.inverse_dynamics(q_theirs, v, a)),
            (space.forward_dynamics(q, v, a), theirs.forward_dynamics(q_theirs, v, a)),
            (space.centre_of_mass(q), theirs.centre_of_mass(q_theirs)),
            (space.kinetic_energy(q, v), theirs.kinetic_energy(q_theirs, v)),
        ]
        for ours, expected in pairs:
            np.testing.assert_allclose(ours, expected, rtol=1e-12, atol=1e-12)


def test_defaults_are_the_files_numbers(arm, files):
    space, plain = ncgen.joint_space(arm[0]), ncgen.joint_space(ncgen.compile(ncgen.load(files[0]), "numpy"))
    for values, v, a in states(space):
        q = space.position(values)
        np.testing.assert_allclose(
            space.inverse_dynamics(q, v, a), plain.inverse_dynamics(plain.position(values), v, a), rtol=1e-13, atol=1e-13
        )


def test_a_motion_with_other_values_is_that_of_the_other_file(arm):
    start = {"duration": 0.5, "zd0": {"a": 1.0, "c": -2.0}, "rtol": 1e-12, "atol": 1e-13}
    ours, theirs = ncgen.simulate(arm[0], p=OTHER, **start), ncgen.simulate(arm[1], **start)
    for name in ("a", "b", "c"):
        assert abs(ours.q[-1, arm[0].index[name]] - theirs.q[-1, arm[1].index[name]]) < 1e-9


def test_a_gradient_by_the_payload_is_that_of_differences(arm):
    kernels = arm[0]

    def height(q, qd):
        by_q = 0 * q
        by_q[-1, kernels.index["a"]] = 1.0
        return q[-1, kernels.index["a"]], by_q, None

    slope = ncgen.gradient(kernels, 0.2, 20, height, p=OTHER).derivatives["tool0.mass"]
    step = 1e-3
    ends = [ncgen.gradient(kernels, 0.2, 20, height, p=OTHER | {"tool0.mass": 0.8 + sign * step}).value for sign in (1, -1)]
    assert abs(slope - (ends[0] - ends[1]) / (2 * step)) < 1e-6 * abs(slope)


@pytest.mark.parametrize(
    ("p", "said"),
    [
        ({"hand.mass": -1.0}, "hand.mass = -1"),
        ({"tool0.mass": -0.1}, "body tool0: the mass is -0.1 kg"),  # next to the hand's kilogram the sum is positive
        ({"upper.inertia.xx": 5.0}, "no body has principal moments of inertia 0.1, 0.1, 5 kg m2"),
        ({"upper.inertia": 1.0}, "upper.inertia"),
    ],
)
def test_what_no_body_has_is_refused(arm, p, said):
    with pytest.raises(ModelError, match=said):
        ncgen.joint_space(arm[0]).at(p)
    with pytest.raises(ModelError, match=said):
        ncgen.simulate(arm[0], 0.1, p=p)


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ("mass", "no link or joint 'mass'"),
        (["base"], "link base rests"),
        (3, "3 given"),
        ([1], "given"),
    ],
)
def test_what_is_no_link_is_refused(files, parameters, said):
    with pytest.raises(ModelError, match=said):
        ncgen.load(files[0], parameters=parameters)
    if parameters == "mass":
        with pytest.raises(ModelError, match="parameters is for a robot's file"):
            ncgen.load("robot", parameters="inertia")


def test_a_light_link_with_parameters_moves_by_the_recursion(files):
    """Values that a program is tried with make its moments those of no body, as products of inertia that the file gives as 0."""
    heavy = '<origin xyz="0 0.05 0"/><mass value="1"/><inertia ixx="0.02" iyy="0.04" izz="0.05"/>'
    light = ARM.replace(heavy, '<mass value="0.01"/><inertia ixx="2e-6" iyy="2e-6" izz="2e-6"/>')
    assert light != ARM
    (files[0].parent / "light.urdf").write_text(light)
    kernels = ncgen.compile(ncgen.load(files[0].parent / "light.urdf", parameters="inertia"), "numpy")
    seen = own_positions(kernels)
    assert seen and assemble_motion(kernels.programs.equations, *seen, kernels.column_sizes) is not None


def test_only_what_is_named_becomes_a_parameter(files):
    assert {name.split(".")[0] for name in ncgen.load(files[0], parameters="tool0").parameters} == {"tool0"}
    assert not ncgen.load(files[0]).parameters


def test_a_model_file_keeps_them(arm, tmp_path):
    again = ncgen.joint_space(ncgen.compile(model_of(to_toml(arm[0].model), tmp_path / "arm.toml"), "numpy")).at(OTHER)
    space = ncgen.joint_space(arm[0]).at(OTHER)
    for values, v, a in states(space, 2):
        np.testing.assert_allclose(
            again.inverse_dynamics(again.position(values), v, a), space.inverse_dynamics(space.position(values), v, a), rtol=1e-13
        )


ORIGINS = {
    "a.origin.x": 0.15, "a.origin.y": 0.02, "a.origin.z": 0.25, "b.origin.x": 0.35, "b.origin.y": -0.04, "b.origin.z": 0.03,
    "c.origin.x": 0.28, "c.origin.y": 0.13, "c.origin.z": -0.05,
}  # fmt: skip


def moved_text():
    """The arm's file with the placements of ORIGINS in it."""
    text = ARM
    for joint, before in (("a", "0.1 0 0.3"), ("b", "0.4 0 0"), ("c", "0.3 0.1 0")):
        place = " ".join(str(ORIGINS[f"{joint}.origin.{axis}"]) for axis in "xyz")
        assert text.count(f'<origin xyz="{before}" rpy') == 1
        text = text.replace(f'<origin xyz="{before}" rpy', f'<origin xyz="{place}" rpy')
    return text


def test_placements_of_joints_are_those_of_a_file_that_has_them(files):
    (files[0].parent / "moved.urdf").write_text(moved_text())
    model = ncgen.load(files[0], parameters=["geometry", "hand"])
    assert list(model.parameters)[:9] == list(ORIGINS) and [model.parameters[f"a.origin.{axis}"].default for axis in "xyz"] == [
        0.1,
        0.0,
        0.3,
    ]
    p = ORIGINS | {"hand.mass": 1.3}
    ours = ncgen.joint_space(ncgen.compile(model, "numpy")).at(p)
    theirs = ncgen.joint_space(ncgen.compile(ncgen.load(files[0].parent / "moved.urdf", parameters="hand"), "numpy")).at({"hand.mass": 1.3})
    for values, v, a in states(ours, 3):
        q, q_theirs = ours.position(values), theirs.position(values)
        pairs = [
            (ours.inverse_dynamics(q, v, a), theirs.inverse_dynamics(q_theirs, v, a)),
            (ours.forward_dynamics(q, v, a), theirs.forward_dynamics(q_theirs, v, a)),
            (ours.regressor(q, v, a) @ ours.inertial_values(), ours.inverse_dynamics(q, v, a)),
        ]
        for found, expected in pairs:
            np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)


FRAMES = ("base", "rail", "upper", "lower", "hand", "tool0")


def test_frames_go_with_placements_of_joints(files):
    """Those of all links, of that which begins at a joint of the ground and of those that rest, too; and as outputs of a motion."""
    (files[0].parent / "moved.urdf").write_text(moved_text())
    ours = ncgen.compile(ncgen.load(files[0], parameters="geometry", frames=FRAMES), "numpy")
    theirs = ncgen.compile(ncgen.load(files[0].parent / "moved.urdf", frames=FRAMES), "numpy")
    space, other = ncgen.joint_space(ours).at(ORIGINS), ncgen.joint_space(theirs)
    for values, v, _ in states(space, 2):
        q, q_theirs = space.position(values), other.position(values)
        found = outputs_at(ours, 0.0, q, 0 * q, 0 * q, space.p)
        np.testing.assert_allclose(found, outputs_at(theirs, 0.0, q_theirs, 0 * q_theirs, 0 * q_theirs, other.p), atol=1e-14)
        told = dict(zip(ours.model.outputs, found, strict=True))
        for name in FRAMES:
            frames = space.frame(name), other.frame(name)
            pairs = [
                (*frame.pose(at), frame.velocity(at, v), frame.jacobian_derivative(at, v))
                for frame, at in zip(frames, (q, q_theirs), strict=True)
            ]
            for here, there in zip(*pairs, strict=True):
                np.testing.assert_allclose(here, there, atol=1e-13)
            np.testing.assert_allclose([told[f"{name}.{axis}"] for axis in "xyz"], pairs[0][1], atol=1e-14)


@pytest.mark.slow
def test_a_motion_with_other_placements_stays_closed_and_is_the_other_files(files):
    (files[0].parent / "moved.urdf").write_text(moved_text())
    ours = ncgen.compile(ncgen.load(files[0], parameters="geometry"), "numpy")
    theirs = ncgen.compile(ncgen.load(files[0].parent / "moved.urdf"), "numpy")
    asked = {"duration": 0.2, "zd0": {"a": 1.0, "c": -2.0}, "rtol": 1e-10, "engine": "python", "integrator": "dop853"}
    runs = ncgen.simulate(ours, p=ORIGINS, **asked), ncgen.simulate(theirs, **asked)
    for name in ("a", "b", "c"):
        assert abs(runs[0].q[-1, ours.index[name]] - runs[1].q[-1, theirs.index[name]]) < 1e-7


def test_a_fixed_joint_has_no_placement_to_change(files):
    with pytest.raises(ModelError, match="joint t is fixed"):
        ncgen.load(files[0], parameters=["t"])
