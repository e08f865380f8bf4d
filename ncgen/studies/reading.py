"""Results from where they were written."""

from __future__ import annotations

import os
from pathlib import Path

from ncgen.errors import NcgenError
from ncgen.report.along import Recorded
from ncgen.studies.folder import Folder
from ncgen.studies.result import StudyResult


def read(path: str | os.PathLike[str]) -> StudyResult | Recorded:
    """The result of a study from its folder, as far as it has come, or what `Trajectory.to_npz` wrote, by name.

    Raises NcgenError in one line for what is neither.
    """
    place = Path(path)
    if place.is_dir():
        folder = Folder.at(place)
        return StudyResult(folder.manifest, folder)
    if place.suffix == ".npz":
        return Recorded.read(place)
    raise NcgenError(f"{place}: {'no' if place.exists() else 'there is no such'} folder of a study or trajectory.npz; give one")
