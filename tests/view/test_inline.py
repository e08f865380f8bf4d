"""What shows itself in a notebook: figures, moving pages and bars; and that everything has a short name."""

from __future__ import annotations

import sys
from html import unescape
from io import BytesIO
from types import SimpleNamespace

import matplotlib.image
import numpy as np
import pytest

import ncgen
from ncgen.emit.sources import Sources
from ncgen.errors import ModelError
from ncgen.report import bar
from ncgen.solver.derivatives.sensitivity import Gradient, Sensitivities
from ncgen.solver.linear.linearise import Linearisation
from ncgen.solver.motions.batch import BatchAccelerations, BatchTrajectory
from ncgen.solver.motions.simulation_states import SimulationState, SimulationStates
from ncgen.solver.positions.partition import Partition, Partitions
from ncgen.solver.trajectories.monitor import Health
from ncgen.studies.definition import Study
from ncgen.studies.indices import Indices
from ncgen.studies.variants import Part


@pytest.fixture(scope="module")
def run():
    kernels = ncgen.compile(ncgen.load("fourbar"), "numpy")
    return ncgen.simulate(kernels, 0.05, zd0={"psi": 12.0}, points=6)


def test_a_figure_shows_itself_and_is_saved(run, tmp_path):
    """As a picture for fine screens, half as large again as it is shown; it stays a matplotlib figure."""
    chart = run.plot()
    data, told = chart._repr_png_()
    height, width, _ = matplotlib.image.imread(BytesIO(data)).shape
    assert told == {"width": 576} and width == 864 and height > width / 2 and len(data) < 150_000
    assert chart._repr_html_() is None and len(chart.axes) == 3
    assert run.plot(tmp_path / "a.png") == tmp_path / "a.png" and (tmp_path / "a.png").exists()


def test_a_page_shows_itself_and_is_saved(run, tmp_path):
    """In a frame that holds the very page that is written, whatever stands in it, and that runs its own scripts only."""
    page = run.animate()
    frame = page._repr_html_()
    assert frame.startswith("<iframe ") and 'sandbox="allow-scripts"' in frame and frame.count("<") == 2
    assert unescape(frame.partition('srcdoc="')[2].partition('"')[0]) == page.text
    assert page.save(tmp_path / "a.html").read_bytes() == run.animate(tmp_path / "b.html").read_bytes() == page.text.encode()
    assert len(repr(page)) < 80


# -- bars ----------------------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def notebook(monkeypatch):
    """A notebook that keeps what it was shown: all pictures of a bar, one after the other."""
    shown: list[str] = []

    def display(data, raw, display_id):
        assert raw and display_id
        shown.append(data["text/html"])
        return SimpleNamespace(update=lambda data, raw: shown.append(data["text/html"]))

    fake = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=object()), display=SimpleNamespace(display=display))
    monkeypatch.setitem(sys.modules, "IPython", fake)
    monkeypatch.setitem(sys.modules, "IPython.display", fake.display)
    monkeypatch.setattr(bar, "REFRESH_SECONDS", 0.0)
    return shown


def test_a_bar_in_a_notebook(notebook):
    with bar.progress("a <b>", 4.0) as advance:
        advance(1.0)
        advance(4.0)
    assert ["value=" in html for html in notebook] == [False, True, True, False]
    assert 'value="1" max="4"' in notebook[1] and "a &lt;b&gt;" in notebook[1] and notebook[-1] == ""


def test_a_bar_goes_where_the_work_fails(notebook):
    with pytest.raises(ZeroDivisionError), bar.timed("work", 10) as advance:
        advance(5, 10, 90.0)
        raise ZeroDivisionError
    assert 'value="5" max="10"' in notebook[1] and "1 min 30 s left" in notebook[1] and notebook[-1] == ""


@pytest.mark.filterwarnings("ignore:no C compiler")
@pytest.mark.parametrize("progress", [True, False, None])
def test_bars_of_runs(run, notebook, monkeypatch, progress):
    """True is a bar at every door, from the run's own start on; False and None are none."""
    monkeypatch.setattr("ncgen.toolchain.compilers.find_compilers", lambda: iter(()))  # nothing is to be waited for
    ncgen.simulate(run.kernels, 0.02, points=3, t0=5.0, progress=progress, engine="python", integrator="rk4", max_step=0.01)
    assert ("simulating fourbar" in "".join(notebook)) is (progress is True)
    assert all('max="0.02"' in html and 'value="0.0' in html for html in notebook[1:-1])
    notebook.clear()
    ncgen.study(run.model, {"start(rate(psi))": [1.0, 2.0]}, keep="steps", duration=0.01, progress=progress)
    assert ("fourbar: 2 variants" in "".join(notebook)) is (progress is True)


def test_no_bar_where_nobody_watches(run, capsys):
    ncgen.simulate(run.kernels, 0.02, points=3, progress=True)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("progress", ["yes", 1, 0.5])
def test_what_can_be_told_nothing(run, progress):
    for door in (
        lambda: ncgen.simulate(run.kernels, 0.02, progress=progress),
        lambda: ncgen.study(run.model, {"start(rate(psi))": [1.0]}, keep="steps", progress=progress),
    ):
        with pytest.raises(ModelError, match="it must be a function of the time reached, or True for a bar"):
            door()


# -- short names ---------------------------------------------------------------------------------------------------------------------------


def test_everything_has_a_short_name(robot_numpy, robot_model, run):
    """One line that says what it is, for all that a user gets hold of; arrays and programs are not in it."""
    many = np.zeros((40, 36))
    programs, instants, names = robot_numpy.programs, np.linspace(0, 1, 40), robot_numpy.coordinates
    partition = Partition(np.arange(30), np.arange(30), np.arange(30, 36))
    things = [
        robot_model,
        robot_numpy,
        run,
        run.animate(),
        programs,
        programs.programs["phi"],
        programs.phi_q,
        programs.equations,
        programs.equations.rows[0].template.key,
        robot_numpy.batch,
        run.kernels.tangents,
        Sources(programs),
        robot_numpy.rows[0],
        ncgen.freedom(robot_numpy),
        Partitions(partition, partition),
        Linearisation(matrix=np.zeros((12, 12)), positions=names[:6], velocities=names[:6], coordinates=names, shapes=np.zeros((36, 12))),
        Sensitivities(t=instants, q=many, qd=many, q_by=many[..., None], qd_by=many[..., None], names=names),
        Gradient(1.0, dict.fromkeys(names, 0.5)),
        Health(independent=names, **dict.fromkeys(("t", "sigma", "quality", "best", "energy", "drift", "violation"), instants)),
        SimulationState(t=0.0, q=many[0], qd=many[0], work=0.0, p=many[0], next_step=0.1, mechanism=""),
        SimulationStates(t=instants, q=many, qd=many, work=instants, p=many, next_step=instants, mechanism=""),
        BatchTrajectory(
            kernels=robot_numpy,
            t=instants,
            q=many,
            qd=many,
            work=many,
            independent=names,
            status=("ok",) * 40,
            steps=instants,
            alone=instants > 2,
        ),
        BatchAccelerations(q=many, qd=many, zdd=many, codes=np.zeros(40), choice=SimpleNamespace(names=names[:6])),
        Indices(names=names, first=many[0], total=many[0], points=8, of=8),
        Part(0, {"ok": instants > 0, "steps": instants}),
        Study.of(run.model, {"start(rate(psi))": [1.0, 2.0]}, keep="steps"),
    ]
    found = [repr(thing) for thing in things]
    assert [name for name in found if len(name) > 150 or "\n" in name or " object at 0x" in name] == []
