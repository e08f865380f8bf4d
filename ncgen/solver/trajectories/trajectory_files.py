"""A trajectory as files: all that is known of it in an archive of NumPy's, and its histories as a table for other programs."""

from __future__ import annotations

import io
import json
import platform
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ncgen import __version__
from ncgen.errors import ModelError, NcgenError
from ncgen.files import write_bytes
from ncgen.toolchain.cache import build_command
from ncgen.toolchain.compilers import processor, version_line

if TYPE_CHECKING:
    from types import ModuleType

    from ncgen.solver.trajectories.trajectory import Trajectory

FORMAT = 1
"""Of what an archive says of itself; archives of before say nothing."""


def archive(run: Trajectory) -> bytes:
    """Numbers and names by their keys, `about` as JSON, and `model`, the text of its model file, where a file can say it."""
    buffer = io.BytesIO()
    ports = {"inputs": run.inputs, "outputs": run.outputs}
    inputs_and_outputs: dict[str, Any] = {kind: np.array([*values.values()]).T for kind, values in ports.items() if values}
    inputs_and_outputs |= {f"{kind[:-1]}_names": np.array([*values], dtype=str) for kind, values in ports.items() if values}
    if (text := _model_text(run)) is not None:
        inputs_and_outputs["model"] = np.array(text)
    np.savez(
        buffer, t=run.t, q=run.q, qd=run.qd, qdd=run.qdd, lam=run.lam, work=run.work, p=run.p,
        coordinates=np.array(run.coordinates, dtype=str), parameters=np.array(run.kernels.parameters, dtype=str),
        constraints=np.array([r.label for r in run.model.rows], dtype=str), independent=np.array(run.independent, dtype=str),
        about=np.array(json.dumps(about(run))), **inputs_and_outputs,
    )  # fmt: skip
    return buffer.getvalue()


def about(run: Trajectory) -> dict[str, Any]:
    """How a trajectory was made, and by which versions, as JSON has it."""
    made_by = {name: getattr(run, name) for name in ("formalism", "integrator", "engine", "number", "stopped", "made_with")}
    versions = {"ncgen": __version__, "numpy": np.__version__, "python": platform.python_version(), **_built(run)}
    options = {name: value if isinstance(value, (bool, int, str)) else float(value) for name, value in run.options.items()}
    record = {"name": run.name, "chosen": list(run.chosen), "options": options, "statistics": asdict(run.statistics)}
    if run.impulses:
        record["impulses"] = [[each.t, each.driver, each.size] for each in run.impulses]
    if run.events:
        record |= {"events": [each.plain() for each in run.events], "changed": bool(run.modes) or run.changed}
    return {"format": FORMAT, **versions, **made_by, **record}


def _built(run: Trajectory) -> dict[str, str]:
    """The processor and, of compiled kernels, the compiler with its flags: the last bits of a motion depend on them."""
    library = getattr(run.kernels, "library", None)
    command = build_command(library) if library is not None else []
    if not command:
        return {"processor": processor()}
    compiler = "ziglang" if "ziglang" in command[:4] else version_line(command[0]) or command[0]
    flags = " ".join(word for word in command[1:] if word.startswith("-") and word not in ("-m", "-o"))
    return {"processor": processor(), "compiler": compiler, "flags": flags}


def _model_text(run: Trajectory) -> str | None:
    """None for a model with a Python function in it, which is no data."""
    try:
        return import_module("ncgen.exchange.toml_writer").to_toml(run.model)
    except ModelError:
        return None


def histories(run: Trajectory) -> dict[str, np.ndarray]:
    """{column: (K,)}: t, coordinates, velocities, inputs and outputs."""
    moved = dict(zip(run.coordinates, run.q.T, strict=True))
    rates = {f"rate({name})": column for name, column in zip(run.coordinates, run.qd.T, strict=True)}
    return {"t": run.t, **moved, **rates, **run.inputs, **run.outputs}


def comma_separated(run: Trajectory) -> str:
    """The histories as lines of comma-separated values with every digit, after a line of their names."""
    columns = histories(run)
    lines = [",".join(map(_cell, columns))] + [",".join(map(repr, row)) for row in np.column_stack([*columns.values()]).tolist()]
    return "\n".join(lines) + "\n"


def _cell(label: str) -> str:
    """A label as a cell of a table: in quotes where a comma or a quote would end it."""
    return '"' + label.replace('"', '""') + '"' if set(label) & set(',"') else label


def write_parquet(run: Trajectory, path: Path) -> Path:
    """The histories as a Parquet file, with `about` and the model's text among its metadata under "ncgen" and "ncgen.model"."""
    arrow, parquet = package_for_tables("pyarrow"), package_for_tables("pyarrow.parquet")
    metadata = {"ncgen": json.dumps(about(run)), "ncgen.model": _model_text(run) or ""}
    buffer = io.BytesIO()
    parquet.write_table(arrow.table(histories(run)).replace_schema_metadata(metadata), buffer)
    return write_bytes(path, buffer.getvalue())


def package_for_tables(name: str, instead: str = "") -> ModuleType:
    """An optional package. Raises NcgenError that names the extra where it is not installed, and what else there is."""
    try:
        return import_module(name)
    except ImportError as error:
        raise NcgenError(f"{name.partition('.')[0]} is not installed; pip install 'ncgen[tables]'{instead}") from error
