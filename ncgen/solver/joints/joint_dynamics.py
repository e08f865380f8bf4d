"""Momentum, energy, forces and accelerations over the joint velocities, and their derivatives."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import SingularError
from ncgen.mechanism.program_functions import ProgramFunctions
from ncgen.mechanism.shared_docstrings import shares
from ncgen.solver import argument_checks
from ncgen.solver.joints import identification
from ncgen.solver.joints.joint_kinematics import JointKinematics
from ncgen.solver.joints.joint_positions import ARGUMENTS

SLOPES = {"joint_inverse_tangent": ("t", "q", "v", "a", "p", "dx", "dv"), "joint_loads_tangent": ("t", "q", "v", "p", "dx", "dv")}
"""The programs of derivatives, and what they take."""


class InverseDerivatives(NamedTuple):
    """How the forces of inverse dynamics change with positions, rates and accelerations of the joints, each (…, n, n): row by row."""

    position: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray


class ForwardDerivatives(NamedTuple):
    """How the accelerations of forward dynamics change with positions and rates of the joints and with forces, each (…, n, n)."""

    position: np.ndarray
    rate: np.ndarray
    force: np.ndarray


@shares(**ARGUMENTS)
class JointDynamics(JointKinematics):
    """Momentum, energy, forces and accelerations: what `JointSpace` answers about loads."""

    # -- momentum and energy -------------------------------------------------------------------

    def momentum_matrix(self, q: ArrayLike, about: ArrayLike | None = None) -> np.ndarray:
        """Compute the momentum for rate 1 of every joint.

        Rotors (`m.rotor`) have no share in it.

        Returns
        -------
        numpy.ndarray
            Linear momentum (N s) and angular momentum (N m s), shape (…, 6, n).
        """
        return np.einsum("...ki,...kn->...in", self._about(q, about), self._spread(self._array(q))[0])

    def momentum(self, q: ArrayLike, v: ArrayLike, about: ArrayLike | None = None) -> np.ndarray:
        """Compute the momentum of all bodies.

        Returns
        -------
        numpy.ndarray
            Linear momentum (N s) and angular momentum (N m s), shape (…, 6).
        """
        spread, drift = self._spread(self._array(q))
        rates = np.einsum("...kn,...n->...k", spread, self._over_rates(v, "v")) + drift
        return np.einsum("...ki,...k->...i", self._about(q, about), rates)

    def kinetic_energy(self, q: ArrayLike, v: ArrayLike) -> np.ndarray:
        """Compute the kinetic energy, rotors included.

        Returns
        -------
        numpy.ndarray
            Energies (J), shape (…,).
        """
        return self.kernels.energy(self._array(q), self.velocities(q, v), p=self.p)[..., 0]

    def potential_energy(self, q: ArrayLike) -> np.ndarray:
        """Compute the potential energy of weights, springs and other forces with a potential.

        Returns
        -------
        numpy.ndarray
            Energies (J), shape (…,).
        """
        q = self._array(q)
        return self.kernels.energy(q, np.zeros_like(q), p=self.p)[..., 1]

    def _about(self, q: ArrayLike, about: ArrayLike | None) -> np.ndarray:
        """Momenta of the tree's rates about a point (…, -, 6)."""
        mass, first, matrix = self._momenta(q)
        point = first / mass if about is None else argument_checks.array_of(about, (3,), "about")
        linear = matrix[..., :3]
        return np.concatenate([linear, matrix[..., 3:] - np.cross(point[..., None, :], linear)], axis=-1)

    # -- forces --------------------------------------------------------------------------------

    def mass_matrix(self, q: ArrayLike) -> np.ndarray:
        """Compute the mass matrix of the joints (CRBA).

        Returns
        -------
        numpy.ndarray
            Symmetric and positive matrix, shape (…, n, n).
        """
        lower = self._of("joint_mass", q)
        matrix = np.zeros((*lower.shape[:-1], self.n, self.n))
        i, j = np.tril_indices(self.n)
        matrix[..., i, j] = matrix[..., j, i] = lower
        return matrix

    def inverse_dynamics(self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None) -> np.ndarray:
        """Compute the forces along the joints that a motion needs against inertia and gravity (RNEA).

        Springs, dampers and other forces of the model are not included: see `loads`.

        Returns
        -------
        numpy.ndarray
            Forces (N, N m), shape (…, n).
        """
        return self._functions("joint_inverse", 0.0, self._array(q), self._over_rates(v, "v"), self._over_rates(a, "a"), self.p)

    def gravity(self, q: ArrayLike) -> np.ndarray:
        """Compute the forces along the joints that hold the mechanism against gravity.

        Returns
        -------
        numpy.ndarray
            Forces (N, N m), shape (…, n).
        """
        return self.inverse_dynamics(q)

    def coriolis(self, q: ArrayLike, v: ArrayLike) -> np.ndarray:
        """Compute the Coriolis and centrifugal forces along the joints.

        Returns
        -------
        numpy.ndarray
            Forces (N, N m) without accelerations and gravity, shape (…, n).
        """
        return self.inverse_dynamics(q, v) - self.gravity(q)

    def loads(self, q: ArrayLike, v: ArrayLike | None = None, t: float = 0.0) -> np.ndarray:
        """Compute what springs, dampers and other forces of the model do along the joints.

        Returns
        -------
        numpy.ndarray
            Forces (N, N m), shape (…, n).
        """
        return self._functions("joint_loads", argument_checks.finite(t, "t"), self._array(q), self._over_rates(v, "v"), self.p)

    def forward_dynamics(self, q: ArrayLike, v: ArrayLike | None = None, forces: ArrayLike | None = None, t: float = 0.0) -> np.ndarray:
        """Compute the accelerations of the joints.

        Returns
        -------
        numpy.ndarray
            Accelerations, shape (…, n).

        Raises
        ------
        SingularError
            If a joint moves nothing that has inertia.
        """
        q = self._array(q)
        right = self.loads(q, v, t) - self.inverse_dynamics(q, v) + self._over_rates(forces, "forces")
        return self._solved(q, right[..., None])[..., 0]

    def _solved(self, q: np.ndarray, right: np.ndarray) -> np.ndarray:
        """M⁻¹ right, right (…, n, k). With a diagonal of 1 exchanges of rows cost a light link no digits next to a heavy one."""
        mass = self.mass_matrix(q)
        sizes = np.sqrt(np.maximum(np.diagonal(mass, axis1=-2, axis2=-1), 0.0))[..., None]
        try:
            if not np.all(sizes > 0):
                raise np.linalg.LinAlgError
            factors = np.linalg.cholesky(mass / (sizes * np.swapaxes(sizes, -1, -2)))
        except np.linalg.LinAlgError:
            raise SingularError(f"{self.kernels.name}: a joint moves nothing that has inertia; give its bodies mass") from None
        return np.linalg.solve(np.swapaxes(factors, -1, -2), np.linalg.solve(factors, right / sizes)) / sizes

    def regressor(self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None) -> np.ndarray:
        """Compute the regressor Y with Y π = `inverse_dynamics`, without rotors.

        π are the inertial parameters of the bodies; `inertial_names` has their names in order.

        Returns
        -------
        numpy.ndarray
            Matrix, shape (…, n, 10 · bodies); it depends on lengths alone.
        """
        functions, state = self._regressor_functions, (self._array(q), self._over_rates(v, "v"), self._over_rates(a, "a"))
        values = functions("joint_regressor", 0.0, *state, self.p)
        return values.reshape(*values.shape[:-1], self.n, 10 * len(self.tree.links))

    @property
    def inertial_names(self) -> tuple[str, ...]:
        """Of the inertial parameters of the bodies, ten each, about the origin of the body's frame: BODY.m, .mx, .my, .mz, .Ixx, .Ixy,
        .Iyy, .Ixz, .Iyz, .Izz."""
        return identification.names_of(self)

    def inertial_values(self) -> np.ndarray:
        """Return the inertial parameters π at the parameters of this space.

        Returns
        -------
        numpy.ndarray
            Values in kg, kg m and kg m², shape (10 · bodies,).
        """
        return identification.values_of(self)

    def base_parameters(self, tolerance: float = identification.DEPENDENT) -> identification.BaseParameters:
        """Compute the combinations of inertial parameters that forces along the joints depend on.

        They follow from the rank of the regressor at random states.

        Parameters
        ----------
        tolerance : float, optional
            What must be left of a column after those before it, relative to the largest column, to count as independent.

        Returns
        -------
        BaseParameters
            The combinations.
        """
        return identification.base_parameters(self, tolerance)

    def inverse_dynamics_derivatives(self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None) -> InverseDerivatives:
        """Compute the exact derivatives of `inverse_dynamics`.

        That by a position is along the motion of a joint at rate 1; rates and accelerations keep their numbers.

        Returns
        -------
        InverseDerivatives
            Derivatives by positions, rates and accelerations of the joints.
        """
        q, v, a = self._array(q), self._over_rates(v, "v"), self._over_rates(a, "a")
        return InverseDerivatives(*self._slopes("joint_inverse_tangent", 0.0, q, v, a), self.mass_matrix(q))

    def forward_dynamics_derivatives(
        self, q: ArrayLike, v: ArrayLike | None = None, forces: ArrayLike | None = None, t: float = 0.0
    ) -> ForwardDerivatives:
        """Compute the exact derivatives of `forward_dynamics`, the model's own forces included.

        Positions are as for `inverse_dynamics_derivatives`.

        Returns
        -------
        ForwardDerivatives
            Derivatives by positions and rates of the joints and by forces.
        """
        q, v = self._array(q), self._over_rates(v, "v")
        a = self.forward_dynamics(q, v, forces, t)
        needed, applied = (
            self._slopes("joint_inverse_tangent", 0.0, q, v, a),
            self._slopes("joint_loads_tangent", argument_checks.finite(t, "t"), q, v),
        )
        unit = np.broadcast_to(np.eye(self.n), needed[0].shape)
        solved = self._solved(q, np.concatenate([*(b - a for a, b in zip(needed, applied, strict=True)), unit], axis=-1))
        return ForwardDerivatives(*(np.array(block) for block in np.split(solved, 3, axis=-1)))

    def _slopes(self, name: str, t: float, *state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """By positions and by rates (…, n, n), one direction after the other."""
        spread = [array[..., None, :] for array in state]
        unit, none = np.eye(self.n), np.zeros((self.n, self.n))
        parts = (self._slope_functions(name, t, *spread, self.p, *along) for along in ((unit, none), (none, unit)))
        by_position, by_rate = (np.swapaxes(half, -1, -2) for half in parts)
        return by_position, by_rate

    @cached_property
    def _slope_functions(self) -> ProgramFunctions:
        """Made when they are first asked for: they are longer than all others together."""
        return self._functions_of("slopes", SLOPES, lambda: dict.fromkeys(SLOPES, self.n))

    @cached_property
    def _regressor_functions(self) -> ProgramFunctions:
        """Likewise; they depend on where the frames of links are."""
        link_frames = identification.frames(self)
        inputs, size = {"joint_regressor": self.inputs["joint_inverse"]}, 10 * len(link_frames) * self.n
        return self._functions_of("regressor", inputs, lambda: {"joint_regressor": size}, f"regressor_{identification.key_of(link_frames)}")
