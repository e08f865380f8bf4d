"""Stiff mechanisms with events: the default call goes on by Radau, as it does without events."""

from __future__ import annotations

import numpy as np
import pytest
from bouncing import ball

import ncgen
from ncgen.solver.engines import compiled


def damped_chain(damping: float, stops: bool = True) -> ncgen.Kernels:
    """Three light rods with dampers at their hinges; the end falls onto a stop, if there is one, and comes to rest there."""
    m = ncgen.Model("chain")
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    strength = m.parameter("damping", damping)
    before, along = m.point("P0", (0, 0, 0), fixed=True), x
    for i in range(1, 4):
        end = m.point(f"P{i}", (0.3 * i, 0, 0), fixed="z")
        m.body(f"rod{i}", [before, end], mass=0.05 * i, inertia="rod")
        m.torsion_spring(m.angle(f"phi{i}", along, end - before, z), damping=strength)
        before, along = end, end - before
    m.gravity((0, -9.81, 0))
    if stops:
        m.stop("P3.y", lower=-0.02, restitution=0.5)
    return ncgen.compile(m)


def test_a_run_with_events_changes_to_radau():
    """Explicit steps, here 81,000 evaluations long, meet the same impacts."""
    kernels = damped_chain(3.0)
    run = ncgen.simulate(kernels, 5.0, rtol=1e-6)
    exact = ncgen.simulate(kernels, 5.0, rtol=1e-9, formalism="lagrange", integrator="dop853")
    assert run.made_with == "lagrange with radau, emitted: dop853 found the mechanism stiff"
    assert run.statistics.evaluations < 3_000 and exact.statistics.evaluations > 50_000
    assert [event.name for event in run.events] == [event.name for event in exact.events]
    assert [event.t for event in run.events] == pytest.approx([event.t for event in exact.events], abs=1e-7)
    assert np.max(np.abs(run.q - exact.q)) < 1e-7


def test_what_was_changed_at_an_event_stays():
    """A torque that an event halves at 0.1 s, against the closed form of a rod with a damper."""
    m = ncgen.Model("rod")
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    hub, end = m.point("O", (0, 0, 0), fixed=True), m.point("P", (1, 0, 0), fixed="z")
    m.body("rod", [hub, end], mass=3.0, inertia="rod")
    phi = m.angle("phi", x, end - hub, z)
    torque = m.parameter("torque", 1e4)
    m.torque(phi, torque)
    m.torsion_spring(phi, damping=1e4)
    m.event("half", when=0.1 - m.time, do={"torque": 5e3})
    run = ncgen.simulate(ncgen.compile(m), 1.0)
    assert run.made_with.endswith("found the mechanism stiff")
    # J ω' = T − c ω with J = 1 kg m², c = 1e4: ω follows T / c within 1e-4 s
    assert run["rate(phi)"][-1] == pytest.approx(0.5, abs=1e-7)
    assert run["phi"][-1] == pytest.approx(0.1 * 1.0 - 1e-4 + 0.9 * 0.5 + 0.5e-4, abs=1e-7)


def test_what_ends_radau_is_said_as_without_events():
    """The disc falls flat in 0.44 s, where its contact has no place."""
    m = ncgen.load("disc")
    m.event("late", 1.0 - m.time)
    with pytest.raises(ncgen.ConvergenceError, match=r"disc: beyond t = 0\.44 s steps of .* become tiny and radau .* singular position"):
        ncgen.simulate(ncgen.compile(m), 0.5)


def test_a_run_that_c_does_not_carry_on_is_not_moved_without_its_events(monkeypatch):
    """Python's engine has no events, and a ball would fall through the floor."""
    begun, run_in_c = [], compiled.run_constrained

    def interrupted(*arguments):
        begun.append(arguments)
        return "the run in C stopped at t = 0.6 s (pivot)" if len(begun) >= 2 else run_in_c(*arguments)

    monkeypatch.setattr(compiled, "run_constrained", interrupted)
    with pytest.raises(ncgen.ConvergenceError, match=r"ball: the run in C stopped at t = 0.6 s \(pivot\), and events need C; take smaller"):
        ncgen.simulate(ncgen.compile(ball()), 0.8)


@pytest.mark.parametrize("stops", [True, False])
def test_stiff_states_of_a_batch_are_what_they_are_alone(stops):
    """Others stay with the batch, and have the same bits in a batch of their own; so does everything whose integrator is named."""
    kernels, damping = damped_chain(3.0, stops), np.array([[3.0], [1e-3], [3.0], [1e-3]])
    batch, few = (ncgen.simulate(kernels, 2.0, rtol=1e-6, p=p) for p in (damping, damping[1::2]))
    named = ncgen.simulate(kernels, 0.1, rtol=1e-6, p=damping, integrator="dopri5")
    assert batch.ok.all() and batch.alone.tolist() == [True, False, True, False] and not named.alone.any()
    assert np.array_equal(batch.q[1::2], few.q) and not few.alone.any()
    alone = ncgen.simulate(kernels, 2.0, rtol=1e-6, p=damping[0], points=2)
    assert alone.made_with == "lagrange with radau, emitted: dop853 found the mechanism stiff"
    assert np.array_equal(batch.q[0, -1], alone.q[-1]) and batch.steps[0] < 1000
