"""Wrong calls end in one line of ncgen, whatever is wrong with them (`wrong_calls` makes them)."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
import wrong_calls as wrong

import ncgen
from ncgen.errors import ModelError

GROUPS = {
    "motions": lambda: wrong.run_calls(wrong.mechanism()),
    "derivatives": lambda: wrong.derivative_calls(wrong.mechanism()),
    "positions": lambda: wrong.place_calls(wrong.mechanism()),
    "driven": wrong.driven_calls,
    "kernels in C": lambda: wrong.kernel_calls(wrong.mechanism()),
    "kernels of NumPy": lambda: wrong.kernel_calls(wrong.mechanism("numpy"), complex_too=True),
    "direct": lambda: wrong.direct_calls(wrong.mechanism()),
    "joint space in C": lambda: wrong.joint_calls(wrong.mechanism()),
    "joint space of NumPy": lambda: wrong.joint_calls(wrong.mechanism("numpy")),
    "step by step": lambda: wrong.simulation_calls(wrong.mechanism()),
    "studies": lambda: wrong.study_calls(wrong.mechanism()),
}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("group", GROUPS)
def test_wrong_calls_end_in_one_line(group):
    """Each argument of each function in the place of about fifty (arrays: ninety) others, about 32,000 calls in all."""
    made = GROUPS[group]()
    found = [f"{call} -> {said}" for each in made for call, said in each.outcomes()]
    assert found == []


@pytest.mark.parametrize(
    "call, said",
    [
        (lambda k: ncgen.simulate(k, 0.01, rtol=1e99), "^rtol: 1e[+]99 given; it must be below 1, such as 1e-8$"),
        (lambda k: ncgen.simulate(k, 0.01, rtol=0), "^rtol: 0 given; it must be a positive number$"),
        (lambda k: ncgen.start(k, rtol=1.0), "^rtol: 1.0 given; it must be below 1"),
        (lambda k: ncgen.simulate(k, 10**400), "^duration: a number of 401 digits given; it must be a positive number of seconds$"),
        (lambda k: ncgen.simulate(k, 0.01, points=10**400), "^points: a number of 401 digits instants of 6 coordinates take"),
        (lambda k: ncgen.simulate(k, 0.01, q0=np.ma.masked_array(k.q0, mask=True)), "^q0 has masked numbers; fill them$"),
        (lambda k: ncgen.simulate(k, 0.01, zd0=np.ma.masked_array([1.0, 1.0], mask=True)), "^zd0 has masked numbers; fill them$"),
        (lambda k: ncgen.start(k, inputs=3), r"^inputs: 3 given; give \{name: value\}$"),
        (lambda k: ncgen.gradient(k, 0.01, 3, 1.0), r"^objective: 1.0 given; give a function \(q, qd\) -> \(value, its"),
        (lambda k: ncgen.gradient(k, 0.01, 3, lambda q, qd: 1.0), r"^objective: it returned 1.0; it must return \(value, "),
        (
            lambda k: ncgen.gradient(k, 0.01, 3, lambda q, qd: (1.0, q[0], None)),
            r"^objective: derivative by q has the shape \(6,\); give \(4, 6\)$",
        ),
        (lambda k: ncgen.gradient(k, 0.01, 3, lambda q, qd: (q, None, None)), r"^objective: its value has the shape \(4, 6\)"),
        (lambda k: ncgen.gradient(k, 0.01, 10**10, wrong.objective), "^steps: 10000000000 given; a motion takes more than 16 GiB"),
        (lambda k: ncgen.gradient(k, 0.01, 3, wrong.objective, integrator=["rk4"]), r"^integrator: \['rk4'\] given; give a name"),
        (lambda k: ncgen.hessian(k, 0.01, 3, wrong.with_change, directions="x"), "^directions has a value that is not a number: 'x'$"),
        (lambda k: ncgen.move(k, None, {"psi": 0.1}, steps=10**9), "^steps: 1000000000 given; 100000 are the most$"),
        (lambda k: ncgen.sweep(k, ["psi"], [0.1]), r"^name: the mechanism has no free coordinate \['psi'\]"),
        (lambda k: k.phi(k.q0, "x"), "^wrongc.phi: t is 'x'; compiled kernels take one real number$"),
        (lambda k: ncgen.compile(k.model, "numpy").phi(k.q0, "x"), "^wrongc.phi: t is 'x'; numbers are needed$"),
        (lambda k: ncgen.compile(k.model, "numpy").phi_q(np.stack([k.q0, k.q0])), "^a batch has no sparse matrix; take kernels.batch"),
        (lambda k: k.nu("x"), "^wrongc.nu: q has a value that is not a number: 'x'$"),
        (lambda k: ncgen.load("pendulum", floating=3), "^floating: 3 given; give True or False$"),
        (lambda k: ncgen.start(k).step(10**400), "^h is a number of 401 digits; it must be a finite number$"),
        (lambda k: ncgen.start(k).step(1e-3, tau=10**400), "^step: tau is a number of 401 digits; it must be a finite number$"),
        (lambda k: ncgen.start(k, 2).drive(tau=np.array([1j, 0])), "^step: tau is .*; it must be a number, or 2 of them$"),
        (lambda k: ncgen.joint_space(k).inverse_kinematics("C", [0, 0, 1e300]), "^position: 1e[+]300 m given"),
    ],
)  # fmt: skip
def test_what_was_taken_or_came_raw(call, said, kernels):
    """One of each kind."""
    with pytest.raises(ncgen.NcgenError, match=said):
        call(kernels)


@pytest.fixture(scope="module")
def kernels():
    return wrong.mechanism()


def test_the_hunt_sees_what_is_wrong():
    """Raw errors, warnings that something was cut, long waits and lines that are none are told; results and refusals are not."""

    def refuse(text):
        raise ModelError(text)

    assert wrong.outcome(lambda: 1.0) is None and wrong.outcome(lambda: refuse("no")) == ""
    assert wrong.outcome(lambda: [][0]) == "IndexError: list index out of range"
    assert "ComplexWarning" in wrong.outcome(lambda: np.zeros(1).__setitem__(0, np.array(1j)))
    taking = wrong.Call("given", lambda x: x, {"x": np.zeros(2)})
    assert {call for call, _ in taking.outcomes()} == {f"given(x = {what})" for what in wrong.NEVER + wrong.COMPLEX}


USES = {
    "step": lambda sim: sim.step(1e-4),
    "drive": lambda sim: sim.drive(tau=0.1),
    "project_state": lambda sim: sim.project_state(),
    "qdd": lambda sim: sim.qdd,
}


@pytest.mark.parametrize("use", [*USES, "reset"])
@pytest.mark.parametrize("many", [False, True], ids=["one", "many"])
def test_two_threads_at_one_simulation_are_refused(kernels, monkeypatch, use, many):
    """While a step is on its way in C nobody else moves, drives, resets or settles the same simulation; afterwards all do."""
    sim = ncgen.start(kernels, 2) if many else ncgen.start(kernels)
    kept = sim.states if many else sim.state
    call = USES.get(use) or (lambda sim: sim.reset(states=kept) if many else sim.reset(kept))
    under_way, done = threading.Event(), threading.Event()
    go_on = sim._now.go_on

    def slowly(h):
        under_way.set()
        assert done.wait(30)
        return go_on(h)

    monkeypatch.setattr(sim._now, "go_on", slowly)
    stepping = threading.Thread(target=sim.step, args=(1e-4,))
    stepping.start()
    try:
        assert under_way.wait(30)
        with pytest.raises(ModelError, match="^wrongc: another thread uses this simulation now; start one for every thread$"):
            call(sim)
    finally:
        done.set()
        stepping.join(30)
    call(sim)
    assert np.all(np.asarray(sim.t) >= 0.0)


def test_threads_lose_no_step_in_silence(kernels):
    """Steps of several threads at one simulation are done or refused: its time is that of the steps that were done."""
    sim, done = ncgen.start(kernels), []

    def run():
        for _ in range(200):
            try:
                sim.step(1e-3)
                done.append(1)
            except ModelError:
                time.sleep(1e-5)

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert abs(sim.t - len(done) * 1e-3) < 1e-9 and done
