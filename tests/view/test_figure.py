"""Still figures, time histories, and saving them."""

from pathlib import Path

import numpy as np
import pytest
from turning import TurningRun

import ncgen
from ncgen import view
from ncgen.errors import NcgenError
from ncgen.model import Model
from ncgen.view.figure import figure, plot, save
from ncgen.view.label_places import LabelPlaces


def artists(axes, gid):
    """What was drawn under a name."""
    return [artist for artist in axes.get_children() if artist.get_gid() == gid]


def texts(axes, gid):
    return [text.get_text() for text in artists(axes, gid)]


def test_the_robot_is_drawn_as_in_figure_3(robot_model):
    """Ten lines, nine arrows, eight points, each with its name, in three dimensions with equal scales."""
    (axes,) = figure(robot_model, names=True).axes
    assert axes.name == "3d"
    assert len(artists(axes, "segment")) == 10
    assert len(artists(axes, "arrow")) == 9
    assert len(artists(axes, "point")) == 8
    assert texts(axes, "point name") == [f"r{i}" for i in range(1, 9)]
    assert sorted(texts(axes, "vector name")) == sorted(["u1", "u2", *["u3"] * 5, "u4", "u5"])
    assert [axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel()] == ["X (m)", "Y (m)", "Z (m)"]
    sides = [np.ptp(limits) for limits in (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())]
    assert np.ptp(sides / axes._box_aspect) < 1e-12
    assert axes.get_title() == "robot"


def test_a_frame_of_a_run_shows_its_time(robot_run):
    """The lines are at the positions of the frame; negative frames count from the end."""
    (axes,) = figure(robot_run, -1).axes
    assert axes.get_title() == "robot, t = 2 s"
    last = artists(axes, "segment")[-1].get_data_3d()
    assert np.allclose(np.array(last).T, [robot_run.point("r7")[-1], robot_run.point("r8")[-1]])


def test_a_planar_mechanism_is_drawn_in_its_plane(flat_model):
    """Two dimensions, equal scales, and no arrow for the vector normal to the plane."""
    (axes,) = figure(flat_model).axes
    assert axes.name == "rectilinear"
    assert axes.get_aspect() == 1.0
    assert [list(line.get_xydata()[1]) for line in artists(axes, "segment")] == [[0.3, 0.9], [2.2, 1.3], [2.0, 0.0]]
    assert texts(axes, "vector name") == ["u"]


@pytest.mark.parametrize("place", [(0, 0), (1, 2, 3)])
def test_a_single_point_can_be_drawn(place, tmp_path):
    """No extent, no line, no arrow."""
    m = Model("dot")
    m.point("A", place)
    assert save(figure(m), tmp_path / "dot.png").stat().st_size > 0


def test_a_frame_that_does_not_exist_is_refused(flat_run):
    with pytest.raises(NcgenError, match="^flat: there is no frame 41; give one from 0 to 40$"):
        figure(flat_run, 41)


def test_names_keep_away_from_lines():
    """In a corner between two lines the name goes outside; a second name does not go over the first."""
    places = LabelPlaces(np.eye(2), 0.1)
    corner = np.zeros(2)
    places.avoid(corner, np.array([1.0, 0.0]))
    places.avoid(corner, np.array([0.0, 1.0]))
    first, second = places.next_to(corner), places.next_to(corner)
    assert (first < 0).any() and np.linalg.norm(first) == pytest.approx(0.1)
    assert np.linalg.norm(second - first) > 0.05


# -- time histories ----------------------------------------------------------------------------


def panel(chart, label):
    """The curves of a panel by name."""
    (axes,) = [axes for axes in chart.axes if axes.get_ylabel() == label]
    return {line.get_label(): np.asarray(line.get_ydata()) for line in axes.lines}


def test_the_histories_of_a_run_are_its_angles(robot_run):
    """The six angles in rad, energies in J, the violation on a logarithmic scale, over time in s."""
    chart = plot(robot_run)
    angles = panel(chart, "angle (rad)")
    assert list(angles) == [f"psi{i}" for i in range(1, 7)]
    assert np.array_equal(angles["psi3"], robot_run["psi3"])
    kinetic, potential, total = panel(chart, "energy (J)").values()
    assert np.allclose(kinetic, robot_run.energy()[:, 0])
    assert np.allclose(np.diff(potential), np.diff(robot_run.energy()[:, 1])) and potential.min() == 0
    assert np.allclose(total, total[0])
    assert chart.axes[-1].get_yscale() == "log" and chart.axes[-1].get_xlabel() == "time (s)"


def test_without_angles_the_independent_coordinates_are_shown(flat_model, flat_run):
    """Else the first six."""
    assert list(panel(plot(flat_run), "position (m)")) == ["B.x", "B.y", "C.x", "C.y", "E.x", "E.y"]
    flat_model.independent("C.y")
    try:
        assert list(panel(plot(flat_run), "position (m)")) == ["C.y"]
    finally:
        flat_model.chosen_independent = ()


def test_named_coordinates_have_a_panel_a_unit(robot_run):
    """Angles in rad, points in m, components of unit vectors without a unit."""
    chart = plot(robot_run, ["r8.x", "psi2", "u5.z", "r8.y"])
    assert [axes.get_ylabel() for axes in chart.axes][:3] == ["angle (rad)", "position (m)", "direction (1)"]
    assert list(panel(chart, "position (m)")) == ["r8.x", "r8.y"]
    assert list(panel(plot(robot_run, "psi2"), "angle (rad)")) == ["psi2"]


@pytest.fixture(scope="module")
def screw_run():
    """A nut on a screw, a strut to it, and the length of the strut: every kind of coordinate that there is."""
    m = Model("nut")
    A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (0, 0, 1))
    k = m.vector("k", (0, 0, 1), fixed=True)
    m.extend(m.ground, A, k)
    nut = m.body("nut", [B])
    m.screw(m.ground, nut, A, B, k, 0.1, "s")
    m.length("strut", m.attach_point(m.ground, "F", (1, 0, 0)), B)
    return TurningRun(m, np.linspace(0, 2, 41))


def test_every_kind_of_coordinate_has_a_panel(screw_run):
    """Whatever is a free coordinate of a model can be shown; lengths and slides are in m as angles are in rad."""
    chart = plot(screw_run, screw_run.coordinates)
    shown = [line.get_label() for axes in chart.axes[:-2] for line in axes.lines]
    assert sorted(shown) == sorted(screw_run.coordinates)
    assert list(panel(chart, "length (m)")) == ["s.slide", "strut"]


def test_lengths_are_shown_like_angles(screw_run):
    """Where the caller names nothing, what is measured between elements is shown."""
    chart = plot(screw_run)
    assert [axes.get_ylabel() for axes in chart.axes[:-2]] == ["angle (rad)", "length (m)"]
    assert list(panel(plot(screw_run, "strut"), "length (m)")) == ["strut"]


def test_an_unknown_coordinate_is_refused(flat_run):
    with pytest.raises(NcgenError, match="^names: the mechanism has no free coordinate A.x; it has B.x, B.y"):
        plot(flat_run, ["B.x", "A.x"])


@pytest.mark.filterwarnings("error")
def test_a_run_without_any_violation_can_be_plotted(flat_model, tmp_path):
    """Zeros have no logarithm, and need none."""
    run = TurningRun(flat_model, [0.0, 1.0, 2.0])
    run.violation = lambda: np.zeros(3)
    assert save(plot(run, "B.x"), tmp_path / "still.png").exists()


# -- files -------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".png", ".SVG"])
def test_the_same_figure_gives_the_same_bytes(suffix, robot_model, flat_run, tmp_path):
    """Made twice; in space, in the plane, and as time histories; and saved twice."""

    def saved(*charts):
        return {save(chart, tmp_path / f"{i}{suffix}").read_bytes() for i, chart in enumerate(charts)}

    assert len(saved(figure(robot_model), figure(robot_model))) == 1
    assert len(saved(flat := figure(flat_run, 3), flat, figure(flat_run, 3))) == 1
    assert len(saved(plot(flat_run, "B.x"), plot(flat_run, "B.x"))) == 1


def test_files_tell_neither_day_nor_version(flat_model, tmp_path):
    """So that they can be compared and committed."""
    assert b"Software" not in save(figure(flat_model), tmp_path / "flat.png").read_bytes()
    assert not any(word in save(figure(flat_model), tmp_path / "flat.svg").read_text() for word in ("dc:date", "Matplotlib v"))


@pytest.mark.parametrize("name", ["robot.gif", "robot"])
def test_other_kinds_of_files_are_refused(name, robot_model, tmp_path):
    with pytest.raises(NcgenError, match=rf"{name}: a figure is saved as .png or .svg; choose a name that ends so$"):
        save(figure(robot_model), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_drawing_touches_no_global_state():
    """pyplot, with its windows and its list of figures, is never imported."""
    sources = [path.read_text(encoding="utf-8") for path in Path(view.__file__).parent.glob("*.py")]
    assert len(sources) > 4
    assert not any("pyplot" in line for source in sources for line in source.splitlines() if "import" in line)


def test_kernels_are_no_picture(flat_model):

    with pytest.raises(NcgenError, match="given; a picture shows a model, or a trajectory that ncgen.simulate makes"):
        figure(ncgen.compile(flat_model, "numpy"))
