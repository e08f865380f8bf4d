"""Results and motions from where they were written."""

from __future__ import annotations

import os
from typing import overload

from ncgen.compiler import compile
from ncgen.errors import NcgenError
from ncgen.exchange.text import as_path
from ncgen.exchange.toml_reader import model_of
from ncgen.files import is_folder, is_there
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.report.along import Recorded
from ncgen.solver.trajectories.trajectory import Trajectory
from ncgen.studies.result import StudyResult
from ncgen.studies.study_folder import Folder


@overload
def read(path: str | os.PathLike[str], model: None = None) -> StudyResult | Trajectory | Recorded: ...


@overload
def read(path: str | os.PathLike[str], model: Model | Kernels) -> Trajectory: ...


def read(path: str | os.PathLike[str], model: Model | Kernels | None = None) -> StudyResult | Trajectory | Recorded:
    """Read the result of a study from its folder, as far as it has come, or a trajectory that `Trajectory.to_npz` wrote.

    A file is data: nothing of it is evaluated or unpickled.

    Parameters
    ----------
    path : path
        The folder or the file.
    model : Model or Kernels, optional
        Model of a trajectory whose file has none, because the model is not all data or the file is older than the first release. Without it
        such a file gives its arrays and names only.

    Returns
    -------
    StudyResult, Trajectory or Recorded
        What was written.

    Raises
    ------
    NcgenError
        For other files, broken ones, and a trajectory of another model.
    """
    file = as_path(path, "the path of a study's folder or of a trajectory")
    if is_folder(file):
        folder = Folder.at(file)
        return StudyResult(folder.manifest, folder)
    if file.suffix != ".npz":
        raise NcgenError(f"{file}: {'no' if is_there(file) else 'there is no such'} folder of a study or trajectory.npz; give one")
    recorded = Recorded.read(file)
    if model is None and not (recorded.model and recorded.about):
        return recorded
    the_model = model_of(recorded.model, file) if model is None else model
    return recorded.trajectory(compile(the_model) if isinstance(the_model, Model) else the_model)
