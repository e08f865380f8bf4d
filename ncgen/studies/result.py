"""What a study has found: arrays by name, failures as rows, and ways to other programs."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from ncgen.errors import ModelError, NcgenError, counted
from ncgen.files import argument_was, path_of, write_text, writing
from ncgen.solver.argument_checks import echo, offer
from ncgen.solver.trajectories.trajectory_files import package_for_tables
from ncgen.studies.indices import Indices, indices
from ncgen.studies.study_folder import Folder
from ncgen.studies.variants import Part

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OK = "ok"


@dataclass(frozen=True, eq=False)
class StudyResult:
    """The variants of a study that are done, in the order of their numbers; `result["psi2"]` is a column, (B,) or (B, times).

    about: what the study was (`study.json` of its folder); folder: where it lies, or None; held: the parts, where there is no folder
    """

    about: dict[str, Any]
    folder: Folder | None = None
    held: tuple[Part, ...] = ()

    def __repr__(self) -> str:
        return f"<StudyResult {self.about['model']}: {len(self)} of {self.about['variants']} variants, {', '.join(self.keys())}>"

    @cached_property
    def variant(self) -> np.ndarray:
        """Numbers of the variants, (B,), from 0."""
        return np.concatenate([np.arange(first, end) for first, end, _ in self._spans] or [np.empty(0, dtype=int)])

    @cached_property
    def _spans(self) -> list[tuple[int, int, Any]]:
        """(first, end, file or part), none of which overlap."""
        if self.folder is not None:
            return self.folder.files()
        return [(block.first, block.first + len(block), block) for block in sorted(self.held, key=lambda block: block.first)]

    def __len__(self) -> int:
        return sum(end - first for first, end, _ in self._spans)

    def keys(self) -> tuple[str, ...]:
        """Return the names of all columns.

        Returns
        -------
        tuple of str
            What varied, `ok`, and what was kept.
        """
        return (*self.names, OK, *self.about["kept"])

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def __contains__(self, name: object) -> bool:
        return name in self.keys()

    def __getitem__(self, name: str) -> np.ndarray:
        """A column. Raises ModelError for one that there is not."""
        if name not in self.keys():
            raise ModelError(f"{self.about['model']}: the study has no column {echo(name)}; {offer(name, self.keys())}")
        cached = vars(self).setdefault("_columns", {})
        if name not in cached:
            pieces = [self.folder.column(at, name) if self.folder else at.columns[name] for _, _, at in self._spans]
            cached[name] = np.concatenate(pieces) if pieces else np.empty(0)
        return cached[name]

    @property
    def names(self) -> tuple[str, ...]:
        """What varied."""
        return tuple(self.about["names"])

    @property
    def times(self) -> np.ndarray:
        """Instants (s) of histories."""
        return np.array(self.about["times"])

    @property
    def ok(self) -> np.ndarray:
        """Which variants arrived, (B,)."""
        return self[OK]

    @cached_property
    def complete(self) -> bool:
        """Whether all variants are done: in a folder every file is read, and one that is not whole does not count."""
        return len(self) == self.about["variants"] and (self.folder is None or self.folder.is_whole())

    @cached_property
    def messages(self) -> dict[int, str]:
        """{variant: sentence} of variants that failed or have a warning."""
        messages: dict[int, str] = {}
        for _, _, at in self._spans:
            messages |= self.folder.messages(at) if self.folder else at.messages
        return messages

    @property
    def failures(self) -> dict[int, str]:
        """{variant: why it did not arrive}."""
        failed = set(self.variant[~self.ok].tolist())
        return {variant: sentence for variant, sentence in self.messages.items() if variant in failed}

    # -- tables ----------------------------------------------------------------------------------------------------------------------------

    def table(self) -> dict[str, np.ndarray]:
        """Return all columns, each history as one column for every time.

        Returns
        -------
        dict of str to numpy.ndarray
            Columns, shape (B,) each, with `variant` and `status` ("ok", or the message).
        """
        columns: dict[str, np.ndarray] = {"variant": self.variant}
        for name in self.keys():
            columns |= _flat(name, self[name], self.times)
        failures = self.failures
        columns["status"] = np.array([failures.get(v, OK) for v in self.variant.tolist()], dtype=object)
        return columns

    def dataframe(self) -> Any:
        """Return the table as a pandas DataFrame.

        Returns
        -------
        pandas.DataFrame
            The table; its index is the variant.

        Raises
        ------
        NcgenError
            If pandas is not installed.
        """
        return package_for_tables("pandas").DataFrame(self.table()).set_index("variant")

    def dataset(self) -> Any:
        """Return the columns as an xarray Dataset.

        Returns
        -------
        xarray.Dataset
            A complete grid has a dimension for each name that varied, any other design the dimension `variant`; histories have `t`.

        Raises
        ------
        NcgenError
            If xarray is not installed.
        """
        xarray = package_for_tables("xarray")
        if self.about["design"] == "grid" and self.complete:
            shape, dims = tuple(self.about["shape"]), self.names
            coords = {name: np.unravel_index(np.arange(len(self)), shape)[k] for k, name in enumerate(dims)}
            axes = {name: self[name][np.unique(coords[name], return_index=True)[1]] for name in dims}
        else:
            shape, dims, axes = (len(self),), ("variant",), {"variant": self.variant}
            axes |= {name: ("variant", self[name]) for name in self.names}
        arrays = {}
        for name in (OK, *self.about["kept"]):
            values = self[name]
            arrays[name] = ((*dims, "t")[: len(shape) + values.ndim - 1], values.reshape(*shape, *values.shape[1:]))
        return xarray.Dataset(arrays, {**axes, **({"t": self.times} if len(self.times) else {})}, {"model": self.about["model"]})

    @argument_was("path")
    def to_parquet(self, output: str | os.PathLike[str]) -> Path:
        """Write the table as a Parquet file, a part of the study at a time.

        Parameters
        ----------
        output : path
            Name of the file.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        NcgenError
            If the file cannot be written, or without pyarrow.
        """
        arrow, parquet = package_for_tables("pyarrow"), package_for_tables("pyarrow.parquet")
        target = path_of(output)
        if not self._spans:
            raise NcgenError(f"{target}: the study has no variant yet")
        with writing(target) as file, ExitStack() as stack:
            writer: Any = None
            for first, _, at in self._spans:
                block = StudyResult(self.about, None, (self._part(first, at),))
                batch = arrow.table({k: v.tolist() if v.dtype == object else v for k, v in block.table().items()})
                writer = writer or stack.enter_context(parquet.ParquetWriter(file, batch.schema))
                writer.write_table(batch)
        return target

    @argument_was("path")
    def to_csv(self, output: str | os.PathLike[str]) -> Path:
        """Write the table with a header line and every digit.

        Parameters
        ----------
        output : path
            Name of the file.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        NcgenError
            If the file cannot be written.
        """
        import csv
        import io

        table, buffer = self.table(), io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*(column.tolist() for column in table.values()), strict=True))
        return write_text(path_of(output), buffer.getvalue())

    def _part(self, first: int, at: Any) -> Part:
        if self.folder is None:
            return at
        return self.folder.part(first, at)

    # -- what it says ----------------------------------------------------------------------------------------------------------------------

    def sobol(self, name: str) -> Indices:
        """Compute Sobol' indices of a column, of a study with design="saltelli".

        Parameters
        ----------
        name : str
            Name of the column.

        Returns
        -------
        Indices
            First-order and total indices by each name that varied.

        Raises
        ------
        NcgenError
            If the study has another design.
        """
        if self.about["design"] != "saltelli":
            raise NcgenError(f"Sobol' indices need design='saltelli'; this study is a {self.about['design']}")
        if not self.complete:
            raise NcgenError(f"Sobol' indices need all variants; {len(self)} of {self.about['variants']} are done, start the study again")
        if self[name].ndim > 1:
            raise NcgenError(f"{name}: Sobol' indices are of one number a variant; keep the value at the end, or an extreme")
        return indices(self.names, self[name])

    @overload
    def plot(self, output: None = None, names: str | Iterable[str] | None = None) -> Figure: ...

    @overload
    def plot(self, output: str | os.PathLike[str], names: str | Iterable[str] | None = None) -> Path: ...

    @argument_was("path")
    def plot(self, output: str | os.PathLike[str] | None = None, names: str | Iterable[str] | None = None) -> Figure | Path:
        """Plot columns: envelopes of histories, heat maps of a grid of two, points over what varied, or parallel coordinates.

        Parameters
        ----------
        output : path, optional
            Name of a file for the figure.
        names : str or iterable of str, optional
            Columns. Default: all that were kept.

        Returns
        -------
        Figure or Path
            A matplotlib figure; the file if `output` is given.
        """
        view = import_module("ncgen.view.variant_pictures")
        wanted = (names,) if isinstance(names, str) else tuple(names or self.about["kept"])
        shape = tuple(self.about["shape"]) if self.about["design"] == "grid" and self.complete else None
        title = f"{self.about['model']}: {counted(len(self), 'variant')}"
        figure = view.picture(title, {n: self[n] for n in self.names}, {n: self[n] for n in wanted}, self.times, shape)
        return figure if output is None else import_module("ncgen.view.figure").save(figure, output)


def _flat(name: str, values: np.ndarray, times: np.ndarray) -> dict[str, np.ndarray]:
    if values.ndim == 1:
        return {name: values}
    return {f"{name} at {t:g} s": values[:, k] for k, t in enumerate(times)}
