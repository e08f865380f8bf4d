"""One export of every mechanism and target, built once, and copied for tests that build in it."""

from __future__ import annotations

import shutil

import pytest
from browser import Browser
from exported import shell

from ncgen.exchange.examples import load
from ncgen.exchange.export import export, fmu


@pytest.fixture(scope="session", autouse=True)
def quick():
    """Mock-up units are compiled as their text stands, which takes a third of the time and computes the same."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fmu, "FLAGS", tuple("-O0" if flag == "-O1" else flag for flag in fmu.FLAGS))
        yield


@pytest.fixture(scope="session")
def exports(once):
    """exports(name, target): a folder as exported, to be read only."""
    return lambda name, target="c": once(f"{name}-{target}", lambda folder: export(load(name), target, folder))


@pytest.fixture
def fresh(exports, tmp_path):
    """fresh(name, target): a copy of an export in a clean folder of this test's own."""
    return lambda name, target="c": shutil.copytree(exports(name, target), tmp_path / f"{name}-{target}")


@pytest.fixture
def built(once, exports, tmp_path):
    """built(name): a copy of an export to C whose library is there, as its Makefile compiles it."""

    def make(name, folder):
        shutil.copytree(exports(name), folder)
        shell(f"make lib{name}.a", folder)

    return lambda name: shutil.copytree(once(f"{name}-built", lambda folder: make(name, folder)), tmp_path / f"{name}-built")


@pytest.fixture(scope="session")
def page_of(tmp_path_factory):
    """page_of(model or name): the path of its page; that of an example is made once."""
    made, folder = {}, tmp_path_factory.mktemp("pages")

    def get(model):
        if not isinstance(model, str):  # others may have its name
            return export(model, "html", tmp_path_factory.mktemp("page"))[0]
        if model not in made:
            (made[model],) = export(load(model), "html", folder)
        return made[model]

    return get


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    """One browser for all tests that open pages."""
    with Browser(tmp_path_factory.mktemp("profile")) as found:
        yield found
