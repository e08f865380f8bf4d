"""What is known of a mechanism whose kernels are called: names, natural sizes, its initial position, and what was computed before."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from copy import copy
from functools import cached_property
from importlib import import_module
from typing import Any, Self, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import NcgenError, counted
from ncgen.mechanism.arguments import constant, numbers
from ncgen.model import Model
from ncgen.model.elements import Length, Point
from ncgen.model.rows import Row, natural_size
from ncgen.model.values import evaluate, is_number
from ncgen.program.ir.blocks import Program, Slot
from ncgen.program.ir.evaluate import evaluate_rows
from ncgen.program.programs import Programs
from ncgen.toolchain.preparation import preparing

Found = TypeVar("Found")

_UNKNOWN: Any = object()
"""In place of a value that is not cached."""

Drive: TypeAlias = Callable[[Any, np.ndarray], np.ndarray]
"""(time, p) -> p with the inputs of that time."""


class KernelData(ABC):
    """Names, natural sizes and initial position of one mechanism, and a memory of what was computed for it."""

    backend: str
    _drive: Drive | None = None
    effort = "auto"
    """How much is written out for a run: "auto", what is compiled within some seconds, or "most", as `ncgen.compile` has it."""
    batches = False
    """True if leading axes and complex numbers are allowed."""

    def __init__(self, programs: Programs) -> None:
        self.programs = programs
        self.model: Model = programs.equations.model
        self.name = self.model.name
        self.coordinates: tuple[str, ...] = tuple(c.name for c in programs.equations.free)
        self.index = {name: i for i, name in enumerate(self.coordinates)}
        """{coordinate name: position in q}."""
        self.rows: tuple[Row, ...] = tuple(self.model.rows)
        self.parameters: tuple[str, ...] = tuple(self.model.numbers)
        self.inputs: tuple[str, ...] = tuple(self.model.inputs)
        self.q0 = constant(np.array([c.initial for c in programs.equations.free]))
        self.p0 = constant(np.array([number.default for number in self.model.numbers.values()], dtype=float))
        self.phi_q_pattern = programs.phi_q
        self.mass_pattern = programs.mass
        self._known: dict[str, dict[Hashable, Any]] = {}

    def __setattr__(self, name: str, value: object) -> None:
        """Members stay what they are: C reads as many numbers as there were."""
        if name in self.__dict__ and not name.startswith("_"):
            remedy = "change the model and compile it, or give q0 and p to each call"
            raise NcgenError(f"{self.name}: kernels.{name} cannot be replaced; {remedy}")
        super().__setattr__(name, value)

    def __repr__(self) -> str:
        return f"<Kernels {self.name}: {counted(self.n, 'coordinate')}, {counted(self.m, 'row')}, {self.backend}>"

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        return import_module("ncgen.report.cards").of_kernels(self)

    def __reduce__(self) -> tuple[Callable[..., KernelData], tuple[object, ...]]:
        """Pickled as programs; the library is built where they arrive, or found in the cache."""
        return _restored, (self._of, self.programs, self._drive, self.effort)

    def __copy__(self) -> Self:
        """Other kernels on the same library."""
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        return other

    def driven_by(self, drive: Drive | None) -> Self:
        """Return kernels on the same library that read their inputs from a function of time.

        Parameters
        ----------
        drive : callable or None
            Function of t (s) and p (n_p,) that puts the inputs into p; None for kernels that read their inputs from p.

        Returns
        -------
        Kernels
            The other kernels.
        """
        if drive is self._drive:
            return self
        other = copy(self)
        other._drive = drive
        return other

    def present(self, t: float, p: np.ndarray) -> np.ndarray:
        """Return the parameters with the inputs at a time.

        Parameters
        ----------
        t : float
            Time (s).
        p : numpy.ndarray
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        numpy.ndarray
            Parameters, shape (n_p,).
        """
        return p if self._drive is None else self._drive(t, p)

    @property
    def computed_by(self) -> str:
        """What tells kernels of the same programs apart that may round otherwise."""
        return self.backend

    def remember(self, kind: str, key: Hashable, find: Callable[[], Found], most: int | None = None) -> Found:
        """Return a value that is computed once for a key and cached with the kernels.

        A series of runs asks for the same things again: what is compiled for a choice of coordinates, degrees of freedom.

        Parameters
        ----------
        kind : str
            Name of the kind of value.
        key : hashable
            Distinguishes values of this kind.
        find : callable
            Computes the value.
        most : int, optional
            How many keys are cached; None for all. When there are more, all are dropped.

        Returns
        -------
        object
            The value.
        """
        known = self._known.get(kind)
        if known is None:
            known = self._known.setdefault(kind, {})
        value = known.get(key, _UNKNOWN)
        if value is _UNKNOWN:
            with preparing():
                value = find()
            if most is not None and len(known) >= most:
                known.clear()
            known[key] = value
        return value

    @classmethod
    @abstractmethod
    def _of(cls, programs: Programs) -> Self:
        """Kernels of programs."""

    def of_rows(self, p: np.ndarray) -> np.ndarray:
        """Return those parameters that Φ, Φ_q and ν read.

        Parameters
        ----------
        p : numpy.ndarray
            Parameters, shape (n_p,).

        Returns
        -------
        numpy.ndarray
            The parameters of the constraints; masses do not belong to them.
        """
        return p[self._read_by_rows]

    @cached_property
    def _read_by_rows(self) -> np.ndarray:
        """Positions in p."""
        read: set[int] = set()
        for block in (b for name in ("phi", "phi_q", "nu") if name in self.programs.programs for b in self.programs.programs[name].blocks):
            read.update(op.input.position for op in block.ops if op.code == "load" and op.input.array == "p")
            read.update(position for slot in block.slots if isinstance(slot, Slot) and slot.array == "p" for position in slot.table)
        return np.array(sorted(read), dtype=int)

    @property
    def n(self) -> int:
        """Number of free coordinates."""
        return len(self.coordinates)

    @property
    def m(self) -> int:
        """Number of constraint rows."""
        return len(self.rows)

    @cached_property
    def row_sizes(self) -> np.ndarray:
        """Natural size of every row: a residual divided by it is a relative one.

        A row given as an expression has the size of what it changes by when the coordinates move by their own sizes.
        """
        parameters, extent = self.model.parameters, self.length
        sizes = [natural_size(row, lambda v, row=row: evaluate(v, parameters, row.label), extent) for row in self.rows]
        changes = self._row_changes() if None in sizes else sizes
        return constant(np.array([change if size is None else size for size, change in zip(sizes, changes, strict=True)]))

    def _row_changes(self) -> list[float]:
        """The norm of every row's gradient, coordinates measured in their sizes: at the start or a tenth of the mechanism away, where it is
        larger, since it may vanish at the start; 1 where it vanishes at both. Three digits, so that all machines agree."""
        change = 0.1 * self.column_sizes * np.cos(np.arange(self.n))
        with np.errstate(all="ignore"):
            norms = [np.linalg.norm(self.jacobian(q, 0.0, self.p0) * self.column_sizes, axis=1) for q in (self.q0, self.q0 + change)]
        largest = np.max(np.where(np.isfinite(norms), norms, 0.0), axis=0)
        return [float(f"{norm:.3g}") or 1.0 for norm in largest]

    @cached_property
    def column_sizes(self) -> np.ndarray:
        """Natural size of every coordinate: the mechanism's length for points and lengths, 1 for vectors and angles."""
        lengths = {c.name for e in self.model.elements.values() if isinstance(e, (Point, Length)) for c in e.components}
        return constant(np.array([self.length if name in lengths else 1.0 for name in self.coordinates]))

    @cached_property
    def holonomic(self) -> np.ndarray:
        """Rows that are equations of position; the others (rolling) constrain velocities only."""
        return constant(np.array([i for i, row in enumerate(self.rows) if row.level == "position"], dtype=int))

    @cached_property
    def length(self) -> float:
        """The extent of the mechanism (m) in its initial position; of a single point how far the body about it reaches, else 1."""
        points = [e.initial for e in self.model.elements.values() if isinstance(e, Point)]
        return (float(np.max(np.ptp(points, axis=0))) or self._gyration()) if points else 1.0

    def _gyration(self) -> float:
        """The root of the largest inertia of a vector (kg m²) over the largest of a point (kg); 1 where either has none. Three digits, so
        that all machines agree."""
        diagonal = np.nan_to_num(np.diag(self.mass_matrix(self.q0)))
        points = {c.name for e in self.model.elements.values() if isinstance(e, Point) for c in e.components}
        is_point = np.array([name in points for name in self.coordinates], dtype=bool)
        masses, moments = np.max(diagonal[is_point], initial=0.0), np.max(diagonal[~is_point], initial=0.0)
        return float(f"{np.sqrt(moments) / np.sqrt(masses):.3g}") if masses > 0 and moments > 0 else 1.0

    # -- the initial position ------------------------------------------------------------------

    def start(self, p: ArrayLike | None = None) -> np.ndarray:
        """Compute the initial position.

        Parameters
        ----------
        p : array_like, optional
            Parameters, shape (…, n_p); None for the defaults.

        Returns
        -------
        numpy.ndarray
            Positions, shape (…, n): `q0` where positions have no parameters.
        """
        if p is None:
            return self.q0.copy()
        p = self._start_parameters(p, "start")
        if not self._has_moving_start:
            return self.q0.copy() if p.ndim == 1 else np.array(np.broadcast_to(self.q0, (*p.shape[:-1], self.n)))
        return self._run_start(0, p, (self.n,))

    def start_p(self, p: ArrayLike | None = None) -> np.ndarray:
        """Compute the derivative of the initial position with respect to the parameters.

        Parameters
        ----------
        p : array_like, optional
            Parameters, shape (…, n_p); None for the defaults.

        Returns
        -------
        numpy.ndarray
            Derivatives, shape (…, n, n_p).
        """
        p, shape = self.p0 if p is None else self._start_parameters(p, "start_p"), (self.n, len(self.p0))
        return self._run_start(1, p, shape) if self._has_moving_start else np.zeros((*p.shape[:-1], *shape))

    def _start_parameters(self, p: ArrayLike, program: str) -> np.ndarray:
        """Parameters (…, n_p), real or complex. Raises NcgenError for others."""
        p = numbers(p, f"{self.name}.{program}: p", complex_too=True)
        if p.shape[-1:] != (len(self.p0),):
            raise NcgenError(f"{self.name}.{program}: p has shape {p.shape}; the model has {counted(len(self.p0), 'parameter')}")
        return p

    @cached_property
    def _has_moving_start(self) -> bool:
        return not all(is_number(c.value) for c in self.programs.equations.free)

    @cached_property
    def _start_programs(self) -> tuple[Program, Program]:
        from ncgen.program.initial import assemble_start

        return assemble_start(self.programs.equations)

    def _run_start(self, which: int, p: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        """One of the two programs on whole columns of parameters."""
        program = self._start_programs[which]
        return evaluate_rows(program, p).reshape(*p.shape[:-1], *shape)

    @abstractmethod
    def jacobian(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray: ...

    @abstractmethod
    def mass_matrix(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray: ...


def _restored(of: Callable[[Programs], KernelData], programs: Programs, drive: Drive | None, effort: str) -> KernelData:
    """Kernels as they were before they were pickled."""
    kernels = of(programs)
    kernels.effort = effort
    return kernels if drive is None else kernels.driven_by(drive)
