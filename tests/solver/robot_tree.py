"""The robot as a tree of rotations in its six angles: Kane's equations, with no constraint and no natural coordinate.

Bodies 2 … 9 hang on one another by rotation matrices. The parallelogram 2-3-5-4 lets body 5 turn with body 2 and
body 4 with body 3, so the loop is closed by construction. Data are the paper's tables, the angles' senses those of
its section 3.3.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

GRAVITY = np.array([0.0, 0.0, -9.81])
ANGLES = tuple(f"psi{i}" for i in range(1, 7))


def skew(v):
    """ṽ with ṽ w = v × w."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def turn(axis, angle):
    """Rodrigues' rotation matrix about an axis of any length."""
    n = skew(np.asarray(axis) / np.linalg.norm(axis))
    return np.eye(3) + np.sin(angle) * n + (1 - np.cos(angle)) * n @ n


@dataclass(frozen=True)
class Frame:
    """A rotation: matrix, partial angular velocities (3, 6), angular velocity, and angular acceleration at ψ̈ = 0."""

    matrix: np.ndarray = field(default_factory=lambda: np.eye(3))
    partial: np.ndarray = field(default_factory=lambda: np.zeros((3, 6)))
    omega: np.ndarray = field(default_factory=lambda: np.zeros(3))
    bias: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def turned(self, axis, joint, angle, rate):
        """The next frame: turned by `angle` about an axis of this one, by coordinate number `joint`."""
        n = self.matrix @ (np.asarray(axis, dtype=float) / np.linalg.norm(axis))
        partial = self.partial.copy()
        partial[:, joint] += n
        return Frame(self.matrix @ turn(axis, angle), partial, self.omega + n * rate, self.bias + skew(self.omega) @ n * rate)

    def spin_of(self, tensor):
        """A tensor of the initial position in global axes."""
        return self.matrix @ tensor @ self.matrix.T


@dataclass(frozen=True)
class Place:
    """A material point: position, partial velocities (3, 6), and acceleration at ψ̈ = 0."""

    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    partial: np.ndarray = field(default_factory=lambda: np.zeros((3, 6)))
    bias: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def carried(self, frame, offset):
        """The point that a body carries at an offset given in the initial position."""
        d = frame.matrix @ offset
        drift = skew(frame.bias) @ d + skew(frame.omega) @ (skew(frame.omega) @ d)
        return Place(self.position + d, self.partial - skew(d) @ frame.partial, self.bias + drift)


class RobotTree:
    """Positions, accelerations, torques and loads of the robot from ψ and its derivatives, in the order ψ1 … ψ6."""

    def __init__(self, tables):
        self.r = {i: row[:3] for i, row in enumerate(tables.P, 1)}
        self.inertia = tables.INERTIA
        self.start = np.array([-np.pi / 2, 0.0, self._angle(4, 6, 7), 0.0, self._angle(6, 7, 8), -np.pi / 2])

    def _angle(self, i, j, k):
        """From r_i − r_j to r_k − r_j about the x axis, in the initial position."""
        a, b = self.r[i] - self.r[j], self.r[k] - self.r[j]
        return float(np.arctan2(np.cross(a, b)[0], a @ b))

    def frames(self, psi, rates):
        """{body: Frame}. ψ2 leads from r4 − r2 back to u1, so body 3 turns by it about −x."""
        x, z = np.eye(3)[[0, 2]]
        joints = {  # body: (the body before, axis)
            2: (1, z), 3: (2, -x), 6: (5, x), 7: (6, self.r[7] - self.r[6]), 8: (7, x), 9: (8, self.r[8] - self.r[7]),
        }  # fmt: skip
        f = {1: Frame()}
        for number, (body, (before, axis)) in enumerate(joints.items()):
            f[body] = f[before].turned(axis, number, psi[number] - self.start[number], rates[number])
            f |= {4: f[body], 5: f[2]} if body == 3 else {}
        return f

    def points(self, f):
        """{number: Place} of r1 … r8, each carried by a body from one before."""
        p = {1: Place()}
        for number, before, body in [(2, 1, 2), (3, 1, 2), (4, 2, 3), (5, 3, 4), (6, 4, 5), (7, 6, 6), (8, 7, 8)]:
            p[number] = p[before].carried(f[body], self.r[number] - self.r[before])
        return p

    def bodies(self, psi, rates):
        """{body: (mass, inertia tensor in global axes, Frame, Place of the centre of mass)}."""
        f = self.frames(psi, rates)
        p = self.points(f)
        return {body: self._body(entry, f[body], p) for body, entry in self.inertia.items()}

    def _body(self, entry, frame, points):
        base = entry["r"][0]
        com = points[base].carried(frame, np.asarray(entry["cog"]) - self.r[base])
        return entry["m"], frame.spin_of(entry["IT"]), frame, com

    def equations(self, psi, rates):
        """(M, h) of M ψ̈ + h = τ: partial velocities times inertia forces and weight, summed over the bodies."""
        mass, rest = np.zeros((6, 6)), np.zeros(6)
        for m, spin, f, c in self.bodies(psi, rates).values():
            mass += m * c.partial.T @ c.partial + f.partial.T @ spin @ f.partial
            rest += c.partial.T @ (m * (c.bias - GRAVITY))
            rest += f.partial.T @ (spin @ f.bias + skew(f.omega) @ spin @ f.omega)
        return mass, rest

    def accelerations(self, psi, rates, torques=0.0):
        mass, rest = self.equations(psi, rates)
        return np.linalg.solve(mass, torques - rest)

    def torques(self, psi, rates, accelerations):
        mass, rest = self.equations(psi, rates)
        return mass @ accelerations + rest

    def loads(self, psi, rates, accelerations):
        """{body: (force, moment about the centre of mass, centre)} that its joints exert, by Newton and Euler."""
        result = {}
        for body, (m, spin, f, c) in self.bodies(psi, rates).items():
            alpha = f.partial @ accelerations + f.bias
            force = m * (c.partial @ accelerations + c.bias - GRAVITY)
            result[body] = force, spin @ alpha + skew(f.omega) @ spin @ f.omega, c.position
        return result

    def fall(self, rates, duration, tolerance=1e-11):
        """(ψ, ψ̇) at the end of a free motion from the initial position, by DOP853 on the six angles alone."""

        def derivative(_, y):
            return np.concatenate([y[6:], self.accelerations(y[:6], y[6:])])

        start = np.concatenate([self.start, rates])
        path = solve_ivp(derivative, (0.0, duration), start, method="DOP853", rtol=tolerance, atol=tolerance * 1e-2)
        return path.y[:6, -1], path.y[6:, -1]
