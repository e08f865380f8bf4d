"""Motions that together run most loops of the C library, for the sanitizers (`test_sanitized_python.py`).

    python tests/runtime/sanitized_motions.py [WORD …]

runs those whose names contain one of the words, or all, and prints a line each: its name, and the position at the end.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

import numpy as np

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.mechanism.kernels import Kernels

Numbers = np.ndarray
Motion = Callable[[], Numbers]


def _short(kernels: Kernels, duration: float = 0.05, **arguments: object) -> Numbers:
    return ncgen.simulate(kernels, duration, points=3, **arguments).q[-1]


def _with_events(file: str, name: str, duration: float, rows: int) -> Numbers:
    """rows: 0 for one motion"""
    made = getattr(example_module("", file), name)()
    model, velocities = made if isinstance(made, tuple) else (made, None)
    kernels = ncgen.compile(model, "c")
    start = {"qd0" if file == "contacts.py" else "zd0": velocities}
    if not rows:
        return ncgen.simulate(kernels, duration, points=3, **start).q[-1]
    return ncgen.simulate(kernels, duration, points=3, q0=np.tile(kernels.q0, (rows, 1)), **start).q[-1, -1]


def _reverse(kernels: Kernels, **arguments: object) -> Numbers:
    def objective(q: Numbers, qd: Numbers) -> tuple[float, Numbers, Numbers]:
        return float(q[-1].sum()), np.eye(len(q))[-1][:, None] * np.ones_like(q), np.zeros_like(qd)

    derivatives = ncgen.gradient(kernels, 0.05, 5, objective, **arguments).derivatives
    return np.ravel(list(derivatives.values()) if isinstance(derivatives, dict) else derivatives)


def _forward(kernels: Kernels, **arguments: object) -> Numbers:
    return np.ravel(ncgen.sensitivities(kernels, 0.05, 5, **arguments).q[-1])


def _steps(kernels: Kernels, **arguments: object) -> Numbers:
    simulation = ncgen.start(kernels, **arguments)
    for _ in range(3):
        simulation.step(0.01)
    return simulation.q


def _mechanisms() -> dict[str, Kernels]:
    return {name: ncgen.compile(ncgen.load(name), "c") for name in ("pendulum", "fourbar", "bricard", "slidercrank")}


def motions() -> Iterator[tuple[str, Motion]]:
    """Names of motions, and what runs them."""
    for name, kernels in _mechanisms().items():
        for method in ("dop853", "rk4", "radau", "trapezoidal", "rattle", "energy-momentum", "generalized-alpha"):
            step = {} if method in ("dop853", "radau") else {"max_step": 0.01}
            yield f"{name} lagrange {method}", lambda k=kernels, m=method, s=step: _short(k, integrator=m, **s)
        for formalism in ("coordinate-partitioning", "null-space", "udwadia-phohomsiri", "augmented-lagrangian", "penalty"):
            for method in ("dopri5", "radau"):
                yield f"{name} {formalism} {method}", lambda k=kernels, f=formalism, m=method: _short(k, formalism=f, integrator=m)
        yield f"{name} ali3p trapezoidal", lambda k=kernels: _short(k, formalism="ali3p", integrator="trapezoidal", max_step=0.01)
    for name, kernels in _mechanisms().items():
        rows = np.tile(kernels.q0, (5, 1))
        yield f"{name} batch", lambda k=kernels, r=rows: ncgen.simulate(k, 0.05, points=3, q0=r).q[-1, -1]
        yield f"{name} steps", lambda k=kernels: _steps(k)
        yield f"{name} steps of a batch", lambda k=kernels, r=rows: _steps(k, q0=r).ravel()
        yield f"{name} sensitivities", lambda k=kernels: _forward(k)
        yield f"{name} sensitivities of rattle", lambda k=kernels: _forward(k, integrator="rattle")
        yield f"{name} gradient", lambda k=kernels: _reverse(k)
        yield f"{name} gradients of a batch", lambda k=kernels, r=rows: _reverse(k, q0=r)
    arm = ncgen.compile(example_module("arm").build(30), "c")
    yield "arm of 30 joints by tables", lambda: _short(arm)
    yield "arm of 30 joints by tables radau", lambda: _short(arm, 0.01, integrator="radau")
    ladder = ncgen.compile(example_module("nfourbar").build(62), "c")
    yield "loops by tables", lambda: _short(ladder, 0.01)
    for file, name, duration in (
        ("impacts.py", "ball", 1.5), ("impacts.py", "wheel", 0.5), ("impacts.py", "screw", 0.2), ("winch.py", "winch", 3.2),
        ("winch.py", "oscillator", 3.0), ("winch.py", "rocking", 0.5), ("contacts.py", "falling", 1.0), ("contacts.py", "woodpecker", 0.3),
    ):  # fmt: skip
        yield f"{name} with events", lambda f=file, n=name, d=duration: _with_events(f, n, d, 0)
        yield f"{name} with events in a batch", lambda f=file, n=name, d=duration: _with_events(f, n, d, 3)


def main(words: list[str]) -> None:
    for name, motion in motions():
        if not words or any(word in name for word in words):
            print(f"{name}: {np.array2string(motion()[:4], precision=6)}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
