"""Public functions take the same two groups of arguments, a start and a method, and refuse wrong names in one sentence."""

from __future__ import annotations

import inspect
import pydoc
import re

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.solver.groups import DEFAULTS, MethodArguments, MotionArguments, StartArguments
from ncgen.solver.runs.run import Initial, Run

OF_GROUPS = {
    "simulate": (1.0,),
    "start": (),
    "sensitivities": (1.0, 5),
    "gradient": (1.0, 5, lambda q, qd: (0.0, None, None)),
    "hessian": (1.0, 5, lambda q, qd: (0.0, None, None, None)),
    "linearise": (),
    "driven_positions": ([0.0],),
    "accelerations": ([0.0], [0.0]),
}
"""{function that takes a group: arguments without which it cannot be called}"""

FUNCTIONS = [name for name in ncgen.__all__ if inspect.isfunction(getattr(ncgen, name))]

MOST_PARAMETERS = 7
"""Parameters of a public function besides the groups."""


@pytest.fixture(scope="module")
def kernels():
    """A mass on a spring that a parameter describes."""
    m = ncgen.Model("block")
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (1, 0), fixed="y")
    m.body("block", [A], mass=1.0, inertia="point")
    m.spring(O, A, stiffness=m.parameter("k", 10.0), free_length=0.5)
    m.force(A, (m.input("push"), 0))
    return ncgen.compile(m, "numpy")


def own(function):
    """Parameters of a function as it is written."""
    return inspect.signature(inspect.unwrap(function)).parameters.values()


def test_no_function_is_forgotten():
    """Whoever has a ** takes a group by it; those of `study` and `load` have words of their own besides."""
    stars = {name for name in FUNCTIONS if any(p.kind is p.VAR_KEYWORD for p in own(getattr(ncgen, name)))}
    assert stars - {"study", "load"} == set(OF_GROUPS)


def test_a_group_has_a_default_for_every_word():
    assert list(MotionArguments.__annotations__) == [*StartArguments.__annotations__, *MethodArguments.__annotations__]
    assert set(DEFAULTS) == set(MotionArguments.__annotations__)


@pytest.mark.parametrize("name", OF_GROUPS)
def test_an_unknown_word_is_refused_with_the_nearest(name, kernels):
    for wrong, near in (("zdo", "zd0|zd|z"), ("qq0", "q0|q")):
        with pytest.raises(ModelError) as refused:
            getattr(ncgen, name)(kernels, *OF_GROUPS[name], **{wrong: 1.0})
        advice = rf"(did you mean ({near})\?|it has \w+(, \w+)*)"
        assert re.fullmatch(f"{name}: there is no argument '{wrong}'; {advice}", str(refused.value))


@pytest.mark.parametrize("name", OF_GROUPS)
def test_a_word_that_has_no_effect_is_refused(name, kernels):
    """The other words of both groups work, or are refused; none is ignored."""
    shown = inspect.signature(getattr(ncgen, name)).parameters
    for word in {*DEFAULTS} - {*shown} - {"q0", "zd0"}:
        with pytest.raises(ModelError) as refused:
            getattr(ncgen, name)(kernels, *OF_GROUPS[name], **{word: "anything"})
        known = f"{name}: {word} is given, and it has no effect here; leave it out"
        assert str(refused.value) == known or str(refused.value).startswith(f"{name}: there is no argument '{word}'; ")


def test_words_of_studies_and_robots_are_refused_alike():
    with pytest.raises(ModelError, match="^study: there is no argument 'outptu'; did you mean output\\?$"):
        ncgen.study(ncgen.load("pendulum"), {}, keep="psi", outptu="x")
    with pytest.raises(ModelError, match="^load: there is no argument 'limit'; did you mean limits\\?$"):
        ncgen.load("pendulum", limit=True)


@pytest.mark.parametrize("name", [*OF_GROUPS, "study", "load"])
def test_help_shows_every_argument_and_its_meaning(name):
    function = getattr(ncgen, name)
    text, words = pydoc.render_doc(function, renderer=pydoc.plaintext), list(inspect.signature(function).parameters)
    assert not {"arguments", "robot"} & set(words)
    for word in words:
        assert re.search(rf"^    {word} : .+\n        \S", text, re.MULTILINE), word
    assert text.count("\n    Parameters\n") == 1 and "\n    Notes\n" in text


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_have_few_parameters_of_their_own(name):
    assert len([p for p in own(getattr(ncgen, name)) if p.kind is not p.VAR_KEYWORD]) <= MOST_PARAMETERS


def test_defaults_are_those_of_a_run(kernels):
    """The list of defaults is what a run has where nothing is given."""
    run, start = Run.from_arguments(kernels, 1.0), Initial.from_arguments(kernels)
    words = "rtol", "atol", "max_step", "engine", "number"
    assert [getattr(run.settings, word) for word in words] == [DEFAULTS[word] for word in words]
    assert (start.t, start.closing) == (DEFAULTS["t0"], DEFAULTS["closing"])


def test_former_names_are_accepted(kernels):
    now, before = ncgen.linearise(kernels, q0=[0.7], qd0=[0.0]), ncgen.linearise(kernels, q=[0.7], qd=[0.0], t=0.0)
    np.testing.assert_array_equal(now.A, before.A)
    with pytest.raises(ModelError, match="linearise: q is the former name of q0, and both are given; give q0"):
        ncgen.linearise(kernels, q=[0.7], q0=[0.7])


def test_a_linearisation_takes_velocities_and_inputs_of_a_start(kernels):
    """x'' = 10 (0.5 − x) + push: the push moves the equilibrium and not the matrix."""
    at = ncgen.linearise(kernels, q0=[0.7], inputs={"push": 2.0})
    np.testing.assert_allclose(at.A, [[0.0, 1.0], [-10.0, 0.0]], atol=1e-12)
    assert at.steady
    with pytest.warns(UserWarning, match="neither rest in equilibrium nor steady") as warned:
        assert not ncgen.linearise(kernels, q0=[0.7], zd0=[1.0], z="A.x", inputs={"push": 2.0}).steady
    assert warned[0].filename == __file__
    with pytest.raises(ModelError, match="inputs: linearise needs numbers"):
        ncgen.linearise(kernels, inputs={"push": lambda t: t})


def test_a_warning_points_at_the_call(kernels):
    with pytest.warns(UserWarning) as warned:
        ncgen.simulate(kernels, 0.1, points=2, q0=[-0.5], qd0=[1.0], engine="python", formalism="lagrange", integrator="rk4", max_step=0.1)
        ncgen.linearise(kernels, q0=[0.9])
    assert {w.filename for w in warned} == {__file__}


def test_where_something_is_written_is_called_output(tmp_path):
    """By the former names, `path` and `folder`, as well."""
    model = ncgen.load("pendulum")
    kernels = ncgen.compile(model, "numpy")
    run, near = ncgen.simulate(kernels, 0.1, points=2, engine="python"), ncgen.linearise(kernels)
    for former, write in (("path", run.to_csv), ("path", run.to_npz), ("path", near.to_c), ("folder", ncgen.generate(model).write)):
        now, before = tmp_path / "now.csv", tmp_path / "before.csv"
        assert write(output=now) and write(**{former: before}) and now.exists() and before.exists()
        with pytest.raises(ModelError, match=f"{former} is the former name of output, and both are given"):
            write(output=now, **{former: before})
        now, before = (each.rename(tmp_path / f"{write.__name__}-{each.name}") for each in (now, before))
    for writer in (ncgen.export, run.plot, run.animate, run.to_parquet, ncgen.study):
        assert "output" in inspect.signature(writer).parameters and not {"path", "folder"} & set(inspect.signature(writer).parameters)
