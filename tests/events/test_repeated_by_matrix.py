"""Runs with events where the recursion has no good order of elimination: they are repeated in C with the factored matrix."""

from __future__ import annotations

import pytest

import ncgen
from ncgen.errors import ConvergenceError
from ncgen.solver.engines import compiled


def counted_pendulum(do=None) -> ncgen.Model:
    """It passes the vertical three times in 2.5 s; each time a counter goes up, unless something else is done."""
    m = ncgen.Model("counted")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (1, 0))
    m.body("rod", [O, P], mass=2.0, inertia="rod")
    m.gravity((0, -9.81))
    count = m.parameter("count", 0.0)
    m.event("vertical", when=P.x, direction="either", do=do or {"count": count + 1})
    return m


@pytest.fixture
def refusing(monkeypatch):
    """The forms of accelerations that C was asked for, all but the matrix's being refused at the end of their way."""
    asked, run = [], compiled.run_constrained

    def refuse(path, kernels, task, form):
        asked.append(form)
        return run(path, kernels, task, form) or (None if form == "dense" else "the run in C stopped at t = 1 s (singular)")

    monkeypatch.setattr(compiled, "run_constrained", refuse)
    return asked


def test_it_has_each_event_once(refusing):
    kernels = ncgen.compile(counted_pendulum())
    run = ncgen.simulate(kernels, 2.5, points=11)
    assert refusing[0] == "emitted" and refusing[-1] == "dense"
    expected = ncgen.simulate(kernels, 2.5, points=11, engine="c")
    assert run.engine == "c" and len(run.events) == len(expected.events) == 3
    assert [event.t for event in run.events] == pytest.approx([event.t for event in expected.events], abs=1e-12)
    assert run.q == pytest.approx(expected.q, abs=1e-12)


@pytest.mark.parametrize(("engine", "do"), [("c", None), ("auto", lambda *state: None)])
def test_what_was_asked_for_is_not_replaced_and_functions_are_not_called_again(monkeypatch, engine, do):
    asked = []
    monkeypatch.setattr(compiled, "run_constrained", lambda *task: asked.append(task) or "the run in C stopped at t = 1 s (singular)")
    with pytest.raises(ConvergenceError, match=r"stopped at t = 1 s \(singular\), and events need C"):
        ncgen.simulate(ncgen.compile(counted_pendulum(do)), 2.5, points=11, engine=engine)
    assert len(asked) == 1
