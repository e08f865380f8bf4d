"""Models with events that several tests of exports use."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import sympy

import ncgen

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "events"))

from bouncing import G, ball  # noqa: E402
from sliding import sliding_block  # noqa: E402

__all__ = ["G", "ball", "fourbar", "sliding_block", "wheel"]


def wheel() -> ncgen.Model:
    """T7: steps of 1.034549811423279 s in the limit cycle; a foot turns gravity on and takes cos 2α of the velocity."""
    half, slope = math.pi / 8, 0.08
    m, psi = sliding_block("wheel")
    feet = m.parameter("feet", 0.0)
    m.torque(psi, G * sympy.sin(psi - 2 * half * feet))
    m.event(
        "foot", when=psi - slope - half - 2 * half * feet, direction="rising",
        do={"feet": feet + 1, "rate(s)": math.cos(2 * half) * psi.rate},
    )  # fmt: skip
    m.simulation(duration=5.0, q0={"s": slope - half, "A.x": slope - half}, qd0={"s": 1.095462839647657})
    return m


def fourbar() -> ncgen.Model:
    """A four-bar linkage whose crank hits a stop: impulses of all joints answer."""
    m = ncgen.load("fourbar")
    kernels = ncgen.compile(m)
    m.stop(m.elements["psi"], upper=float(kernels.q0[kernels.index["psi"]]) + 0.4, restitution=0.6, name="stop")
    return m
