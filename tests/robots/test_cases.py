"""The tests that the list of cases names exist."""

import re
from pathlib import Path

HERE = Path(__file__).parent


def test_every_test_of_the_list_exists():
    named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", (HERE / "README.md").read_text(encoding="utf-8"))
    assert len(named) > 50
    absent = [f"{file}::{name}" for file, name in named if f"\ndef {name}(" not in (HERE / file).read_text(encoding="utf-8")]
    assert absent == []
