"""What the README shows works as shown."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_ten_lines_run():
    """The mechanism of the README is generated, compiled and simulated; energy is kept."""
    names: dict = {}
    exec(re.search(r"```python\n(.*?)```", README, re.S)[1], names)
    assert names["run"].energy_drift < 1e-6
    assert names["run"].t[-1] == 2.0


def test_links_and_pictures_exist():
    for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "examples").glob("*/README.md")]:
        for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
            if "://" not in target:
                assert (page.parent / target).exists(), f"{page}: {target}"


def test_names_of_the_table_exist():
    """Every ncgen.name mentioned in the README is there."""
    import ncgen

    for name in set(re.findall(r"ncgen\.(\w+)\(", README)):
        assert hasattr(ncgen, name)
