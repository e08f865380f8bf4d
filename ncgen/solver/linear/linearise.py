"""Small motions near a motion: the state matrix on independent coordinates, its eigenvalues and mode shapes; what inputs do to them and
outputs see of them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ncgen.emit.c.linear import linear_header
from ncgen.errors import ModelError, counted, warn
from ncgen.files import argument_was, path_of, write_text
from ncgen.mechanism.kernels import Kernels
from ncgen.model.elements import rate_name
from ncgen.solver.argument_checks import checked_kernels, known_name, refuse_callbacks, refuse_sticking, several
from ncgen.solver.finite import watched
from ncgen.solver.formalisms.coordinate_partitioning import Motion, motion_at
from ncgen.solver.formalisms.dynamics_jacobian import (
    acceleration_changes,
    independent_motions,
    input_accelerations,
    multiplier_changes,
    partitioned_jacobian,
)
from ncgen.solver.groups import StartArguments, takes
from ncgen.solver.linear.poles import Pole, poles_of, response_of, zeros_of
from ncgen.solver.linear.steady import drift
from ncgen.solver.positions.partition import Partition, Partitions, choose_partitions
from ncgen.solver.positions.position import solve_position
from ncgen.solver.runs.run import Initial
from ncgen.solver.runs.signals import signals_of
from ncgen.solver.runs.start import given_velocity, independent_rates
from ncgen.solver.trajectories.output_values import output_slopes, uses_loads

if TYPE_CHECKING:
    from scipy.signal import StateSpace

ZERO = 1e-6
"""Eigenvalues below this, relative to the mechanism's rates, are zeros: places, headings and speeds that nothing holds."""

UNSTEADY = (
    "the motion is neither rest in equilibrium nor steady, so the matrix is that of one instant, and its eigenvalues depend on the "
    "independent coordinates and say nothing about stability"
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Linearisation:
    """ẋ = A x + B δu, δy = C x + D δu for x = [δz; δż], near a position and velocity.

    matrix: A (positions + velocities)²; positions, velocities: names of the independent coordinates and velocities
    B, C, D: by the model's inputs u and its outputs y, whose names are `inputs` and `outputs`
    shapes: δq = shapes δx (n, len(x)), over all `coordinates`
    steady: True near an equilibrium, or a motion that a symmetry of the mechanism carries along (a wheel that rolls, a top that
        precesses): A is then that of a frame that moves along, in which nothing but small motions is left, and constant. Else A is
        that of one instant, and its eigenvalues depend on the independent coordinates
    """

    matrix: np.ndarray
    positions: tuple[str, ...]
    velocities: tuple[str, ...]
    coordinates: tuple[str, ...]
    shapes: np.ndarray
    steady: bool = True
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    B: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    C: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    D: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    def __repr__(self) -> str:
        ports = f", {counted(len(self.inputs), 'input')}, {counted(len(self.outputs), 'output')}" if self.inputs or self.outputs else ""
        return f"<Linearisation beside {self._kind_of_point}: {counted(len(self.matrix), 'state')}{ports}>"

    @property
    def A(self) -> np.ndarray:
        """The same as `matrix`."""
        return self.matrix

    @property
    def states(self) -> tuple[str, ...]:
        """Names of x: independent coordinates, then rates."""
        return (*self.positions, *map(rate_name, self.velocities))

    @cached_property
    def poles(self) -> tuple[Pole, ...]:
        """Poles by frequency, of each pair one, with the names of the coordinates that move in it and their shares."""
        return poles_of(self.matrix, self.eigenvalues, (*self.positions, *self.velocities))

    def frequency_response(self, w: ArrayLike) -> np.ndarray:
        """Compute the frequency response of the outputs.

        Parameters
        ----------
        w : array_like
            Angular frequencies (rad/s), shape (K,).

        Returns
        -------
        numpy.ndarray
            Complex amplitudes for inputs of amplitude 1, shape (K, outputs, inputs).

        Raises
        ------
        ModelError
            Without inputs or outputs, for anything but frequencies, and at a pole.
        """
        self._check_ports()
        return response_of(self.matrix, self.B, self.C, self.D, several(w, "w"))

    def zeros(self, output: str | None = None, input: str | None = None) -> np.ndarray:
        """Compute the zeros of a transfer function.

        Parameters
        ----------
        output : str, optional
            Label of the output; None for the first one.
        input : str, optional
            Name of the input; None for the first one.

        Returns
        -------
        numpy.ndarray
            Zeros (1/s), complex.
        """
        self._check_ports()
        for name, known, kind in ((output, self.outputs, "output"), (input, self.inputs, "input")):
            if name is not None:
                known_name(name, known, "zeros", kind)
        i, j = self.outputs.index(output or self.outputs[0]), self.inputs.index(input or self.inputs[0])
        return zeros_of(self.matrix, self.B[:, j], self.C[i], float(self.D[i, j]))

    def state_space(self) -> StateSpace:
        """Return the system for scipy.signal, such as `scipy.signal.bode(near.state_space())`.

        Returns
        -------
        scipy.signal.StateSpace
            The matrices A, B, C and D.

        Raises
        ------
        ModelError
            Without inputs or outputs.
        """
        self._check_ports()
        from scipy.signal import StateSpace

        return StateSpace(self.matrix, self.B, self.C, self.D)

    @argument_was("path")
    def to_c(self, output: str | os.PathLike[str]) -> Path:
        """Write the matrices as a C header for a controller or an observer, with names for the indices of their rows and columns.

        Parameters
        ----------
        output : path
            Name of the file, with which the header's names begin.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        NcgenError
            If the file cannot be written.
        """
        path = path_of(output)
        matrices = {"A": self.matrix, "B": self.B, "C": self.C, "D": self.D}
        names = {"state": self.states, "input": self.inputs, "output": self.outputs}
        return write_text(path, linear_header(path.stem, self._kind_of_point, matrices, names))

    @property
    def _kind_of_point(self) -> str:
        return "a steady motion or equilibrium" if self.steady else "one instant"

    def _check_ports(self) -> None:
        for kind, names in (("input", self.inputs), ("output", self.outputs)):
            if not names:
                raise ModelError(f"a state space has inputs and outputs: the model has no {kind}; declare it with m.{kind}")

    @cached_property
    def _pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Eigenvalues and vectors, by frequency, then by decay."""
        values, vectors = np.linalg.eig(self.matrix)
        real, imaginary = np.real(values), np.imag(values)
        order = np.lexsort((np.round(imaginary, 12), real, np.round(np.abs(imaginary), 9)))
        return values[order], vectors[:, order]

    @property
    def eigenvalues(self) -> np.ndarray:
        """All eigenvalues (1/s), complex, by frequency."""
        return self._pairs[0]

    @property
    def _swinging(self) -> np.ndarray:
        """Places of the eigenvalues with a positive imaginary part: one of each pair."""
        values = self.eigenvalues
        return np.flatnonzero(np.imag(values) > 1e-9 * np.max(np.abs(values), initial=0.0))

    @property
    def frequencies(self) -> np.ndarray:
        """Frequencies (Hz) of the modes that swing, ascending: |Im| / 2π."""
        return np.imag(self.eigenvalues[self._swinging]) / (2 * np.pi)

    @property
    def damping_ratios(self) -> np.ndarray:
        """Decay over natural frequency of the modes that swing; negative ones grow."""
        values = self.eigenvalues[self._swinging]
        return -np.real(values) / np.abs(values)

    def mode(self, k: int) -> dict[str, complex]:
        """Return the shape of an oscillating mode.

        Parameters
        ----------
        k : int
            Number of the mode, from 0.

        Returns
        -------
        dict of str to complex
            Amplitudes by coordinate, the largest being 1.

        Raises
        ------
        ModelError
            If there is no oscillating mode of this number.
        """
        if not 0 <= k < len(self._swinging):
            raise ModelError(f"mode {k}: there are {len(self._swinging)} modes that swing, numbered from 0")
        shape = self.shapes @ self._pairs[1][:, self._swinging[k]]
        shape = shape / shape[np.argmax(np.abs(shape))]
        return dict(zip(self.coordinates, shape.tolist(), strict=True))

    @property
    def stable(self) -> bool:
        """True if no eigenvalue grows, up to rounding, which of a zero that is there more than once becomes its root."""
        values, count = self.eigenvalues, len(self.positions)
        halves = (np.hsplit(half, [count]) for half in np.vsplit(self.matrix, [count]))
        (by_positions, by_rates), (by_place, damping) = ([np.max(np.abs(block), initial=0.0) for block in half] for half in halves)
        rate = max(np.max(np.abs(values), initial=0.0), by_positions, damping, np.sqrt(by_rates * by_place))
        growing = np.real(values)[np.abs(values) > ZERO * rate]
        return bool(np.max(growing, initial=0.0) <= 1e-8 * np.max(np.abs(values), initial=0.0))


@takes(StartArguments, unused=("closing",), former={"q": "q0", "qd": "qd0", "t": "t0"})
def linearise(kernels: Kernels, **arguments: Unpack[StartArguments]) -> Linearisation:
    """Linearise a mechanism about a position and a velocity, exactly, from the tangent kernels.

    A motion that is not `steady` has the matrix of this instant, with a warning.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    **arguments : StartArguments
        The position and the velocity, by default the initial position at rest; what the constraints do not allow is projected. `p` and
        `inputs` are the values about which inputs change; signals in `inputs` are numbers.

    Returns
    -------
    Linearisation
        State matrix, inputs, outputs, and mode shapes.

    Raises
    ------
    SingularError
        At a singular position.
    ModelError
        For invalid arguments, dry friction, locks and ratchets, and where a force of a Python function has no derivative.
    DomainError
        Where a value or a derivative is NaN or infinite, with the name of its term.
    """
    start: dict[str, Any] = {**arguments}
    inputs = start.pop("inputs", None)
    initial = Initial.from_arguments(checked_kernels(kernels), **start)
    if signals_of(kernels, inputs, initial.p):
        raise ModelError("inputs: linearise needs numbers, the values about which inputs change")
    t, p = initial.t, initial.p
    refuse_callbacks(kernels)
    refuse_sticking(kernels.model, "linearise")
    q = solve_position(kernels, initial.q, t, p).q
    partitions = choose_partitions(kernels, q, t, p, initial.z or kernels.model.chosen_independent)
    velocities, positions = partitions.velocity.independent, partitions.position.independent
    start_velocity = None if initial.qd is None else given_velocity(kernels, initial.qd, q, t, p)[velocities]
    rates = independent_rates(kernels, partitions.velocity, initial.zd) if start_velocity is None else start_velocity
    kernels = watched(kernels)
    now = motion_at(kernels, partitions.velocity, t, q, rates, p)
    swapped = partitioned_jacobian(kernels, partitions, now, p)[:-1, :-1]
    moving = drift(kernels, partitions, now, swapped, p)
    if moving is None:
        warn(f"{kernels.name}: {UNSTEADY}")
    else:
        swapped = swapped - moving
    order = np.roll(np.arange(len(swapped)), len(positions))
    shapes = np.hstack([independent_motions(kernels, partitions, now, p)[0], np.zeros((kernels.n, len(velocities)))])
    B, C, D = _ports(kernels, partitions, now, p)
    return Linearisation(
        matrix=swapped[np.ix_(order, order)],
        positions=partitions.position.names(kernels),
        velocities=partitions.velocity.names(kernels),
        coordinates=kernels.coordinates,
        shapes=shapes,
        steady=moving is not None,
        inputs=kernels.inputs,
        outputs=tuple(kernels.model.outputs),
        B=B,
        C=C,
        D=D,
    )


def _ports(kernels: Kernels, partitions: Partitions, now: Motion, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """B, C and D: inputs push, and outputs see positions, velocities, accelerations and inputs."""
    n, count, velocities = kernels.n, len(kernels.inputs), partitions.velocity.independent
    pushed = input_accelerations(kernels, now, p, partitions.velocity.rows) if count else np.zeros((n, 0))
    B = np.vstack([np.zeros((len(partitions.position.independent), count)), pushed[velocities]])
    if not kernels.model.outputs:
        return B, np.zeros((0, len(B))), np.zeros((0, count))
    q_by_z, qd_by_zd, qd_by_z = independent_motions(kernels, partitions, now, p)
    dq = np.hstack([q_by_z, np.zeros((n, len(velocities)))])
    dqd = np.hstack([qd_by_z, qd_by_zd])
    still = np.zeros((n, count))
    moved = dq, dqd, acceleration_changes(kernels, now, (dq, dqd), p, partitions.velocity.rows), np.zeros((len(p), len(B)))
    driven = still, still, pushed, np.eye(len(p))[:, len(p) - count :]
    C, D = (_output_changes(kernels, partitions.velocity, now, p, each) for each in (moved, driven))
    return B, C, D


def _output_changes(kernels: Kernels, partition: Partition, now: Motion, p: np.ndarray, changes: Sequence[np.ndarray]) -> np.ndarray:
    """How the outputs change (outputs, k); changes: of q, q̇, q̈ and p in k directions."""
    *moved, dp = changes
    dlam = np.zeros((kernels.m, dp.shape[1]))
    if uses_loads(kernels.model):
        from ncgen.solver.loads.observed_loads import instant, warn_of_shared

        warn_of_shared(instant(kernels, now.t, now.q, now.qd, p))
        dlam = multiplier_changes(kernels, partition, now, p, changes)
    return output_slopes(kernels, now.t, (now.q, now.qd, now.qdd, now.lam), p, np.vstack([*moved, dlam, dp]).T)
