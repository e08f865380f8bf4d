"""Motions from one position to another with bounded forces, found by IPOPT on the functions that `ncgen export --to casadi` writes, and
beside them the same problems written in CasADi alone.

    python examples/optimal_control.py cartpole|robot

cartpole: the pole swings up in 2 s by a force of at most 12 N, with the least ∫F²; in CasADi alone by Lagrange's equations, typed by hand.
robot: the paper's robot turns its six angles in 1 s with bounded torques; in CasADi alone M q̈ + Φ_qᵀλ = Q and Φ_q q̈ = γ are equations of
the problem, accelerations and multipliers unknowns, and CasADi differentiates everything.
Both have 100 intervals of the trapezoidal rule. Needs the package casadi, which brings IPOPT, and a C compiler.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi
import numpy as np

import ncgen
from ncgen.exchange.export import export
from ncgen.model.elements import Relative
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS

INTERVALS = 100
NODES = INTERVALS + 1
OPTIONS = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.max_iter": 200}


@dataclass
class Problem:
    """From rest at z0 to rest at z1 (independent coordinates) in so many seconds; limits: of the inputs' absolute values."""

    model: ncgen.Model
    z0: np.ndarray
    z1: np.ndarray
    seconds: float
    limits: np.ndarray

    @property
    def h(self) -> float:
        return self.seconds / INTERVALS

    def straight(self) -> np.ndarray:
        """Independent coordinates on the straight way (z, nodes): where the search begins."""
        return np.outer(self.z0, np.linspace(1, 0, NODES)) + np.outer(self.z1, np.linspace(0, 1, NODES))

    def effort(self, U: Any) -> Any:
        """∫(u / limits)²; U: u / limits."""
        return self.h * casadi.sumsqr(U)

    def steps(self, X: Any, slopes: Any) -> Any:
        """What the trapezoidal rule asks of a history (x, nodes)."""
        return casadi.vec(X[:, 1:] - X[:, :-1] - self.h / 2 * (slopes[:, 1:] + slopes[:, :-1]))

    def ends(self, Z: Any, V: Any) -> list[Any]:
        return [Z[:, 0] - self.z0, V[:, 0], Z[:, -1] - self.z1, V[:, -1]]


@dataclass
class Found:
    """What IPOPT says, with its own seconds and those before it begins, and inputs (inputs, nodes)."""

    text: str
    effort: float
    inputs: np.ndarray


def solved(problem: Problem, unknowns: Sequence[tuple[Any, np.ndarray]], U: Any, equations: Sequence[Any], began: float) -> Found:
    """By IPOPT with exact second derivatives; unknowns: with what the search begins from. U is the last unknown, 0 at first."""
    x, g = casadi.veccat(*(symbol for symbol, _ in unknowns), U), casadi.veccat(*equations)
    start = casadi.veccat(*(value for _, value in unknowns), np.zeros(U.shape))
    free = np.full(x.numel() - U.numel(), np.inf)
    bounds = np.concatenate([free, np.ones(U.numel())])
    solver = casadi.nlpsol("solver", "ipopt", {"x": x, "f": problem.effort(U), "g": g}, OPTIONS)
    before, clock = time.perf_counter() - began, time.perf_counter()
    result = solver(x0=start, lbx=-bounds, ubx=bounds, lbg=0, ubg=0)
    seconds, stats = time.perf_counter() - clock, solver.stats()
    effort = float(result["f"])
    text = f"{stats['return_status']}, effort {effort:.9f}, {stats['iter_count']} iterations in {seconds:.2f} s"
    u = result["x"][-U.numel() :].full().reshape(U.shape, order="F") * problem.limits[:, None]
    return Found(f"{text}, {x.numel()} unknowns, prepared in {before:.1f} s", effort, u)


def library(model: ncgen.Model, flags: str = "-O1 -ffp-contract=off") -> Path:
    """An export as a shared library."""
    folder = Path(tempfile.mkdtemp())
    export(model, "casadi", folder)
    subprocess.run(["make", "-s", f"CFLAGS={flags}"], cwd=folder, check=True)
    return folder / f"{model.name}.so"


def by_ncgen(problem: Problem) -> Found:
    """Positions s and rates v are unknowns at every node: of joints where they are an open tree, else all coordinates with closed loops as
    equations, and rates of the independent ones."""
    began = time.perf_counter()
    path, name = str(library(problem.model)), problem.model.name
    dynamics = casadi.external(f"{name}_dynamics", path)
    begin = casadi.external(f"{name}_start", path)()
    places = begin["places"].full().ravel().astype(int).tolist()
    S, V, U = (casadi.MX.sym(x, k, NODES) for x, k in (("S", dynamics.size1_in(1)), ("V", len(places)), ("U", len(problem.limits))))
    t, p = casadi.DM.zeros(1, NODES), casadi.repmat(begin["p"], 1, NODES)
    _, vd = dynamics.map(NODES)(t, S, V, casadi.diag(problem.limits) @ U, p)
    Z, way = S[places, :], problem.straight()
    equations = [problem.steps(Z, V), problem.steps(V, vd), *problem.ends(Z, V)]
    if has_loops := S.shape[0] > len(places):
        equations.append(casadi.external(f"{name}_constraints", path).map(NODES)(t, S, p))
    speeds = np.repeat((problem.z1 - problem.z0)[:, None] / problem.seconds, NODES, 1)
    return solved(problem, [(S, positions(problem, way) if has_loops else way), (V, speeds)], U, equations, began)


def positions(problem: Problem, way: np.ndarray) -> np.ndarray:
    """All coordinates (n, nodes) for independent ones."""
    kernels = ncgen.compile(problem.model)
    names, q, found = problem.model.chosen_independent, None, []
    for z in way.T:
        q = ncgen.move(kernels, q, dict(zip(names, z, strict=True)), steps=1 if found else INTERVALS).q
        found.append(q)
    return np.array(found).T


def cartpole() -> Problem:
    return Problem(ncgen.load("cartpole"), np.array([0.0, np.pi]), np.array([0.0, 0.0]), 2.0, np.array([12.0]))


def cartpole_by_hand(problem: Problem) -> Found:
    """Lagrange's equations of cart and pole, the pole's angle from the vertical against the clock."""
    began = time.perf_counter()
    M, m, l, g = 1.0, 0.2, 0.8, 9.81
    z, v, u = (casadi.SX.sym(x, k) for x, k in (("z", 2), ("v", 2), ("u", 1)))
    across = -m * l / 2 * casadi.cos(z[1])
    H = casadi.vertcat(casadi.horzcat(M + m, across), casadi.horzcat(across, m * l**2 / 3))
    right = casadi.vertcat(u - m * l / 2 * casadi.sin(z[1]) * v[1] ** 2, m * g * l / 2 * casadi.sin(z[1]))
    dynamics = casadi.Function("dynamics", [z, v, u], [casadi.solve(H, right)])
    Z, V, U = (casadi.MX.sym(x, k, NODES) for x, k in (("Z", 2), ("V", 2), ("U", 1)))
    vd = dynamics.map(NODES)(Z, V, casadi.diag(problem.limits) @ U)
    equations = [problem.steps(Z, V), problem.steps(V, vd), *problem.ends(Z, V)]
    speeds = np.repeat((problem.z1 - problem.z0)[:, None] / problem.seconds, NODES, 1)
    return solved(problem, [(Z, problem.straight()), (V, speeds)], U, equations, began)


def robot() -> Problem:
    model = ncgen.load("robot")
    names = model.chosen_independent
    for k, name in enumerate(names, 1):
        angle = model.elements[name]
        assert isinstance(angle, Relative), f"{name} is an angle"
        model.torque(angle, model.input(f"tau{k}", "N m"))
    kernels = ncgen.compile(model)
    z0 = np.array([kernels.q0[kernels.index[name]] for name in names])
    return Problem(model, z0, z0 + [0.6, 0.3, 0.2, -0.2, 0.3, 0.4], 1.0, np.array([650.0, 2800.0, 1150.0, 20.0, 60.0, 0.2]))


def graph(kernels: Any, name: str, given: Mapping[str, Any]) -> Any:
    """A kernel's numbers as a column of CasADi's expressions in the symbols given."""
    words = {code: "fabs" if code == "abs" else f.numpy.replace("arc", "a") for code, f in FUNCTIONS.items()}
    functions = {code: getattr(casadi, word) for code, word in words.items() if hasattr(casadi, word)}
    read = {"t": 0.0, "p": kernels.p0.tolist()} | {letter: casadi.vertsplit(x) for letter, x in given.items()}
    return casadi.vertcat(*evaluate(kernels.programs.programs[name], read, functions, casadi.SX))


def robot_in_casadi(problem: Problem) -> Found:
    """Accelerations and multipliers are unknowns; redundant rows, as ncgen names them, are left out."""
    began = time.perf_counter()
    kernels = ncgen.compile(problem.model)
    rows = list(ncgen.freedom(kernels).kept_rows)
    n, count = kernels.n, len(rows)
    q, qd, qdd, lam, u = (casadi.SX.sym(x, k) for x, k in (("q", n), ("qd", n), ("qdd", n), ("lam", count), ("u", len(problem.limits))))
    phi = graph(kernels, "phi", {"q": q})[rows]
    phi_q = casadi.jacobian(phi, q)
    mass, M = graph(kernels, "mass", {"q": q}), casadi.SX(n, n)
    for (row, column), k in kernels.mass_pattern.positions().items():
        M[row, column] = mass[k]
    force = graph(kernels, "force", {"q": q, "qd": qd, "p": u})
    turning = casadi.jtimes(casadi.jtimes(phi, q, qd), q, qd)
    balance = casadi.vertcat(M @ qdd + phi_q.T @ lam - force, phi_q @ qdd + turning, phi, phi_q @ qd)
    equation = casadi.Function("balance", [q, qd, qdd, lam, u], [balance])
    parts = (("Q", n), ("QD", n), ("QDD", n), ("LAM", count), ("U", len(problem.limits)))
    Q, QD, QDD, LAM, U = (casadi.MX.sym(x, k, NODES) for x, k in parts)
    places = [kernels.index[name] for name in problem.model.chosen_independent]
    left = equation.map(NODES)(Q, QD, QDD, LAM, casadi.diag(problem.limits) @ U)
    Z, V = Q[places, :], QD[places, :]
    equations = [problem.steps(Z, V), problem.steps(V, QDD[places, :]), left, *problem.ends(Z, V)]
    way = positions(problem, problem.straight())
    speeds = np.gradient(way, problem.h, axis=1)
    still = np.zeros((n, NODES))
    return solved(problem, [(Q, way), (QD, speeds), (QDD, still), (LAM, np.zeros((count, NODES)))], U, equations, began)


PROBLEMS = {"cartpole": (cartpole, cartpole_by_hand), "robot": (robot, robot_in_casadi)}


if __name__ == "__main__":
    for name in sys.argv[1:] or PROBLEMS:
        make, alone = PROBLEMS[name]
        problem, found = make(), {}
        for way, solve in (("ncgen's functions", by_ncgen), ("CasADi alone", alone)):
            found[way] = solve(problem)
            print(f"{name}, {way}: {found[way].text}", flush=True)
        first, second = (each.inputs for each in found.values())
        print(f"{name}: inputs differ by at most {np.max(np.abs((first - second) / problem.limits[:, None])):.1e} of their limits")
