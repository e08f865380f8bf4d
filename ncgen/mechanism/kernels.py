"""Kernels ready to be called: what the solver and the user hold in their hands.

`Kernels` knows the names, sizes and patterns of a mechanism; its two children evaluate the same programs
through a compiled library or through NumPy.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from copy import copy
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeAlias, TypeGuard, TypeVar, cast

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ncgen.errors import DomainError, ModelError, NcgenError, counted, shown
from ncgen.mechanism.arguments import constant, numbers
from ncgen.mechanism.kernel_batch import Batch
from ncgen.mechanism.reactive import ReactiveForce
from ncgen.mechanism.tangents import Tangents
from ncgen.model import Model
from ncgen.model.elements import Length, Point
from ncgen.model.forces import Callback
from ncgen.model.rows import Row, natural_size
from ncgen.model.values import evaluate, is_number
from ncgen.program.ir.blocks import Pattern, Program, Slot
from ncgen.program.ir.evaluate import evaluate_rows
from ncgen.program.programs import Programs
from ncgen.toolchain.preparation import preparing

if TYPE_CHECKING:
    from scipy.sparse import csr_array

FLOAT = np.dtype(float)

Found = TypeVar("Found")

Drive: TypeAlias = Callable[[Any, np.ndarray], np.ndarray]
"""(time, p) -> p with the inputs of that time."""


class Kernels(ABC):
    """The kernels of one mechanism.

    q, qd: free coordinates (m, rad) and velocities, shape (n,), in the order of `coordinates`; t: time (s)
    p: parameters (n_p,) in the order of `parameters`, of which the last ones are the `inputs`; None means their defaults
    Kernels that the mechanism does not need return zeros.
    q0, p0, row_sizes, column_sizes and holonomic are the mechanism's own; copy them to change them.
    """

    backend: str
    _batch: type[Batch]
    _tangents: type[Tangents]
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

    def __reduce__(self) -> tuple[Callable[..., Kernels], tuple[object, ...]]:
        """Pickled as programs; the library is built where they arrive, or found in the cache."""
        return _restored, (self._of, self.programs, self._drive, self.effort)

    def __copy__(self) -> Kernels:
        """Other kernels on the same library."""
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        return other

    def driven_by(self, drive: Drive | None) -> Kernels:
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

    def remember(self, what: str, key: Hashable, find: Callable[[], Found], most: int | None = None) -> Found:
        """Return a value that is computed once for a key and cached with the kernels.

        A series of runs asks for the same things again: what is compiled for a choice of coordinates, degrees of freedom.

        Parameters
        ----------
        what : str
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
        known = self._known.setdefault(what, {})
        if key not in known:
            with preparing():
                value = find()
            if most is not None and len(known) >= most:
                known.clear()
            known[key] = value
        return known[key]

    @classmethod
    @abstractmethod
    def _of(cls, programs: Programs) -> Kernels:
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
            read.update(place for slot in block.slots if isinstance(slot, Slot) and slot.array == "p" for place in slot.table)
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
        parameters = self.model.parameters
        sizes = [natural_size(row, lambda v, row=row: evaluate(v, parameters, row.label)) for row in self.rows]
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
        own = np.nan_to_num(np.diag(self.mass_matrix(self.q0)))
        points = {c.name for e in self.model.elements.values() if isinstance(e, Point) for c in e.components}
        is_point = np.array([name in points for name in self.coordinates], dtype=bool)
        masses, moments = np.max(own[is_point], initial=0.0), np.max(own[~is_point], initial=0.0)
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

    # -- kernels -------------------------------------------------------------------------------

    def phi(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate the constraint equations Φ(q, t).

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        numpy.ndarray
            Values, shape (m,).
        """
        return self.values("phi", t, q, None, p)

    def phi_q(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate the Jacobian Φ_q.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (m, n).
        """
        return self._sparse(self.phi_q_pattern, self.values("phi_q", t, q, None, p))

    def nu(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate ν = −Φ_t, so that Φ_q q̇ = ν.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        numpy.ndarray
            Values, shape (m,).
        """
        return self.values("nu", t, q, None, p)

    def gamma(self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate γ, so that Φ_q q̈ = γ.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        numpy.ndarray
            Values, shape (m,).
        """
        return self.values("gamma", t, q, qd, p)

    def constraints(
        self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None
    ) -> tuple[np.ndarray, csr_array, np.ndarray]:
        """Evaluate Φ, Φ_q and γ in one call.

        This is faster than three calls, since they have much in common.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        tuple
            Values Φ (m,), matrix Φ_q (m, n), sparse, and γ (m,).
        """
        if "constraints" not in self.programs.programs:  # no row has a coordinate in it, or they are long (MOST_FUSED)
            return self.phi(q, t, p), self.phi_q(q, t, p), self.gamma(q, qd, t, p)
        values = self.values("constraints", t, q, qd, p)
        phi_q = self._sparse(self.phi_q_pattern, values[self.m : len(values) - self.m])
        return values[: self.m], phi_q, values[len(values) - self.m :]

    def mass(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate the mass matrix M.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (n, n), symmetric and positive semidefinite.
        """
        return self._sparse(self.mass_pattern, self.values("mass", t, q, None, p))

    def force(self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate the generalised forces Q.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        numpy.ndarray
            Applied forces and velocity-dependent inertia, shape (n,).
        """
        force = self.values("force", t, q, qd, p)
        return force + self._finite_external(t, q, qd, p) if self.model.callbacks else force

    def energy(self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate energies and the power of forces without a potential.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        numpy.ndarray
            Kinetic and potential energy (J) and power (W), shape (3,).
        """
        energy = self.values("energy", t, q, qd, p)
        if self.model.callbacks:
            energy[..., 2] += self._finite_external(t, q, qd, p) @ qd
        return energy

    def energies(self, q: np.ndarray, qd: np.ndarray, t: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Evaluate `energy` at many times.

        Parameters
        ----------
        q : numpy.ndarray
            Positions, shape (K, n).
        qd : numpy.ndarray
            Velocities, shape (K, n).
        t : numpy.ndarray
            Times (s), shape (K,).
        p : numpy.ndarray
            Parameters, shape (n_p,), the same at all times.

        Returns
        -------
        numpy.ndarray
            Energies, shape (K, 3).
        """
        program, instants = self.programs.programs.get("energy"), zip(q, qd, t, strict=True)
        if self._drive is not None or self.model.callbacks or program is None or "qd" not in program.inputs:
            return np.array([self.energy(*instant, p) for instant in instants])
        return np.array([self._call("energy", s, x, v, p, program.size) for x, v, s in instants])

    def external_force(self, t: ArrayLike, q: ArrayLike, qd: ArrayLike, p: np.ndarray) -> np.ndarray:
        """Evaluate the forces of the model's Python functions.

        Parameters
        ----------
        t : array_like
            Time (s).
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        p : numpy.ndarray
            Parameters with the inputs at t, shape (n_p,).

        Returns
        -------
        numpy.ndarray
            Generalised forces, shape (n,), finite or not.

        Raises
        ------
        ModelError
            If a function returns anything but forces; the message names it.
        """
        total, shape = None, (self.n,)
        for function in self.model.callbacks:
            is_compiled = isinstance(function, ReactiveForce)
            value = function.at(cast("float", t), np.asarray(q), np.asarray(qd), p) if is_compiled else function(t, q, qd, self)
            force = np.asarray(value, dtype=float)
            if force.shape != shape:
                raise ModelError(self._refused(function, t))
            total = force if total is None else total + force
        return np.zeros(shape) if total is None else total

    def _finite_external(self, t: ArrayLike, q: ArrayLike, qd: ArrayLike, p: ArrayLike | None) -> np.ndarray:
        """The same; DomainError naming a function that returns NaN or an infinite number."""
        total = self.external_force(t, q, qd, self.present(cast("float", t), self.p0 if p is None else np.asarray(p)))
        if not np.all(np.isfinite(total)):
            culprit = next((f for f in self.model.callbacks if not np.all(np.isfinite(f(t, q, qd, self)))), self.model.callbacks[0])
            raise DomainError(self._refused(culprit, t))
        return total

    def _refused(self, function: Callback, t: ArrayLike) -> str:
        name = getattr(function, "__name__", "callback")
        return f"callback {name}: it must return {self.n} finite numbers, one a free coordinate, at t = {t:g}"

    # -- many states ---------------------------------------------------------------------------

    @cached_property
    def batch(self) -> Batch:
        """The kernels of many states in one call; compiled when first asked for (ncgen.mechanism.kernel_batch)."""
        return self._batch(self)

    # -- tangents ------------------------------------------------------------------------------

    @cached_property
    def tangents(self) -> Tangents:
        """The tangent kernels, generated and compiled when first asked for (ncgen.program.differentiation.tangent_programs)."""
        return self._tangents.by_state(self.programs)

    @cached_property
    def parameter_tangents(self) -> Tangents:
        """Derivatives by the parameters, generated and compiled when first asked for."""
        return self._tangents.by_parameters(self.programs)

    def stiffness(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, lam: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None
    ) -> csr_array:
        """Evaluate ∂(M q̈ + Φ_qᵀ λ − Q)/∂q.

        Forces of Python functions are not included.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        qdd : array_like
            Acceleration, shape (n,).
        lam : array_like
            Lagrange multipliers, shape (m,).
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (n, n).
        """
        return self._tangent("stiffness", t=t, q=q, qd=qd, qdd=qdd, lam=lam, p=p)

    def damping(self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate −∂Q/∂q̇.

        Forces of Python functions are not included.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (n, n).
        """
        return self._tangent("damping", t=t, q=q, qd=qd, p=p)

    def phidd_q(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate ∂(Φ_q q̈ − γ)/∂q.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        qdd : array_like
            Acceleration, shape (n,).
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (m, n).
        """
        return self._tangent("phidd_q", t=t, q=q, qd=qd, qdd=qdd, p=p)

    def phidd_qd(self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate −∂γ/∂q̇.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (m, n).
        """
        return self._tangent("phidd_qd", t=t, q=q, qd=qd, p=p)

    def phi_p(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate ∂Φ/∂p.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (m, n_p).
        """
        return self._tangent("phi_p", t=t, q=q, p=p)

    def phid_p(self, q: ArrayLike, qd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate ∂(Φ_q q̇ − ν)/∂p.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (m, n_p).
        """
        return self._tangent("phid_p", t=t, q=q, qd=qd, p=p)

    def phidd_p(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> csr_array:
        """Evaluate ∂(Φ_q q̈ − γ)/∂p.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        qdd : array_like
            Acceleration, shape (n,).
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (m, n_p).
        """
        return self._tangent("phidd_p", t=t, q=q, qd=qd, qdd=qdd, p=p)

    def balance_p(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, lam: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None
    ) -> csr_array:
        """Evaluate ∂(M q̈ + Φ_qᵀ λ − Q)/∂p.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        qdd : array_like
            Acceleration, shape (n,).
        lam : array_like
            Lagrange multipliers, shape (m,).
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        scipy.sparse.csr_array
            Matrix, shape (n, n_p).
        """
        return self._tangent("balance_p", t=t, q=q, qd=qd, qdd=qdd, lam=lam, p=p)

    def dense_tangent(self, name: str, **given: ArrayLike | None) -> np.ndarray:
        """Evaluate a tangent kernel as a dense array.

        For small mechanisms this is faster than the sparse matrix.

        Parameters
        ----------
        name : str
            One of stiffness, damping, phidd_q, phidd_qd, phi_p, phid_p, phidd_p and balance_p.
        **given : array_like
            Arguments of that kernel by name: t, q, qd, qdd, lam, p.

        Returns
        -------
        numpy.ndarray
            The matrix.
        """
        return self._dense(*self._tangent_values(name, given))

    def dense_tangents(self, name: str, q: np.ndarray, t: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Evaluate a tangent kernel of positions at a few states.

        Parameters
        ----------
        name : str
            Name of a kernel that takes no more than q, t and p, such as phi_p.
        q : numpy.ndarray
            Positions, shape (K, n).
        t : numpy.ndarray
            Times (s), shape (K,).
        p : numpy.ndarray
            Parameters, shape (n_p,).

        Returns
        -------
        numpy.ndarray
            Matrices, shape (K, rows, columns).
        """
        rows = [self._tangent_values(name, {"q": at, "t": now, "p": p}) for at, now in zip(q, t.tolist(), strict=True)]
        return self._dense(rows[0][0], np.array([values for _, values in rows]))

    def _tangent(self, name: str, **given: ArrayLike | None) -> csr_array:
        return self._sparse(*self._tangent_values(name, given))

    def _tangent_values(self, name: str, given: dict[str, Any]) -> tuple[Pattern, np.ndarray]:
        sizes = {"q": self.n, "qd": self.n, "qdd": self.n, "lam": self.m, "p": len(self.p0)}
        given["p"] = self.p0 if given["p"] is None else given["p"]
        if not isinstance(given.get("t", 0.0), float):
            given["t"] = self._instant(given["t"], name)
        for array, size in sizes.items():
            if array in given and not _is_plain(given[array], size):
                given[array] = self._checked(given[array], size, name, array, "of them")
        if self._drive is not None:
            given["p"] = self._drive(given["t"], given["p"])
        tangents = self.parameter_tangents if name.endswith("_p") else self.tangents
        return tangents.programs.patterns[name], tangents.values(name, given)

    def jacobian(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate Φ_q as a dense array, for linear algebra on small mechanisms.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        numpy.ndarray
            Matrix, shape (m, n).
        """
        return self._dense(self.phi_q_pattern, self.values("phi_q", t, q, None, p))

    def jacobians(self, q: np.ndarray, t: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Evaluate Φ_q at a few states, without compiling anything for it.

        Parameters
        ----------
        q : numpy.ndarray
            Positions, shape (K, n).
        t : numpy.ndarray
            Times (s), shape (K,).
        p : numpy.ndarray
            Parameters, shape (n_p,).

        Returns
        -------
        numpy.ndarray
            Matrices, shape (K, m, n).
        """
        rows = [self.values("phi_q", now, at, None, p) for at, now in zip(q, t.tolist(), strict=True)]
        return self._dense(self.phi_q_pattern, np.array(rows))

    def dense_jacobians(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate Φ_q at many states.

        Parameters
        ----------
        q : array_like
            Positions, shape (B, n).
        t : array_like, optional
            Time (s), or times, shape (B,).
        p : array_like, optional
            Parameters, shape (n_p,) or (B, n_p); None for the defaults.

        Returns
        -------
        numpy.ndarray
            Matrices, shape (B, m, n).
        """
        return self._dense(self.phi_q_pattern, self.batch.phi_q(q, t, p))

    def mass_matrix(self, q: ArrayLike, t: ArrayLike = 0.0, p: ArrayLike | None = None) -> np.ndarray:
        """Evaluate M as a dense array.

        Parameters
        ----------
        q : array_like
            Position, shape (n,), in m and rad.
        t : array_like, optional
            Time (s).
        p : array_like, optional
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        numpy.ndarray
            Matrix, shape (n, n).
        """
        return self._dense(self.mass_pattern, self.values("mass", t, q, None, p))

    def values(self, kernel: str, t: ArrayLike, q: ArrayLike, qd: ArrayLike | None, p: ArrayLike | None) -> np.ndarray:
        """Evaluate a kernel without giving its output a shape.

        Parameters
        ----------
        kernel : str
            Name of the kernel, such as phi_q.
        t : array_like
            Time (s).
        q : array_like
            Position, shape (n,), in m and rad.
        qd : array_like
            Velocity, shape (n,).
        p : array_like
            Parameters, shape (n_p,); None for the defaults.

        Returns
        -------
        numpy.ndarray
            The output; of matrices their nonzeros.
        """
        program = self.programs.programs.get(kernel)
        n, reads_qd = len(self.coordinates), program is not None and "qd" in program.inputs
        if not _is_plain(q, n):
            q = self._checked(q, n, kernel, "q", "free coordinates")
        if not _is_plain(qd, n) and (reads_qd or qd is not None):
            qd = self._checked(qd, n, kernel, "qd", "free coordinates")
        if p is None:
            p = self.p0
        elif not _is_plain(p, len(self.p0)):
            p = self._checked(p, len(self.p0), kernel, "p", "parameters")
        if not isinstance(t, float):
            t = self._instant(t, kernel)
        if program is None:
            size = {"force": self.n, "energy": 3, "mass": 0, "phi_q": 0}.get(kernel, self.m)
            return np.zeros((*q.shape[:-1], size))
        qd = qd if reads_qd else None
        if self._drive is not None:
            p = self._drive(t, p)
        return self._call(kernel, t, q, qd, p, program.size)

    @abstractmethod
    def _call(self, kernel: str, t: ArrayLike, q: np.ndarray, qd: np.ndarray | None, p: np.ndarray, size: int) -> np.ndarray:
        """The output of a kernel, `size` numbers a state, for arguments that were looked at."""

    def _checked(self, array: ArrayLike | None, size: int, kernel: str, name: str, what: str) -> np.ndarray:
        array = numbers(array, f"{self.name}.{kernel}: {name}", complex_too=self.batches)
        if not self.batches and array.ndim > 1 and array.shape[-1] == size:
            raise NcgenError(
                f"{self.name}.{kernel}: {name} is a batch; compiled kernels take one state, kernels.batch takes many, and so does "
                "backend='numpy'"
            )
        if array.shape[-1:] != (size,):
            raise NcgenError(f"{self.name}.{kernel}: {name} has shape {array.shape}; the model has {size} {what}")
        return array

    def _instant(self, t: ArrayLike, kernel: str) -> float | complex | np.ndarray:
        """A time, or many for kernels that take batches. Raises NcgenError for others."""
        try:
            value = numbers(t, f"{self.name}.{kernel}: t", complex_too=self.batches)
        except NcgenError:
            value = None
        if value is None or (value.ndim and not self.batches):
            wanted = "numbers are needed" if self.batches else "compiled kernels take one real number"
            raise NcgenError(f"{self.name}.{kernel}: t is {shown(t)}; {wanted}")
        return value if value.ndim else value.item()

    @staticmethod
    def _sparse(pattern: Pattern, values: np.ndarray) -> csr_array:
        """Raises NcgenError for many states, which have no sparse matrix in common."""
        if values.ndim != 1:
            raise NcgenError("a batch has no sparse matrix; take kernels.batch for nonzeros, kernels.jacobian or kernels.mass_matrix")
        return scipy.sparse.csr_array((values, pattern.indices, pattern.indptr), shape=pattern.shape)

    @staticmethod
    def _dense(pattern: Pattern, values: np.ndarray) -> np.ndarray:
        dense = np.zeros((*np.shape(values)[:-1], pattern.shape[0] * pattern.shape[1]), dtype=values.dtype)
        dense[..., pattern.flat] = values
        return dense.reshape(*np.shape(values)[:-1], *pattern.shape)


def _restored(of: Callable[[Programs], Kernels], programs: Programs, drive: Drive | None, effort: str) -> Kernels:
    """Kernels as they were before they were pickled."""
    kernels = of(programs)
    kernels.effort = effort
    return kernels if drive is None else kernels.driven_by(drive)


def _is_plain(array: object, size: int) -> TypeGuard[np.ndarray]:
    """True for what needs no look: a real vector of the right length. Most calls are of this kind, and looking costs time."""
    return type(array) is np.ndarray and array.dtype is FLOAT and array.shape == (size,)
