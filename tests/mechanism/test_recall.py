"""What was generated once is not generated again, and never mistaken for something else."""

import hashlib
import importlib.metadata
import os
import pickle
import shutil
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import ncgen
from ncgen import compiler
from ncgen.mechanism import generator_identity, recall
from ncgen.mechanism.runtime_library import prepare
from ncgen.toolchain.cache import clear


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """An empty cache of the test's own."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(folder))
    return folder


@pytest.fixture
def runtime(own_cache, cache):
    """The runtime in the test's own cache, from that of all tests: it belongs to no mechanism, and takes long to compile."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NCGEN_CACHE_DIR", str(own_cache))
        prepare(ncgen.compile(pendulum(), "c"))
    for record in own_cache.glob("*/build.json"):
        if (record.parent / "ncgen_run.c").exists():
            shutil.copytree(record.parent, cache / record.parent.name)


def pendulum(mass=1.0):
    model = ncgen.Model("pendulum")
    origin, end = model.point("O", (0, 0), fixed=True), model.point("A", (1, 0))
    model.body("rod", points=[origin, end], mass=mass, inertia=0.1)
    model.gravity((0, -9.81, 0))
    return model


@pytest.fixture
def generations(monkeypatch):
    """Names of the models that were generated."""
    seen = []
    programs = compiler._programs
    monkeypatch.setattr(compiler, "_programs", lambda model, *rest: (seen.append(model.name), programs(model, *rest))[1])
    return seen


def test_the_second_time_nothing_is_generated(generations):
    first, model = ncgen.compile(pendulum(), "c"), pendulum()
    again = ncgen.compile(model, "c")
    assert generations == ["pendulum"]
    assert again.model is model and again.coordinates == first.coordinates
    q, qd = np.array([0.6, -0.8]), np.array([1.6, 1.2])
    for name in ("phi", "phi_q", "gamma", "mass", "force", "energy"):
        assert np.array_equal(again.values(name, 0.0, q, qd, None), first.values(name, 0.0, q, qd, None))
    assert again.programs.omitted == first.programs.omitted


def test_what_was_kept_can_be_gone_on_with(generations):
    """Tangents, emitted runs and reactions derive what they need from the model itself."""
    ncgen.compile(pendulum(), "c")
    kernels = ncgen.compile(pendulum(), "c")
    assert generations == ["pendulum"]
    run = ncgen.simulate(kernels, 0.1, engine="emitted")
    assert run.engine.startswith("emitted") and run.reactions().loads
    assert kernels.stiffness(run.q[-1], run.qd[-1], run.qdd[-1], run.lam[-1]).shape == (2, 2)


def test_another_model_or_emission_is_another(generations):
    ncgen.compile(pendulum(), "c")
    assert ncgen.compile(pendulum(2.0), "c").mass_matrix([1.0, 0.0])[0, 0] != ncgen.compile(pendulum(), "c").mass_matrix([1.0, 0.0])[0, 0]
    ncgen.compile(pendulum(), "c", "tabled")
    assert generations == ["pendulum"] * 3


@pytest.mark.parametrize("package", [*generator_identity.PACKAGES, "python"])
def test_another_generator_is_another(generations, monkeypatch, tmp_path, package):
    """Another version of anything that makes code of a model may make other code. It comes with another file to begin with."""
    known, found, entry = importlib.metadata.version, generator_identity.find_spec, tmp_path / "package" / "__init__.py"
    entry.parent.mkdir()
    entry.write_text("")
    ncgen.compile(pendulum(), "c")
    generator_identity.generator_identity.cache_clear()
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "0" if name == package else known(name))
    monkeypatch.setattr(
        generator_identity, "find_spec", lambda name: SimpleNamespace(origin=str(entry)) if name == package else found(name)
    )
    if package == "python":
        monkeypatch.setattr(generator_identity.platform, "python_version", lambda: "0")
    ncgen.compile(pendulum(), "c")
    generator_identity.generator_identity.cache_clear()
    assert generations == ["pendulum"] * 2


def test_files_are_read_again_where_they_changed(monkeypatch, tmp_path):
    """A digest of the same bytes is the same whenever they were written; it is not computed while no file has changed."""
    path = tmp_path / "model.py"
    monkeypatch.setattr(generator_identity, "package_files", lambda *_: [str(path)])
    computed = []
    content = generator_identity._content
    monkeypatch.setattr(generator_identity, "_content", lambda files: computed.append(content(files)) or computed[-1])

    def identity(text, later):
        if text is not None:
            path.write_text(text)
            os.utime(path, ns=(later, later))
        generator_identity.generator_identity.cache_clear()
        return generator_identity.generator_identity()

    try:
        identities = [identity("a", 1), identity(None, 0), identity("b", 2), identity("a", 3)]
    finally:
        generator_identity.generator_identity.cache_clear()
    assert identities[0] == identities[1] == identities[3] != identities[2]
    assert len(computed) == 3


def test_a_model_that_has_grown_is_another(generations):
    """What is derived of kernels later is kept for the model as it is then."""
    model = pendulum()
    kernels = ncgen.compile(model, "c")
    before = recall.key_of(kernels.programs)
    assert before == recall.key(model, "auto") == recall.key_of(ncgen.compile(pendulum(), "c").programs)
    model.point("B", (2, 0))
    assert recall.key_of(kernels.programs) == recall.key(model, "auto") != before


def test_damaged_files_are_written_again(generations, cache):
    """Cut, replaced, or another operation, which would give another weight."""
    right = ncgen.compile(pendulum(), "c").force([1.0, 0.0], [0.0, 0.0])
    path = max((cache / "programs").iterdir(), key=lambda file: file.stat().st_size)  # the other one has its structure and numbers
    whole = path.read_bytes()
    damages = b"", whole[:100], b"nonsense", whole.replace(b'["mul",', b'["add",')
    assert damages[-1] != whole
    for damage in damages:
        path.write_bytes(damage)
        assert np.array_equal(ncgen.compile(pendulum(), "c").force([1.0, 0.0], [0.0, 0.0]), right)
        assert path.read_bytes() == whole
    assert generations == ["pendulum"] * (1 + len(damages))


class Planted:
    """Touches a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


@pytest.mark.parametrize("suffix", [".pickle", ".json"])
def test_nothing_that_is_kept_can_run(generations, cache, tmp_path, suffix):
    """A pickle in the place of kept programs, with a digest or without, is not loaded."""
    ncgen.compile(pendulum(), "c")
    paths = list((cache / "programs").iterdir())
    data = pickle.dumps(Planted(tmp_path / "touched"))
    for planted in (data, hashlib.sha256(data).hexdigest().encode() + b"\n" + data):
        for path in paths:
            path.with_suffix(suffix).write_bytes(planted)
        ncgen.compile(pendulum(), "c")
    assert not (tmp_path / "touched").exists()


def test_python_functions_are_called_and_not_kept(generations):
    """Programs do not depend on them, so those of another function serve; each model calls its own."""
    for push in (1.0, 2.0):
        model = pendulum()
        model.callback(lambda t, q, qd, kernels, push=push: np.full(2, push))
        kernels = ncgen.compile(model, "c")
        assert kernels.force(kernels.q0, 0 * kernels.q0)[0] == push
    assert generations == ["pendulum"]


def test_clearing_the_cache_clears_these_too(cache):
    ncgen.compile(pendulum(), "c")
    assert clear() == 1 and not (cache / "programs").exists()


def test_what_starts_slowly_stays_away(runtime):
    """From the cache to the end of a simulation, in a process of its own: half of what it would take to start is theirs."""
    text = "import sys, ncgen; k = ncgen.compile(ncgen.load('robot'), 'c'); ncgen.simulate(k, 0.01)\n"
    text += "print(*({'jinja2', 'scipy.integrate', 'scipy.linalg', 'scipy.sparse', 'sympy'} & {*sys.modules}))"
    said = [subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True).stdout.split() for _ in range(2)]
    assert "jinja2" in said[0] and "sympy" not in said[0] and not said[1]


def test_a_run_at_the_shell_needs_no_sympy(runtime, tmp_path):
    """Sources, figures and all: what was generated once is kept for the command line, too."""
    text = f"import sys\nfrom ncgen.cli import main\nsys.argv = ['ncgen', 'run', 'pendulum', '--output', {str(tmp_path / 'out')!r}]\n"
    text += "try:\n    main()\nexcept SystemExit:\n    pass\nprint('sympy' in sys.modules, file=sys.stderr)"
    said = [subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True).stderr.split()[-1] for _ in range(2)]
    assert said == ["False", "False"]


def test_tangents_are_derived_once(monkeypatch):
    """A second start derives no tangents, and they give the same numbers."""
    from ncgen.program.differentiation import tangent_programs as derivation

    q, qd, qdd, lam = np.array([0.6, -0.8]), np.array([1.6, 1.2]), np.array([0.3, -0.5]), np.array([2.0])
    given = {"t": 0.0, "q": q, "qd": qd, "qdd": qdd, "lam": lam, "p": None}
    first = ncgen.compile(pendulum(), "c")
    wanted = first.dense_tangent("stiffness", **given)
    assert np.any(wanted)
    for name in ("assemble_tangents", "assemble_parameter_tangents"):
        monkeypatch.setattr(derivation, name, lambda *_: pytest.fail("it was derived again"))
    again = ncgen.compile(pendulum(), "c")
    assert np.array_equal(again.dense_tangent("stiffness", **given), wanted)
    assert again.tangents.programs == first.tangents.programs
