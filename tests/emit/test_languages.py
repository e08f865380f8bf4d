"""A language is a folder: whatever lies in ncgen.emit provides what is asked for, and what is put there is found."""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from oracles.rows_mp import RowsOracle

import ncgen
import ncgen.emit
from ncgen.emit.environment import environment
from ncgen.emit.language import Language, language, languages
from ncgen.errors import ModelError

PAGE = (Path(__file__).resolve().parents[2] / "docs/contributing.md").read_text(encoding="utf-8").split("## A language")[1]


@pytest.mark.parametrize("name", languages())
def test_every_language_provides_what_is_asked_for(name, robot_sources):
    """The members of `Language` with its arguments; files with contents of the kind it says, the same whenever they are made."""
    provided, asked = language(name), inspect.signature(Language.model_files)
    assert provided.IS_READ in (True, False)
    given = inspect.signature(provided.model_files).parameters.values()
    needed = [parameter.name for parameter in given if parameter.default is parameter.empty]
    assert ["self", *needed] == list(asked.parameters)
    programs = robot_sources("auto").programs
    files = provided.model_files(programs)
    assert files and provided.model_files(programs) == files
    assert all(isinstance(contents, str if provided.IS_READ else bytes) and contents for contents in files.values())


def test_no_two_languages_write_the_same_file(robot_sources):
    listed = [file for name in languages() for file in robot_sources("auto").of(name)]
    assert len(listed) == len(set(listed)) > 4


def test_an_unknown_language_is_refused_with_those_that_there_are(robot_sources):
    with pytest.raises(ModelError, match=r"^language 'cobol' is unknown; choose one of c, numpy$"):
        robot_sources("auto").of("cobol")


@pytest.fixture
def plain(tmp_path, monkeypatch):
    """The language of docs/contributing.md, in a folder that lies where languages are looked for."""
    for path, kind in (("emit/plain/files.py", "python"), ("templates/plain/model.py.jinja", "jinja")):
        assert path in PAGE
        file = tmp_path / path
        file.parent.mkdir(parents=True)
        file.write_text(re.search(rf"```{kind}\n(.*?)```", PAGE, re.S)[1], encoding="utf-8")
    (tmp_path / "emit/plain/__init__.py").touch()
    monkeypatch.setattr(ncgen.emit, "__path__", [*ncgen.emit.__path__, str(tmp_path / "emit")])
    monkeypatch.setattr(environment().loader, "searchpath", [*environment().loader.searchpath, str(tmp_path / "templates")])
    yield "plain"
    for name in [name for name in sys.modules if name.startswith("ncgen.emit.plain")]:
        del sys.modules[name]


@pytest.mark.parametrize("emission", ["unrolled", "tabled"])
def test_a_folder_is_a_language(plain, robot_model, emission):
    """Its two files are enough: it is listed, its sources are written beside the others, and they compute the mechanism."""
    sources = ncgen.generate(robot_model, emission=emission)
    assert plain in languages() and "robot_plain.py" in sources.files
    made: dict = {}
    exec(sources.files["robot_plain.py"], made)

    kernels = ncgen.compile(sources, backend="numpy")
    generator = np.random.default_rng(5)
    q, qd = kernels.q0 + 0.1 * generator.standard_normal(kernels.n), generator.standard_normal(kernels.n)
    exact = RowsOracle(robot_model).at(q, qd)
    arguments = {"t": 0.0, "q": q.tolist(), "qd": qd.tolist(), "p": kernels.p0.tolist()}
    found = {name: made[name](*(arguments[a] for a in program.inputs)) for name, program in sources.programs.programs.items()}
    np.testing.assert_allclose(found["phi"], exact.phi.high, atol=1e-13)
    np.testing.assert_allclose(found["gamma"], exact.gamma.high, atol=1e-12)
    (shape, indptr, indices), dense = made["PHI_Q_PATTERN"], np.zeros(exact.phi_q.high.shape)
    dense[np.repeat(np.arange(shape[0]), np.diff(indptr)), indices] = found["phi_q"]
    np.testing.assert_allclose(dense, exact.phi_q.high, atol=1e-13)
    for name, values in found.items():
        np.testing.assert_allclose(values, kernels.values(name, 0.0, q, qd, None), rtol=1e-12, atol=1e-12)
