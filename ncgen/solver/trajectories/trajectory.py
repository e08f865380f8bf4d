"""A trajectory: what a simulation found, with names and units."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, overload

import numpy as np

from ncgen.errors import ModelError, counted
from ncgen.files import argument_was, path_of, write_bytes, write_text
from ncgen.model.elements import Point, Vector, coordinate_of
from ncgen.solver.argument_checks import echo, offer
from ncgen.solver.trajectories.motion_quantities import MotionQuantities
from ncgen.solver.trajectories.output_values import outputs_of, uses_accelerations, uses_loads

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ncgen.solver.loads.reactions import Reactions
    from ncgen.solver.trajectories.difference import Difference


class PageLike(Protocol):
    """A page that `ncgen.view.page` makes: a notebook shows it, `save` writes it into a file."""

    text: str

    def _repr_html_(self) -> str: ...

    def save(self, output: str | os.PathLike[str]) -> Path: ...


@dataclass(frozen=True, eq=False, kw_only=True)
class Trajectory(MotionQuantities):
    """A motion on a time grid of K instants.

    t (K,) in s; q, qd, qdd (K, n) in m and rad, in the order of `coordinates`; lam (K, m): multipliers of the rows,
    in the sense M q̈ + Φ_qᵀ λ = Q; work (K,): work (J) of drivers and of forces without a potential since the start.
    Accelerations and multipliers are computed when they are first asked for.
    engine: "c", "emitted", or "python" with the reason; moved_by: the kernels that the motion was computed with, which
    stay the same where `kernels` are replaced to look at it with other forces; options: those of the formalism; stopped: the
    run ended where it was told to (`stop` of `simulate`), which is its last instant and off the grid; number: the number
    type that it was computed with; made_with: the method and the engine in words, and why they were taken; impulses: what drivers did
    where the velocity of one jumped, events: what happened at the model's events, both in the order of time; modes: which gaps
    and joints were held from when on; changed: events changed parameters, of which p has those of the start; own: the user's formalism,
    None with ncgen's.
    `run["psi2"]` is one coordinate, `run["rate(psi2)"]` its velocity, `run["rate(rate(psi2))"]` its acceleration;
    like a dictionary a trajectory has the coordinates' names to go
    through, and `"psi2" in run`. Two trajectories are equal if they are the same one.
    """

    def __repr__(self) -> str:
        grid = f"{len(self.t)} instants from {self.t[0]:g} to {self.t[-1]:g} s" if len(self.t) else "no instant"
        return f"<Trajectory {self.name}: {grid}, {counted(len(self), 'coordinate')}, {self.formalism}, {self.integrator}>"

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        return import_module("ncgen.report.cards").of_trajectory(self)

    def __getitem__(self, name: str) -> np.ndarray:
        """One free coordinate, `rate(name)`, `rate(rate(name))`, an output or an input over time, shape (K,).

        Raises ModelError for an unknown name.
        """
        if isinstance(name, str) and name not in self and (name in self.model.outputs or name in self.kernels.inputs):
            return self.outputs[name] if name in self.model.outputs else self.inputs[name]
        if not isinstance(name, str):
            raise ModelError(
                f"{self.name}: a coordinate is asked for by its name, not by {echo(name)}; instants are rows of run.t, run.q, run.qd"
            )
        rate = coordinate_of(name)
        inner = coordinate_of(rate)
        if isinstance(element := self.model.elements.get(inner), (Point, Vector)):
            kind = type(element).__name__.lower()
            raise ModelError(
                f"{self.name}: {inner} is a {kind} of three coordinates, {inner}.x and others; run.{kind}({inner!r}) has them all"
            )
        if inner not in self.kernels.index:
            raise ModelError(f"{self.name} has no free coordinate {echo(inner)}; {offer(inner, self.coordinates)}")
        history = self.q if rate == name else self.qd if inner == rate else self.qdd
        return history[:, self.kernels.index[inner]]

    def __contains__(self, name: object) -> bool:
        """Whether a free coordinate, or `rate(name)` or `rate(rate(name))` of one, has that name."""
        return isinstance(name, str) and coordinate_of(coordinate_of(name)) in self.kernels.index

    def __iter__(self) -> Iterator[str]:
        """The names of the free coordinates."""
        return iter(self.coordinates)

    def __len__(self) -> int:
        """How many free coordinates there are; the number of instants is len(run.t)."""
        return len(self.coordinates)

    def keys(self) -> tuple[str, ...]:
        """Return the names of the free coordinates, so that `dict(run)` has all histories by name.

        Returns
        -------
        tuple of str
            The names, in the order of q.
        """
        return self.coordinates

    @cached_property
    def outputs(self) -> dict[str, np.ndarray]:
        """{label: (K,)} of the model's outputs over time. Warns of loads in them that are not unique."""
        if not self.model.outputs:
            return {}
        if uses_loads(self.model):
            from ncgen.solver.loads.observed_loads import warn_of_shared

            warn_of_shared(self)
        accelerations_and_loads = (self.qdd, self.lam) if uses_accelerations(self.model) else None
        values = outputs_of(self.kernels, self.t, self.q, self.qd, self.p, accelerations_and_loads)
        return dict(zip(self.model.outputs, values.T, strict=True))

    @property
    def inputs(self) -> dict[str, np.ndarray]:
        """{name: (K,)} of the model's inputs over time."""
        p = np.array([self.kernels.present(float(t), self.p) for t in self.t])
        return {name: p[:, self.kernels.parameters.index(name)] for name in self.kernels.inputs}

    def table(self) -> dict[str, np.ndarray]:
        """Return all histories by column.

        Returns
        -------
        dict of str to numpy.ndarray
            The columns, shape (K,) each: t, coordinates, their velocities and accelerations, inputs and outputs.
        """
        from ncgen.solver.trajectories.trajectory_files import histories

        return histories(self) | {f"rate(rate({name}))": column for name, column in zip(self.coordinates, self.qdd.T, strict=True)}

    def dataframe(self) -> Any:
        """Return the columns of `table` as a pandas DataFrame.

        Returns
        -------
        pandas.DataFrame
            The histories; its index is the time (s).

        Raises
        ------
        NcgenError
            If pandas is not installed.
        """
        from ncgen.solver.trajectories.trajectory_files import package_for_tables

        return package_for_tables("pandas", ", or take run.table()").DataFrame(self.table()).set_index("t")

    def reactions(self, pressure_angle: float = np.pi / 9) -> Reactions:
        """Compute the loads between bodies.

        See `ncgen.solver.loads.reactions.reactions`.

        Parameters
        ----------
        pressure_angle : float, optional
            Pressure angle of gears and racks (rad); 20 degrees by default.

        Returns
        -------
        Reactions
            Forces and moments in the joints.
        """
        from ncgen.solver.loads.reactions import reactions

        return reactions(self, pressure_angle)

    def driver_forces(self) -> dict[str, np.ndarray]:
        """Return forces and couples of the drivers.

        See `ncgen.solver.loads.inverse_dynamics.driver_forces`.

        Returns
        -------
        dict of str to numpy.ndarray
            Force (N) or couple (N m) by coordinate, shape (K,) each.
        """
        from ncgen.solver.loads.inverse_dynamics import driver_forces

        return driver_forces(self)

    # -- files ---------------------------------------------------------------------------------

    @argument_was("path")
    def to_npz(self, output: str | os.PathLike[str]) -> Path:
        """Write the trajectory as a NumPy archive, from which `ncgen.read` gives it back.

        The archive has all arrays and names, inputs and outputs (K, …) of a model that has them, the model as text, `made_with`, and
        versions.

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
        from ncgen.solver.trajectories.trajectory_files import archive

        return write_bytes(path_of(output), archive(self))

    @argument_was("path")
    def to_csv(self, output: str | os.PathLike[str]) -> Path:
        """Write t, coordinates, velocities, inputs and outputs as a table with a header line and every digit.

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
        from ncgen.solver.trajectories.trajectory_files import comma_separated

        return write_text(path_of(output), comma_separated(self))

    @argument_was("path")
    def to_parquet(self, output: str | os.PathLike[str]) -> Path:
        """Write the columns of `to_csv` as a Parquet file.

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
        from ncgen.solver.trajectories.trajectory_files import write_parquet

        return write_parquet(self, path_of(output))

    def compared(self, other: Trajectory) -> Difference:
        """Compare this motion with another one of the same coordinates.

        See `ncgen.solver.trajectories.difference.difference`.

        Parameters
        ----------
        other : Trajectory
            The motion to compare with.

        Returns
        -------
        Difference
            Largest differences by coordinate, with their times.
        """
        from ncgen.solver.trajectories.difference import difference

        return difference(self, other)

    @overload
    def plot(self, output: None = None, names: str | Iterable[str] | None = None, against: str | None = None) -> Figure: ...

    @overload
    def plot(self, output: str | os.PathLike[str], names: str | Iterable[str] | None = None, against: str | None = None) -> Path: ...

    @argument_was("path")
    def plot(
        self, output: str | os.PathLike[str] | None = None, names: str | Iterable[str] | None = None, against: str | None = None
    ) -> Figure | Path:
        """Plot time histories, energy and constraint violation.

        Parameters
        ----------
        output : path, optional
            Name of a file for the figure.
        names : str or iterable of str, optional
            Quantities to plot. Default: coordinates, energy and violation.
        against : str, optional
            Quantity to plot them over instead of the time, as in `run.plot(names="C.y", against="C.x")`.

        Returns
        -------
        Figure or Path
            A matplotlib figure, which a notebook shows; the file if `output` is given.
        """
        view = import_module("ncgen.view.figure")
        figure = view.plot(self, names, against)
        return figure if output is None else view.save(figure, path_of(output))

    @overload
    def animate(self, output: None = None) -> PageLike: ...

    @overload
    def animate(self, output: str | os.PathLike[str]) -> Path: ...

    @argument_was("path")
    def animate(self, output: str | os.PathLike[str] | None = None) -> PageLike | Path:
        """Show the motion on a self-contained HTML page, or as a film.

        Parameters
        ----------
        output : path, optional
            Name of a file: .html for the page; .gif or .mp4 for a film of drawings, by Pillow or by the program ffmpeg.

        Returns
        -------
        Page or Path
            The page, which a notebook shows in a frame; the file if `output` is given.
        """
        if output is not None and path_of(output).suffix.lower() in (".gif", ".mp4"):
            return import_module("ncgen.view.film").write_film(self, output)
        view = import_module("ncgen.view.player")
        return view.page_of(self) if output is None else view.write_player(self, path_of(output))
