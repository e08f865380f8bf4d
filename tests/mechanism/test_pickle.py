"""Models, kernels and results travel between processes, and are on the other side what they were here."""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.emit.sources import Sources
from ncgen.errors import ModelError
from ncgen.exchange.examples import example_names, load
from ncgen.model.digest import digest

GENERATED = Path(__file__).resolve().parents[2] / "generated"


def travelled(thing):
    return pickle.loads(pickle.dumps(thing))


def slope(t, q, qd, kernels):
    """A force that pickle finds by its name."""
    return np.full(kernels.n, 0.25)


@pytest.mark.parametrize("name", example_names())
def test_models(name):
    """The C of a model that has travelled is the C that is kept for the example, byte by byte."""
    model = load(name)
    twin = travelled(model)
    text = ncgen.generate(twin).c[f"{name}.c"]
    assert text == (GENERATED / name / f"{name}.c").read_text(encoding="utf-8")
    assert digest(travelled(twin)) == digest(twin) == digest(model) == digest(copy.deepcopy(model))


def test_what_belongs_together_stays_together():
    """Rows, bodies, angles and facts of a model that has travelled speak of its own points, each of which is there once."""
    model = travelled(load("robot"))
    own = {id(element) for element in model.elements.values()}
    used = [e for row in model.rows for a in row.arguments.values() for e in getattr(a, "elements", ())]
    used += [element for body in model.bodies.values() for element in body.elements]
    used += [value for fact in model.facts for value in fact.arguments.values() if isinstance(value, ncgen.model.elements.Element)]
    assert len(used) > 100 and {id(e) for e in used} <= own


def test_a_model_can_be_gone_on_with():
    """It takes a further fact as the model that stayed does."""
    models = [load("pendulum"), travelled(load("pendulum"))]
    for model in models:
        model.body("more", points=[next(iter(model.elements.values()))], mass=2.0)
    assert digest(models[0]) == digest(models[1]) != digest(load("pendulum"))


SEEDED = "import ncgen; from ncgen.model.digest import digest; print(*(digest(ncgen.load(name)) for name in ('robot', 'disc', 'delta')))"


def test_the_digest_is_the_same_in_every_process():
    said = set()
    for seed in ("0", "77"):
        environment = os.environ | {"PYTHONHASHSEED": seed}
        said.add(subprocess.run([sys.executable, "-c", SEEDED], env=environment, capture_output=True, text=True, check=True).stdout)
    assert said == {" ".join(digest(load(name)) for name in ("robot", "disc", "delta")) + "\n"}


@pytest.mark.parametrize("change", ["mass", "place", "name", "order", "force", "scale", "default"])
def test_whatever_matters_is_in_the_digest(change):
    def build(changed=None):
        model = ncgen.Model("other" if changed == "name" else "digested", scale=changed != "scale")
        m = model.parameter("m", 3.0 if changed == "default" else 2.0)
        A, B = model.point("A", (0, 0), fixed=True), model.point("B", (1.0 if changed != "place" else np.nextafter(1.0, 2.0), 0))
        model.body("rod", points=[B, A] if changed == "order" else [A, B], mass=m if changed != "mass" else 2.0, inertia=0.1)
        model.force(B, (0, B.x * (2 if changed == "force" else 1), 0))
        return model

    assert digest(build()) == digest(build()) != digest(build(change))


@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_kernels(backend):
    """Every kernel gives the same bits, and so does everything that is derived from it; the library is the one in the cache."""
    kernels = ncgen.compile(load("fourbar"), backend)
    rng = np.random.default_rng(2)
    q, qd, qdd, lam = (rng.uniform(-1, 1, size) for size in (kernels.n, kernels.n, kernels.n, kernels.m))
    for twin in (travelled(kernels), copy.deepcopy(kernels), copy.copy(kernels)):
        assert type(twin) is type(kernels) and twin is not kernels and np.array_equal(twin.p0, kernels.p0)
        for name in kernels.programs.programs:
            assert np.array_equal(twin.values(name, 0.5, q, qd, None), kernels.values(name, 0.5, q, qd, None)), name
        assert np.array_equal(twin.stiffness(q, qd, qdd, lam).data, kernels.stiffness(q, qd, qdd, lam).data)
        assert np.array_equal(twin.batch.gamma([q], [qd]), kernels.batch.gamma([q], [qd]))
        assert twin.rows[0].label == kernels.rows[0].label and twin.coordinates == kernels.coordinates
        if backend == "c":
            assert twin.library == kernels.library
    batch, tangents = travelled((kernels.batch, kernels.tangents))
    assert np.array_equal(batch.gamma([q], [qd]), kernels.batch.gamma([q], [qd]))
    given = {"t": 0.0, "q": q, "qd": qd, "qdd": qdd, "lam": lam, "p": kernels.p0}
    assert np.array_equal(tangents.values("stiffness", given), kernels.tangents.values("stiffness", given))


def test_kernels_of_one_model_share_it():
    """What was one model here is one there."""
    model = load("pendulum")
    twin, c, numpy = travelled((model, ncgen.compile(model, "c"), ncgen.compile(model, "numpy")))
    assert c.model is twin and numpy.model is twin


def test_kernels_are_what_was_compiled():
    """A model that was told more since then does not change kernels on their way."""
    model = load("pendulum")
    kernels = ncgen.compile(model, "c")
    model.gravity((0, 0, 0))
    q, qd = kernels.q0, 0 * kernels.q0
    assert np.array_equal(travelled(kernels).force(q, qd), kernels.force(q, qd)) and kernels.force(q, qd).any()


def test_sources():
    sources = ncgen.generate(load("slidercrank"))
    assert travelled(Sources(sources.programs)).files == sources.files


@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_trajectories(backend):
    """Arrays come with the run; accelerations, loads and energies are computed there as they are here."""
    run = ncgen.simulate(ncgen.compile(load("fourbar"), backend), 0.05, points=5)
    twin = travelled(run)
    for name in ("t", "q", "qd", "work", "qdd", "lam"):
        assert np.array_equal(getattr(twin, name), getattr(run, name)), name
    assert np.array_equal(twin.energy(), run.energy()) and twin.statistics == run.statistics and twin.independent == run.independent
    loads, expected = twin.reactions().loads, run.reactions().loads
    assert all(np.array_equal(loads[b][c], expected[b][c]) for b in expected for c in expected[b])
    assert np.array_equal(travelled(twin).qdd, run.qdd)  # with what it has computed since


def test_results():
    """Everything that is made of kernels and handed to the user."""
    kernels = ncgen.compile(load("fourbar"), "c")
    q = ncgen.assemble(kernels, kernels.q0)
    states = np.tile(q, (4, 1))
    dof = ncgen.freedom(kernels, q).dof
    several = ncgen.simulate(kernels, 0.05, q0=states, zd0=np.linspace(0, 1, 4)[:, None] * np.ones(dof), points=3)
    twin = travelled(several)
    assert np.array_equal(twin.q, several.q) and twin.status == several.status and twin.kernels.name == "fourbar"
    found = ncgen.accelerations(kernels, states, np.ones((4, dof)))
    there, same = travelled((kernels, found))
    again = ncgen.accelerations(there, states, np.ones((4, dof)), out=same)
    assert np.array_equal(again.zdd, found.zdd) and again.independent == found.independent
    linear = ncgen.linearise(kernels, q0=q)
    assert np.array_equal(travelled(linear).eigenvalues, linear.eigenvalues)
    assert travelled(ncgen.freedom(kernels, q)).dof == dof
    run = ncgen.simulate(kernels, 0.05, points=3)
    assert travelled(run.reactions()).loads.keys() == run.reactions().loads.keys()
    assert np.array_equal(travelled(ncgen.inverse_dynamics(run)).forces, ncgen.inverse_dynamics(run).forces)


def _elsewhere(model, c, numpy, run):
    """What another process makes of them."""
    q, qd = run.q[-1], run.qd[-1]
    made = ncgen.generate(model).c["fourbar.c"]
    return os.getpid(), made, [k.gamma(q, qd) for k in (c, numpy)], ncgen.simulate(c, 0.05, points=4), run.qdd


def test_a_spawned_process():
    """Arguments and results of a process that has inherited nothing."""
    model = load("fourbar")
    kernels = [ncgen.compile(model, backend) for backend in ("c", "numpy")]
    run = ncgen.simulate(kernels[0], 0.05, points=4)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        process, made, gammas, other, qdd = pool.apply(_elsewhere, (model, *kernels, run))
    assert process != os.getpid() and made == ncgen.generate(model).c["fourbar.c"]
    for k, gamma in zip(kernels, gammas, strict=True):
        assert np.array_equal(gamma, k.gamma(run.q[-1], run.qd[-1]))
    assert np.array_equal(other.q, run.q) and np.array_equal(other.qdd, run.qdd) and np.array_equal(qdd, run.qdd)


def called(function):
    model = load("pendulum")
    model.callback(function)
    return model


def test_a_callback_with_a_name_travels():
    model = called(slope)
    twin = travelled(ncgen.compile(model, "numpy"))
    assert twin.model.callbacks == [slope]
    plain = ncgen.compile(load("pendulum"), "numpy")
    assert np.allclose(twin.force(plain.q0, plain.q0), plain.force(plain.q0, plain.q0) + 0.25)


def test_a_callback_without_a_name_is_named(monkeypatch):
    """In one line that says which and what to do; a copy in the same process needs no name."""

    def magnet(t, q, qd, kernels):
        return 0.0 * q

    for by_value in [m for m in sys.modules if m.rpartition(".")[2] in ("cloudpickle", "dill")]:
        monkeypatch.delitem(sys.modules, by_value)
    model = called(magnet)
    for thing in (model, ncgen.compile(model, "numpy"), ncgen.simulate(ncgen.compile(model, "c"), 0.01)):
        with pytest.raises(ModelError, match=r"pendulum: callback .*magnet cannot go to another process: define it") as caught:
            pickle.dumps(thing)
        assert "\n" not in str(caught.value) and len(str(caught.value)) < 300
    assert copy.deepcopy(model).callbacks == [magnet]


def test_packages_that_pickle_functions_are_not_stopped(monkeypatch):
    """Where one of them is loaded its own pickler decides: here one that writes the function as its name in this test."""
    monkeypatch.setitem(sys.modules, "cloudpickle", sys)
    with pytest.raises((AttributeError, pickle.PicklingError)):
        pickle.dumps(called(lambda t, q, qd, kernels: q))  # pickle's own words


def test_laws_travel_as_expressions():
    """A law given as a function has been read when the spring was made, so it needs no name."""
    model = load("pendulum")
    A, B = list(model.elements.values())[:2]
    model.spring(A, B, law=lambda x, v: 3 * x**2 + v)
    twin = travelled(model)
    assert str(twin.springs[-1].law) == str(model.springs[-1].law) and ncgen.generate(twin).c == ncgen.generate(model).c
    assert digest(twin) == digest(model)
