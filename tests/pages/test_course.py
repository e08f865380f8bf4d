"""The course runs: every cell and every folded solution gives what stands in the notebook, and every number of its text is one of those."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat", reason="notebooks need pip install '.[docs]'")
pytest.importorskip("nbclient", reason="notebooks need pip install '.[docs]'")

COURSE = Path(__file__).resolve().parents[2] / "docs" / "course"

spec = importlib.util.spec_from_file_location("execute", COURSE / "execute.py")
assert spec and spec.loader
execute = importlib.util.module_from_spec(spec)
spec.loader.exec_module(execute)

QUICK = ("01-a-rod.ipynb", "03-kinematics.ipynb")
EVERY = [path.name for path in execute.notebooks()]


def differences(notebook):
    """Texts of cells and solutions that are not those in the notebook."""
    done = execute.executed(execute.with_solutions(notebook))
    expected = [*execute.printed(notebook), *(told for _, told in execute.solutions(notebook))]
    return [(told, given) for told, given in zip(expected, execute.printed(done), strict=True) if not execute.same(told, given)]


@pytest.mark.parametrize("name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in EVERY])
def test_cells_and_solutions_give_what_is_shown(name):
    assert differences(execute.read(COURSE / name)) == []


@pytest.mark.parametrize("name", EVERY)
def test_numbers_of_the_text_are_printed_by_cells(name):
    assert execute.unsupported(execute.read(COURSE / name)) == []


SMALL = """Of 45 coordinates 36 are free.

<details>

```python
print(45 - 9)
```

```
36
```

</details>"""


def small(text=SMALL, shown="45 36\n"):
    output = nbformat.v4.new_output("stream", name="stdout", text=shown)
    return nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_markdown_cell(text), nbformat.v4.new_code_cell("print(45, 36)", outputs=[output])]
    )


def test_a_changed_number_is_seen():
    """In the text, in an output and in a solution."""
    assert execute.unsupported(small()) == [] and differences(small()) == []
    assert execute.unsupported(small(SMALL.replace("36 are", "37 are"))) == ["37"]
    assert differences(small(shown="45 37\n")) == [("45 37\n", "45 36\n")]
    assert differences(small(SMALL.replace("\n36", "\n37"))) == [("37\n", "36\n")]


def test_only_last_digits_may_differ():
    assert execute.same("slope −1189.55 m, 2e-05", "slope −1189.54 m, 1e-05")
    assert not execute.same("3 rows", "4 rows") and not execute.same("0.25", "0.27") and not execute.same("a 1.0", "b 1.0")
    assert not execute.same("2e-05", "2e-06") and not execute.same("1 2", "1")


@pytest.mark.parametrize("name", EVERY)
def test_a_notebook_is_whole(name):
    """Executed, without errors, warnings and what differs from run to run; exercises have folded solutions; links lead somewhere."""
    notebook = execute.read(COURSE / name)
    assert notebook == execute._clean(notebook)
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert outputs and not [o for o in outputs if o.output_type == "error" or o.get("name") == "stderr"]
    text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    assert text.count("\n**") >= text.count("<details>") == text.count("</details>") >= 2
    for target in re.findall(r"\]\(([^)#]+)\)", text):
        assert (COURSE / target).exists(), target
