"""The notebooks of the course, run again with what they print put in its place.

    python docs/course/execute.py                   all of them
    python docs/course/execute.py 01-a-rod.ipynb …

A notebook is kept with its outputs, for a code host and the site to show, and without what differs from run to run: no times, no
versions, no ids drawn at random. Code of folded solutions runs after the cells and must print the block behind it.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any, cast

import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode

COURSE = Path(__file__).resolve().parent

PATIENCE = 300
"""Seconds for a cell."""

KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}

SOLUTION = re.compile(r"```python\n(?P<code>.*?)```\n(?:\n```\n(?P<printed>.*?)```\n)?", re.DOTALL)

REFERENCE = re.compile(
    r"(?:^#+|[Ss]ections?|[Tt]ables?|[Nn]otebooks?|[Ff]igures?|[Ee]qs?\.)\s+\(?[\d.]+\)?(?:(?:, | and |-|–)\(?[\d.]+\)?)*", re.MULTILINE
)
"""Numbers that count places in a text and nothing else."""

NUMBER = re.compile(r"(?<![\w.^{])[-−]?(?P<number>\d+(?:,\d{3})*(?:\.\d+)?(?:e[-+]?\d+)?)(?![\w}])")

SMALL = 12
"""Whole numbers up to here are words: they need not be printed by a cell."""


def notebooks() -> list[Path]:
    return sorted(COURSE.glob("*.ipynb"))


def read(path: Path) -> NotebookNode:
    return nbformat.read(path, as_version=4)


def executed(notebook: NotebookNode) -> NotebookNode:
    """A notebook with what its cells give now. Raises CellExecutionError where one fails."""
    done = _clean(notebook)
    NotebookClient(done, timeout=PATIENCE, kernel_name=KERNEL["name"], resources={"metadata": {"path": str(COURSE)}}).execute()
    return _clean(done)


def solutions(notebook: NotebookNode) -> list[tuple[str, str]]:
    """(code, what it prints) of the folded solutions, in order."""
    texts = [cell.source + "\n" for cell in notebook.cells if cell.cell_type == "markdown"]
    return [(found["code"], found["printed"] or "") for text in texts for found in SOLUTION.finditer(text)]


def with_solutions(notebook: NotebookNode) -> NotebookNode:
    """A notebook whose last cells are the solutions, each in the state in which the course left the reader."""
    longer = _node(notebook)
    longer.cells = [*longer.cells, *(nbformat.v4.new_code_cell(code) for code, _ in solutions(notebook))]
    return longer


def printed(notebook: NotebookNode) -> list[str]:
    """The text that every code cell gives: what it prints, and its last value where that is no picture."""
    return ["".join(map(_text, cell.outputs)) for cell in notebook.cells if cell.cell_type == "code"]


def unsupported(notebook: NotebookNode) -> list[str]:
    """Numbers in the text that no cell says or prints, not even with more digits."""
    cells = [cell.source for cell in notebook.cells if cell.cell_type == "code"] + printed(notebook)
    cells += [text for pair in solutions(notebook) for text in pair]
    known = {float(found["number"].replace(",", "")) for text in cells for found in NUMBER.finditer(text.replace("_", ""))}
    texts = [SOLUTION.sub("", cell.source + "\n") for cell in notebook.cells if cell.cell_type == "markdown"]
    said = [found["number"] for text in texts for found in NUMBER.finditer(REFERENCE.sub("", text))]
    return [number for number in said if not _is_word(number) and not any(_rounds_to(value, number) for value in known)]


def same(told: str, given: str) -> bool:
    """Whether two texts differ by the last digits of numbers only, and by one there: other processors may round otherwise."""
    numbers = zip(NUMBER.finditer(told), NUMBER.finditer(given), strict=False)
    return NUMBER.sub("#", told) == NUMBER.sub("#", given) and all(_is_near(a["number"], b["number"]) for a, b in numbers)


def _is_near(told: str, given: str) -> bool:
    step = max(_step(told), _step(given)) if told != given else 0.0
    return abs(float(told.replace(",", "")) - float(given.replace(",", ""))) <= 1.01 * step


def _step(number: str) -> float:
    """What the last digit of a number counts; nothing for a whole number."""
    mantissa, _, exponent = number.replace(",", "").partition("e")
    return 0.0 if mantissa.isdigit() and not exponent else 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def _is_word(number: str) -> bool:
    return number.isdigit() and int(number) <= SMALL


def _rounds_to(value: float, number: str) -> bool:
    """Whether a value is a number of the text once it is rounded as that is."""
    return abs(abs(value) - float(number.replace(",", ""))) <= 0.5000001 * _step(number)


def _text(output: NotebookNode) -> str:
    if output.output_type == "stream":
        return output.text
    data = output.get("data", {})
    return "" if any(kind.startswith("image/") or kind == "text/html" for kind in data) else data.get("text/plain", "") + "\n"


def _clean(notebook: NotebookNode) -> NotebookNode:
    """A notebook without what differs from run to run."""
    clean = nbformat.v4.new_notebook(metadata={"kernelspec": KERNEL, "language_info": {"name": "python"}})
    for number, cell in enumerate(notebook.cells, 1):
        kept = {"id": f"cell-{number}", "cell_type": cell.cell_type, "metadata": {}, "source": cell.source}
        if cell.cell_type == "code":
            kept |= {"execution_count": None, "outputs": _whole(cell.get("outputs", []))}
        clean.cells.append(_node(kept))
    return clean


def _whole(outputs: list[NotebookNode]) -> list[NotebookNode]:
    """Outputs without counters, and in one piece what was printed in pieces, which is a matter of time."""
    whole: list[NotebookNode] = []
    for output in outputs:
        if whole and output.output_type == "stream" == whole[-1].output_type and output.name == whole[-1].name:
            whole[-1].text += output.text
        else:
            whole.append(_node({**output, **({"execution_count": None} if "execution_count" in output else {})}))
    return whole


def _node(fields: dict[str, Any]) -> NotebookNode:
    return cast(NotebookNode, nbformat.from_dict(fields))


def main(names: list[str]) -> None:
    for path in [COURSE / name for name in names] if names else notebooks():
        print(path.name, flush=True)
        done = executed(read(path))
        path.write_text(nbformat.writes(done) + "\n", encoding="utf-8")
        for number in unsupported(done):
            print(f"    {number} stands in the text and no cell prints it")


if __name__ == "__main__":
    main(sys.argv[1:])
