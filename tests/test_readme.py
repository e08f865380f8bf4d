"""What the README shows works as shown."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_ten_lines_run():
    """The mechanism of the README is generated, compiled and simulated; energy is kept."""
    names: dict = {}
    exec(re.search(r"```python\n(.*?)```", README, re.S)[1], names)
    assert names["run"].energy_drift < 1e-6
    assert names["run"].t[-1] == 2.0


def loaded(path: Path) -> ModuleType:
    """A program of the documentation as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_links_and_pictures_exist():
    """Every target of a link is there, and a page that is linked is a page of the site, which cannot be built otherwise."""
    pages = {path for pattern in loaded(ROOT / "docs/site/build.py").PAGES for path in ROOT.glob(pattern)}
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").glob("*/README.md")]:
        for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
            if "://" not in target:
                path = (page.parent / target).resolve()
                assert path.exists() and (path.suffix != ".md" or path in pages), f"{page}: {target}"


def test_every_page_is_in_the_navigation():
    """The site cannot be built otherwise."""
    plan = (ROOT / "docs" / "site" / "mkdocs.yml").read_text(encoding="utf-8")
    assert [page.name for page in (ROOT / "docs").glob("*.md") if f"- docs/{page.name}\n" not in plan.replace("Tutorial: ", "")] == []


def test_the_program_of_the_robots_page_runs(monkeypatch):
    """Joint space as docs/robots.md shows it: without the forces that hold it the crane falls, with them only its damped joint knows."""
    monkeypatch.chdir(ROOT)
    page = (ROOT / "docs" / "robots.md").read_text(encoding="utf-8")
    names: dict = {}
    exec(next(block for block in re.findall(r"```python\n(.*?)```", page, re.S) if "space.jacobian" in block), names)
    assert names["J"].shape == (6, 6) and names["M"].shape == (6, 6)
    assert abs(names["a"]).max() < 1e-12


def test_programs_of_the_paper_page_run(capsys):
    """The scripts of docs/paper.md run, and print the facts that the page states."""
    page = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    names: dict = {}
    for program in re.findall(r"```python\n(.*?)```", page, re.S):
        exec(program, names)
    said = capsys.readouterr().out
    for line in ("all sine     rank 28", "paper's rule rank 30", "rank of the 25 rigid-body rows: 24", "row 16 = +1.000 row 6"):
        assert line in said and line in page


@pytest.mark.parametrize("page", ["README.md", "docs/overview.md"])
def test_names_of_the_table_exist(page):
    """Every ncgen.name that the README and the table of calls mention is public, every command is one, and every member is there."""
    import ncgen
    from ncgen.cli import app
    from ncgen.mechanism.kernels import Kernels
    from ncgen.solver.trajectories.trajectory import Trajectory

    text = (ROOT / page).read_text(encoding="utf-8")
    names = set(re.findall(r"ncgen\.(\w+)\(", text))
    commands = set(re.findall(r"(?:^    |`)ncgen (\w+)", text, re.M))
    assert names and names <= set(ncgen.__all__)
    assert commands and commands <= {command.name or command.callback.__name__ for command in app.registered_commands}
    assert all(hasattr(Trajectory, name) for name in re.findall(r"`run\.(\w+)\(", text))
    assert all(hasattr(Kernels, name) for name in re.findall(r"`robot\.(\w+)\(", text))


def test_two_commands_are_those_of_continuous_integration():
    """The README's commands, word for word."""
    commands = re.findall(r"^    (.*)$", README, re.M)
    assert commands[:2] == ["python -m pip install . && ncgen run robot", "python -m pip install '.[test]' && python -m pytest"]


def test_the_citation_is_that_of_this_version():
    """In the file that tools read, and in the guide for contributors."""
    import ncgen

    for page in ("CITATION.cff", "contributing.md"):
        text = (ROOT / "docs" / page).read_text(encoding="utf-8")
        assert re.search(rf"version *[:=] *{{?{re.escape(ncgen.__version__)}}}?[,\n]", text), page


def test_readme_fits_two_screens():
    assert len(README.splitlines()) <= 100


def test_picture_of_the_readme_moves():
    """An animation that begins again by itself, and is small: `python docs/renew.py robot.gif` makes it."""
    (picture,) = re.findall(r"!\[[^]]*\]\(([^)]+)\)", README)
    assert (ROOT / picture).stat().st_size < 400_000
    with Image.open(ROOT / picture) as animation:
        assert animation.n_frames > 20 and animation.info["loop"] == 0


def test_measured_tables_have_a_command_each():
    """A plain block of a page with measurements stands behind the command that prints it, whose output docs/renew.py puts there; what a
    block of Python prints is looked at by tests/pages."""
    renew = loaded(ROOT / "docs" / "renew.py")
    for page in filter(renew.commands, (ROOT / "docs").glob("*.md")):
        text = re.sub(r"^```python\n(?:(?!```).*\n)*```\n\n```\n(?:(?!```).*\n)*```$", "", page.read_text(encoding="utf-8"), flags=re.M)
        fences = re.findall(r"^```(.*)$", text, re.M)[::2]
        assert len(renew.commands(page)) == fences.count(""), page
    page = (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")
    tables = len(renew.commands(ROOT / "docs" / "performance.md"))
    assert tables and renew.renewed(page, lambda command: "new").count("-->\n```\nnew\n```\n") == tables
    assert renew.renewed(page, lambda command: "") != page
    assert renew.renewed(page, lambda command: "\n  a  b\nc\n").count("-->\n```\n  a  b\nc\n```\n") == tables  # titles keep their columns
