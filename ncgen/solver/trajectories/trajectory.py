"""A trajectory: what a simulation found, with names and units."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, overload

import numpy as np

from ncgen.errors import ModelError, NcgenError, counted
from ncgen.files import output_was, path_of, write_bytes, write_text
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.table import FORMALISMS, Formalism
from ncgen.model.elements import Element, Point, Vector, coordinate_of
from ncgen.solver import frames, geometry
from ncgen.solver.formalisms import accelerations_of
from ncgen.solver.formalisms.coordinate_partitioning import Motion, motion_at
from ncgen.solver.formalisms.impulse import Impulse
from ncgen.solver.given import echo, offer
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.positions.partition import Partitions, choose_partitions, determined, other_partitions, quality
from ncgen.solver.trajectories.energy import drift, energies
from ncgen.solver.trajectories.happening import Happening
from ncgen.solver.trajectories.output_values import outputs_of, uses_accelerations, uses_loads

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from scipy.spatial.transform import Rotation

    from ncgen.model import Model
    from ncgen.solver.events.modes import Mode
    from ncgen.solver.loads.reactions import Reactions
    from ncgen.solver.trajectories.difference import Difference

CONDITION = 1e-3
"""Quality of a partition below which accelerations are computed with a better one."""


class PageLike(Protocol):
    """A page that `ncgen.view.page` makes: a notebook shows it, `save` writes it into a file."""

    text: str

    def _repr_html_(self) -> str: ...

    def save(self, output: str | os.PathLike[str]) -> Path: ...


@dataclass(frozen=True, kw_only=True)
class Statistics:
    """What a simulation cost.

    steps, evaluations of the state derivative, Newton steps of position problems and projections, changes of the
    independent coordinates, steps repeated because the position problem failed, and seconds of the run; how often a state was
    projected onto the constraints, and how far a position was moved at most, relative to its natural size. Of implicit
    methods how many Jacobians were taken; of emitted ones how many accelerations were computed with row exchanges, since
    a pivot vanished, a step had to be repeated, or Newton's steps in the degrees of freedom did not converge.
    preparation: seconds for generating and compiling what the run needed first; a second run of the kernels needs none.
    """

    steps: int
    evaluations: int
    newton_steps: int
    partition_changes: int
    repeated_steps: int
    seconds: float
    projections: int = 0
    largest_projection: float = 0.0
    jacobians: int = 0
    fallbacks: int = 0
    preparation: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Trajectory:
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

    kernels: Kernels
    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    work: np.ndarray
    p: np.ndarray
    partitions: Partitions | None
    statistics: Statistics
    formalism: str
    integrator: str
    engine: str = "python"
    chosen: tuple[str, ...] = ()
    moved_by: Kernels | None = None
    options: dict[str, Any] = field(default_factory=dict)
    stopped: bool = False
    number: str = "double"
    made_with: str = ""
    impulses: tuple[Impulse, ...] = ()
    events: tuple[Happening, ...] = ()
    modes: tuple[Mode, ...] = ()
    changed: bool = False
    own: Formalism | None = None

    def __repr__(self) -> str:
        grid = f"{len(self.t)} instants from {self.t[0]:g} to {self.t[-1]:g} s" if len(self.t) else "no instant"
        return f"<Trajectory {self.name}: {grid}, {counted(len(self), 'coordinate')}, {self.formalism}, {self.integrator}>"

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        return import_module("ncgen.report.cards").of_trajectory(self)

    @property
    def independent(self) -> tuple[str, ...]:
        """Names of the independent coordinates: those that were chosen, else those at the end of the run."""
        partitions = self.partitions or choose_partitions(self.kernels, self.q[-1], self.t[-1], self.p)
        used = partitions.position.names(self.kernels)
        return self.chosen if len(self.chosen) == len(used) else used

    @cached_property
    def _motions(self) -> list[Motion]:
        """Every instant once more with accelerations and multipliers."""
        instants = zip(self.t, self.q, self.qd, strict=True)
        return [self._motion(*instant) for instant in instants]

    def _motion(self, t: float, q: np.ndarray, qd: np.ndarray) -> Motion:
        kernels = self.moved_by or self.kernels
        for mode in self.modes:
            if mode.t <= t:
                kernels = mode.kernels
        p = refresh_branches(kernels, q, self.p)
        formalism = self.own or FORMALISMS[self.formalism]
        if formalism.is_constrained:
            return accelerations_of(formalism).motion(kernels, q, qd, t, p, self.options)
        present = determined(self.partitions)
        part = present.velocity
        if quality(kernels, part, q, t, p) < CONDITION:
            part = other_partitions(kernels, present, q, t, p).velocity
        return motion_at(kernels, part, t, q, qd[part.independent], p)

    @cached_property
    def qdd(self) -> np.ndarray:
        """Accelerations (K, n)."""
        return np.array([m.qdd for m in self._motions])

    @cached_property
    def lam(self) -> np.ndarray:
        """Multipliers of the rows (K, m)."""
        return np.array([m.lam[: self.kernels.m] for m in self._motions])

    @property
    def model(self) -> Model:
        """Return the model.

        Returns
        -------
        Model
            The model of the kernels.
        """
        return self.kernels.model

    @property
    def name(self) -> str:
        """Return the name of the model.

        Returns
        -------
        str
            The name.
        """
        return self.kernels.name

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Return the names of the free coordinates.

        Returns
        -------
        tuple of str
            The names, in the order of q.
        """
        return self.kernels.coordinates

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
        if isinstance(thing := self.model.elements.get(inner), (Point, Vector)):
            kind = type(thing).__name__.lower()
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

    def point(self, name: str) -> np.ndarray:
        """Return the positions of a point.

        Parameters
        ----------
        name : str
            Name of a point.

        Returns
        -------
        numpy.ndarray
            Global coordinates (m), shape (K, 3).

        Raises
        ------
        ModelError
            If there is no such point.
        """
        return geometry.element(self.kernels, self._named(name, Point), self.q, self.p)

    def vector(self, name: str) -> np.ndarray:
        """Return the components of a unit vector.

        Parameters
        ----------
        name : str
            Name of a vector.

        Returns
        -------
        numpy.ndarray
            Global components, shape (K, 3).

        Raises
        ------
        ModelError
            If there is no such vector.
        """
        return geometry.element(self.kernels, self._named(name, Vector), self.q, self.p)

    def velocity(self, name: str) -> np.ndarray:
        """Return the velocity of a point, or the rate of a unit vector.

        Parameters
        ----------
        name : str
            Name of a point or of a vector.

        Returns
        -------
        numpy.ndarray
            Global components (m/s, or 1/s), shape (K, 3).

        Raises
        ------
        ModelError
            If the model has no such point or vector.
        """
        return geometry.element_rate(self.kernels, self._named(name, Point, Vector), self.qd)

    def acceleration(self, name: str) -> np.ndarray:
        """Return the acceleration of a point, or the second derivative of a unit vector.

        Parameters
        ----------
        name : str
            Name of a point or of a vector.

        Returns
        -------
        numpy.ndarray
            Global components (m/s², or 1/s²), shape (K, 3).

        Raises
        ------
        ModelError
            If the model has no such point or vector.
        """
        return geometry.element_rate(self.kernels, self._named(name, Point, Vector), self.qdd)

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
        try:
            pandas = import_module("pandas")
        except ImportError as error:
            raise NcgenError("pandas is not installed; pip install 'ncgen[tables]', or take run.table()") from error
        return pandas.DataFrame(self.table()).set_index("t")

    def _named(self, name: str, *kinds: type[Element]) -> Element:
        known = {e.name: e for e in self.model.elements.values() if isinstance(e, kinds)}
        if name not in known:
            kind = " or ".join(kind.__name__.lower() for kind in kinds)
            raise ModelError(f"{self.name} has no {kind} {echo(name)}; {offer(name, tuple(known))}")
        return known[name]

    def rotation(self, body: str) -> Rotation:
        """Return the orientation of a body relative to the initial position.

        Euler angles, Bryant angles and Euler parameters (the paper's eqs 1-5) are its views: `.as_euler("ZXZ")`, `.as_euler("XYZ")`,
        `.as_quat(scalar_first=True)`.

        Parameters
        ----------
        body : str
            Name of a body.

        Returns
        -------
        scipy.spatial.transform.Rotation
            Rotations at K times.
        """
        return frames.rotation(self.kernels, body, self.q, self.p)

    def angular_velocity(self, body: str) -> np.ndarray:
        """Return the angular velocity of a body.

        Parameters
        ----------
        body : str
            Name of a body.

        Returns
        -------
        numpy.ndarray
            Global components (rad/s), shape (K, 3).
        """
        return frames.angular_velocity(self.kernels, body, self.q, self.qd, self.p)

    def energy(self) -> np.ndarray:
        """Return energies and the power of forces without a potential.

        Returns
        -------
        numpy.ndarray
            Kinetic and potential energy (J) and power (W), shape (K, 3).
        """
        return energies(self.kernels, self.t, self.q, self.qd, self.p)

    @cached_property
    def energy_drift(self) -> float:
        """The largest |T + V − W − its start|, relative to the energy that moves (largest T or change of V); 0 where it is rounding."""
        return drift(self.kernels, self.t, self.q, self.qd, self.work, self.p)

    def thinned(self, count: int) -> Trajectory:
        """Return the same motion at fewer times.

        Parameters
        ----------
        count : int
            How many times to keep.

        Returns
        -------
        Trajectory
            The motion at `count` of its times, or at all if it has fewer.
        """
        kept = np.unique(np.linspace(0, len(self.t) - 1, count).round().astype(int))
        return replace(self, t=self.t[kept], q=self.q[kept], qd=self.qd[kept], work=self.work[kept])

    def violation(self) -> np.ndarray:
        """Return the largest constraint violation at every time.

        Of an angle in the paper's form only the equation that is in force counts.

        Returns
        -------
        numpy.ndarray
            Largest |Φ| relative to the natural sizes of the constraints, shape (K,).
        """
        from ncgen.solver.positions.branches import refresh_branches
        from ncgen.solver.positions.position import residual

        return np.array(
            [residual(self.kernels, q, t, refresh_branches(self.kernels, q, self.p)) for t, q in zip(self.t, self.q, strict=True)]
        )

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

    @output_was("path")
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

    @output_was("path")
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
        from ncgen.solver.trajectories.trajectory_files import histories

        columns = histories(self)
        lines = [",".join(map(_cell, columns))] + [",".join(map(repr, row)) for row in np.column_stack([*columns.values()]).tolist()]
        return write_text(path_of(output), "\n".join(lines) + "\n")

    @output_was("path")
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

    @output_was("path")
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

    @output_was("path")
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


def _cell(label: str) -> str:
    """A label as a cell of a table: in quotes where a comma or a quote would end it."""
    return '"' + label.replace('"', '""') + '"' if set(label) & set(',"') else label
