"""The scenes of compared_events.py in Siconos, for the Python that has it: prints one JSON row of scene, setting, steps, position, seconds.

Debian has it as python3-siconos, for its own Python.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence

import numpy as np
import siconos.kernel as sk


def in_steps(mass, stiffness, force, start, speed, gaps, law, problem, duration: float, step: float) -> tuple[int, float, float]:
    """Steps of Moreau and Jean, the first coordinate at the end (m), and seconds of the processor."""
    ds = sk.LagrangianLinearTIDS(start, speed, np.diag(mass))
    if any(stiffness):
        ds.setKPtr(np.diag(stiffness))
    ds.setFExtPtr(np.array(force))
    model = sk.NonSmoothDynamicalSystem(0, duration)
    model.insertDynamicalSystem(ds)
    model.link(sk.Interaction(law, sk.LagrangianLinearTIR(np.array(gaps))), ds)
    simulation = sk.TimeStepping(model, sk.TimeDiscretisation(0, step), sk.MoreauJeanOSI(0.5), problem)
    count, begun = 0, time.process_time()
    while simulation.hasNextEvent():
        simulation.computeOneStep()
        simulation.nextStep()
        count += 1
    return count, float(ds.q()[0]), time.process_time() - begun


def by_events(duration: float, step: float) -> tuple[int, float, float]:
    """The ball with LSODAR, from impact to impact."""
    ds = sk.LagrangianLinearTIDS([1.0], [0.0], np.eye(1))
    ds.setFExtPtr(np.array([-9.81]))
    model = sk.NonSmoothDynamicalSystem(0, duration)
    model.insertDynamicalSystem(ds)
    model.link(sk.Interaction(sk.NewtonImpactNSL(0.5), sk.LagrangianLinearTIR(np.eye(1))), ds)
    simulation = sk.EventDriven(model, sk.TimeDiscretisation(0, step))
    simulation.insertIntegrator(sk.LsodarOSI())
    simulation.insertNonSmoothProblem(sk.LCP(), sk.SICONOS_OSNSP_ED_IMPACT)
    simulation.insertNonSmoothProblem(sk.LCP(), sk.SICONOS_OSNSP_ED_SMOOTH_ACC)
    simulation.initialize()
    count, begun = 0, time.process_time()
    while simulation.hasNextEvent():
        simulation.advanceToEvent()
        simulation.processEvents()
        count += 1
    return count, float(ds.q()[0]), time.process_time() - begun


def row(scene: str, setting: str, found: Sequence[float]) -> None:
    """One line of output."""
    print(json.dumps([scene, setting, *found]), flush=True)


def main() -> None:
    """All scenes."""
    across, inertia = [[0.0, 1.0], [1.0, 0.0]], 0.4 * 0.1**2
    for step in (1e-2, 1e-3):
        friction = sk.NewtonImpactFrictionNSL(0.0, 0.0, 1.0, 2)
        problem, moving = sk.FrictionContact(2), ([12.0, 0.0], [6.0, 0.0])
        found = in_steps([1.0, 1.0], [1.0, 0.0], [0.0, -1.0], *moving, across, friction, problem, 100.0, step)
        row("friction", f"Moreau-Jean, step {step:g} s", found)
    for step in (1e-3, 1e-4):
        found = in_steps([1.0], [0.0], [-9.81], [1.0], [0.0], [[1.0]], sk.NewtonImpactNSL(0.5), sk.LCP(), 1.0, step)
        row("ball", f"Moreau-Jean, step {step:g} s", found)
    row("ball", "event-driven, LSODAR", by_events(1.0, 0.05))
    for step in (1e-2, 1e-3):
        friction = sk.NewtonImpactFrictionNSL(0.0, 0.0, 0.2, 2)
        rolling = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.1]]
        moving = ([0.0] * 3, [5.0, 0.0, 0.0])
        found = in_steps([1.0, 1.0, inertia], [0.0] * 3, [0.0, -9.81, 0.0], *moving, rolling, friction, sk.FrictionContact(2), 2.0, step)
        row("rolling", f"Moreau-Jean, step {step:g} s", found)


if __name__ == "__main__":
    main()
