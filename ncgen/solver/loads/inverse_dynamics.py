"""Inverse dynamics: the motor forces that a given motion needs, and those of the drivers that a motion has.

Motors act along coordinates (a torque on a relative angle, say). With R from any partition the equations of
motion without multipliers are Rᵀ(M q̈ − Q) = Rᵀ Q_motor, one equation a degree of freedom. A driver is a row, coordinate − law(t) = 0,
so that its force along the coordinate is −λ.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ncgen.errors import ModelError, SingularError, counted, warn
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.argument_checks import echo, listed_names, names_of, offer
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.positions.kinematics import kinematics
from ncgen.solver.positions.partition import choose_partition
from ncgen.solver.positions.rank import freedom, freedom_at
from ncgen.solver.trajectories.happening import refuse_pieces
from ncgen.solver.trajectories.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class MotorForces:
    """names: coordinates with a motor; forces (K, len(names)) in N or N m; lam (K, m): multipliers of the rows."""

    names: tuple[str, ...]
    forces: np.ndarray
    lam: np.ndarray

    def __getitem__(self, name: str) -> np.ndarray:
        """The force of one motor over time, shape (K,). Raises ModelError for a coordinate without one."""
        if name not in self.names:
            raise ModelError(f"there is no motor on {name}; {offer(name, self.names, 'there are motors on')}")
        return self.forces[:, self.names.index(name)]

    def __repr__(self) -> str:
        return f"<MotorForces on {', '.join(self.names)}: {len(self.forces)} instants>"


def inverse_dynamics(run: Trajectory, motors: str | Iterable[str] | None = None) -> MotorForces:
    """Compute the motor forces that make the motion of a trajectory.

    Forces of the model (gravity, springs, its own torques) act as well, and so do its drivers, whose forces are `run.driver_forces()`; the
    result is what is missing. For a motion with other forces replace its kernels: `dataclasses.replace(run, kernels=without_motors)`.

    Parameters
    ----------
    run : Trajectory
        The motion.
    motors : str or iterable of str, optional
        Coordinates along which motors act. Default: the independent coordinates.

    Returns
    -------
    MotorForces
        Forces in N and torques in N m at the output times.

    Raises
    ------
    ModelError
        If there are not as many motors as degrees of freedom, or drivers leave none of these.
    """
    if not isinstance(run, Trajectory):
        raise ModelError(f"a trajectory is needed, {echo(run)} given; ncgen.simulate makes one")
    refuse_pieces(run, "motor forces")
    kernels = run.kernels
    names = names_of(motors, "motors", kernels.index) or run.independent
    if not names:
        raise ModelError(f"{kernels.name}: no degree of freedom is left for a motor{_instead(kernels)}")
    instants = zip(run.t, run.q, run.qd, run.qdd, strict=True)
    results = [motor_forces(kernels, names, t, q, qd, qdd, refresh_branches(kernels, q, run.p)) for t, q, qd, qdd in instants]
    return MotorForces(names, np.array([f for f, _ in results]), np.array([lam for _, lam in results]))


def motor_forces(
    kernels: Kernels, motors: str | Iterable[str], t: float, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, p: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Motor forces (len(motors),) in N or N m and multipliers (m,) at one instant.

    t: s; q (n,) in m and rad, qd and qdd (n,): their first and second derivatives by time; p (n_p,): parameters (default: the model's)
    """
    motors = names_of(motors, "motors", kernels.index)
    free = freedom(kernels, q, t, p).dof
    if len(motors) != free:
        count = f"{counted(len(motors), 'motor')} for {counted(free, 'degree of freedom')}"
        raise ModelError(f"{kernels.name}: {count}{_instead(kernels) or '; give one each'}")
    partition = choose_partition(kernels, q, t, p, motors)
    frame = kinematics(kernels, partition, q, t, p)
    missing = kernels.mass_matrix(q, t, p) @ qdd - kernels.force(q, qd, t, p)
    where = [kernels.index[name] for name in motors]
    try:
        forces = np.linalg.solve(frame.R[where].T, frame.R.T @ missing)
    except np.linalg.LinAlgError:
        raise SingularError(f"{kernels.name}: the motors on {', '.join(motors)} cannot hold this position") from None
    motor = np.zeros(kernels.n)
    motor[where] = forces
    return forces, frame.multipliers(motor - missing, kernels.m)


def driver_forces(run: Trajectory) -> dict[str, np.ndarray]:
    """What the drivers of the model (`m.drive`) do along a motion: {driven coordinate: (K,)}.

    A force (N) along the coordinate of a point, a distance or a slide, a couple (N m) about the axis of an angle, positive in the
    direction in which the coordinate grows: times the coordinate's rate it is the driver's power. {} where nothing is driven.
    Warns where other constraints do what a driver does, so that their share is arbitrary.
    """
    kernels = run.kernels
    driven = _drivers(kernels)
    forces: dict[str, np.ndarray] = {}
    for row, name in driven.items():
        forces[name] = forces.get(name, np.zeros(len(run.t))) - run.lam[:, row]
    if shared := shared_drivers(run):
        warn(
            f"{kernels.name}: the driver of {shared[0]} does what other constraints do as well; "
            "how the load is divided between them is arbitrary"
        )
    return forces


def shared_drivers(run: Trajectory) -> list[str]:
    """The driven coordinates whose drivers do what other rows do as well."""
    driven = _drivers(run.kernels)
    implied = [{r.row, *r.implied_by} for r in freedom_at(run.kernels, run.q[0], run.t[0], run.p).redundant] if driven else []
    return [name for row, name in driven.items() if any(row in rows for rows in implied)]


def _drivers(kernels: Kernels) -> dict[int, str]:
    """{row: driven coordinate}"""
    return {i: row.owner.name for i, row in enumerate(kernels.rows) if row.owner.kind == "driver"}


def _instead(kernels: Kernels) -> str:
    """Where to look for the forces of what is driven already."""
    driven = tuple(dict.fromkeys(_drivers(kernels).values()))
    if not driven:
        return ""
    return f"; {listed_names(driven)} {'is' if len(driven) == 1 else 'are'} driven, and run.driver_forces() has what that takes"
