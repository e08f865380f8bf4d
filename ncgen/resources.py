"""Where the templates and the examples are: inside the package in a wheel, next to it in a checkout."""

from __future__ import annotations

import os
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def folder(name: str) -> Path:
    """The folder `templates` or `examples`. Raises FileNotFoundError where the installation is incomplete."""
    for root in (_PACKAGE, _PACKAGE.parent):
        if (root / name).is_dir():
            return root / name
    raise FileNotFoundError(f"the installation of ncgen lacks its folder {name}; install it again")


def package_files(*names: str) -> list[str]:
    """The paths of the files below folders of the package, or next to it, in a fixed order."""
    files = []
    for name in names:
        root = _PACKAGE / name if (_PACKAGE / name).is_dir() else folder(name)
        files += sorted(os.path.join(folder, file) for folder, _, inside in os.walk(root) for file in inside if not file.endswith(".pyc"))
    return files
