"""Wrong calls of everything that users call: each argument of each public function replaced by values that it cannot have.

A call may work (a list is an array, a number may be big-endian) or be refused by one line of ncgen. Nothing else: no error of NumPy or
cffi, no warning of NumPy that something was cut, no answer that takes for ever, and no result from what cannot be an array.
"""

from __future__ import annotations

import os
import signal
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import ncgen
from ncgen.errors import LONGEST_LINE, NcgenError

LONGEST = int(os.environ.get("LONGEST_CALL", "60"))
"""Seconds of a call: a step of 1e21 s is given up after 100,000 short ones, which takes a few."""


class NoNumber:
    """Something else."""

    def __init__(self, *anything: object) -> None:
        pass


def nothing(*anything: object) -> None:
    """A function that returns nothing."""


def wrong_values(good: Any) -> Iterator[tuple[str, Any]]:
    """(what it is, value) in the place of a good argument: of another kind, and for an array of every other shape and sort of numbers."""
    yield from {
        "None": None, "a text": "x", "an empty text": "", "bytes": b"12345678", "an object": NoNumber(), "a class": NoNumber,
        "a set": {1.0}, "a function": nothing, "a generator": (x for x in [1.0]), "a dictionary": {"nobody": 1.0},
        "numbers as keys": {1: 2.0},
        "nan": np.nan, "inf": np.inf, "-inf": -np.inf, "a huge integer": 10**400, "a longer one": 10**5000, "a large integer": 2**70,
        "-1": -1, "0": 0, "True": True, "complex": 1 + 1j, "a complex array": np.array(1j), "1e300": 1e300, "-1e300": -1e300,
        "1e-320": 1e-320, "1e99": 1e99, "2.5": 2.5, "3": 3, "[]": [], "empty": np.empty(0), "0 rows": np.empty((0, 3)),
        "nested": [[1.0], [1.0, 2.0]], "[None]": [None], "['a']": ["a"], "(1, 2)": (1, 2), "dates": np.array(["2020-01-01"], dtype="M8[D]"),
        "records": np.zeros(2, dtype="i4,f8"), "True, False": [True, False], "{name: nan}": {"psi": np.nan}, "{name: text}": {"psi": "x"},
        "{name: huge}": {"psi": 10**400}, "{name: None}": {"psi": None}, "{name: array}": {"psi": np.zeros(3)},
        "{name: complex}": {"psi": 1j},
    }.items()  # fmt: skip
    if isinstance(good, np.ndarray) and good.dtype.kind == "f":
        yield from wrong_arrays(good)


def wrong_arrays(good: np.ndarray) -> Iterator[tuple[str, Any]]:
    """Arrays like a good one (…, k) of other shapes, layouts and numbers."""
    yield "short", good[..., :-1]
    yield "long", np.concatenate([good, good], axis=-1)
    yield "with an axis", good[None]
    yield "with two axes", good[None, None]
    yield "twice", np.stack([good, good])
    yield "transposed", np.stack([good, good], axis=-1)
    yield "flat", np.tile(good.ravel(), 3)
    for what, number in {"nan": np.nan, "inf": np.inf, "1e300": 1e300}.items():
        other = good.copy()
        other.flat[-1:] = number
        yield f"{what} at its end", other
    yield "complex", good + 1j
    yield "complex zeros", good + 0j
    yield "masked", np.ma.masked_array(good, mask=np.ones(good.shape, bool))
    yield "masked nowhere", np.ma.masked_array(good)
    yield "texts", good.astype(str)
    yield "texts of numbers", np.full(good.shape, "1")
    yield "objects", np.full(good.shape, NoNumber(), dtype=object)
    yield "huge integers", np.full(good.shape, 10**400, dtype=object)
    yield "None in it", np.full(good.shape, None, dtype=object)
    yield "complex objects", np.full(good.shape, 1j, dtype=object)
    yield "truths", good.astype(bool)
    yield "integers", good.astype(int)
    yield "float16", good.astype(np.float16)
    yield "long double", good.astype(np.longdouble)
    yield "strided", np.repeat(good, 2, axis=-1)[..., ::2]
    yield "backwards", good[..., ::-1]
    yield "big-endian", good.astype(">f8")
    yield "Fortran", np.asfortranarray(np.stack([good, good]))
    yield "a matrix", np.matrix(np.atleast_2d(good).reshape(1, -1))
    read_only = good.copy()
    read_only.flags.writeable = False
    yield "read-only", read_only
    yield "not aligned", np.frombuffer(bytearray(8 * good.size + 1), dtype=np.uint8)[1:].view(float).reshape(good.shape)
    yield "a list", good.tolist()
    yield "a tuple", tuple(good.tolist())
    yield "a list in a list", [good.tolist()]


NEVER = ("masked", "texts", "texts of numbers", "objects", "None in it", "huge integers")
"""What no array can be: a result would be one of other numbers than those that were given."""

COMPLEX = ("complex", "complex zeros", "complex objects")
"""What only kernels of NumPy take."""


@dataclass(frozen=True)
class Call:
    """A function with its good arguments; given: those that are replaced, one at a time; complex_too: whether numbers may be complex."""

    name: str
    function: Callable[..., Any]
    given: Mapping[str, Any]
    complex_too: bool = False

    def outcomes(self) -> Iterator[tuple[str, str]]:
        """(call in words, what went wrong) of those that end in anything but a result or one line of ncgen."""
        self.function(**self.given)
        for argument, good in self.given.items():
            for what, value in wrong_values(good):
                said = outcome(lambda argument=argument, value=value: self.function(**{**self.given, argument: value}))
                must = isinstance(good, np.ndarray) and what in (NEVER if self.complex_too else NEVER + COMPLEX)
                if said or (said is None and must):
                    yield f"{self.name}({argument} = {what})", said or "is taken"


def outcome(call: Callable[[], Any]) -> str | None:
    """What is wrong with the end of a call; None where it gives a result, "" where it is refused in one line."""

    def late(number: int, frame: object) -> None:
        raise TimeoutError(f"takes longer than {LONGEST} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(LONGEST)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for cut in (np.exceptions.ComplexWarning, RuntimeWarning, DeprecationWarning):
                warnings.simplefilter("error", cut)
            call()
    except NcgenError as error:
        line = str(error)
        return "" if line and "\n" not in line and len(line) <= LONGEST_LINE else f"a message that is no line: {line!r}"
    except BaseException as error:  # whatever else comes out is what is looked for
        return f"{type(error).__name__}: {error}"
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    return None


def mechanism(backend: str = "c") -> ncgen.mechanism.kernels.Kernels:
    """A pendulum that an input drives, with a second arm, a parameter, an output, and a driver that can be asked for positions."""
    m = ncgen.Model(f"wrong{backend}")
    M, tau = m.parameter("M", 1.5), m.input("tau", "N m")
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0)), m.point("C", (1, -1))
    x, z = m.vector("x", (1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    first = m.body("first", points=[A, B], mass=M, inertia=0.2)
    second = m.body("second", points=[B, C], mass=1.0, inertia=0.1)
    psi, phi = m.angle("psi", x, B - A, z), m.angle("phi", B - A, C - B, z)
    m.torque(psi, tau)
    m.spring(C, m.point("G", (0, -1), fixed=True), stiffness=3.0)
    m.output("height", C.components[1].symbol * 2)
    m.gravity((0, -9.81))
    assert first and second and phi
    return ncgen.compile(m, backend)


def driven() -> ncgen.mechanism.kernels.Kernels:
    """A crank whose angle is a law of time."""
    m = ncgen.Model("wrongdriven")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    x, z = m.vector("x", (1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("crank", points=[A, B], mass=1.0, inertia=m.parameter("J", 0.1))
    m.drive(m.angle("psi", x, B - A, z), m.time * 2)
    return ncgen.compile(m)


def objective(q: np.ndarray, qd: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    weights = np.zeros_like(q)
    weights[-1, 0] = 1.0
    return float(q[-1, 0]), weights, np.zeros_like(q)


def with_change(q: np.ndarray, qd: np.ndarray) -> tuple[Any, ...]:
    return (*objective(q, qd), None)


def start_of(k: Any) -> dict[str, Any]:
    """What all public functions take of a start."""
    nz = 2
    return {"q0": k.q0.copy(), "zd0": np.zeros(nz), "p": k.p0.copy(), "t0": 0.0, "z": ("psi", "phi"), "closing": 1e-6}


def run_calls(k: Any) -> list[Call]:
    """Motions."""
    start, rows = start_of(k), {"q0": np.tile(k.q0, (3, 1)), "zd0": np.zeros((3, 2)), "p": k.p0.copy()}
    chosen = {"points": 3, "rtol": 1e-4, "atol": 1e-4, "max_step": 0.1, "formalism": "coordinate-partitioning", "integrator": "dopri5"}
    words = {"engine": "c", "number": "double", "options": {}, "stop": None, "inputs": {"tau": 0.1}, "progress": None}

    def by_qd(f: Any) -> Any:
        return lambda kernels, qd0: f(kernels, 0.01, qd0=qd0)

    grid = np.linspace(0.0, 0.01, 4)
    return [
        Call("simulate", ncgen.simulate, {"kernels": k, "duration": 0.01, **start, **chosen, **words}),
        Call("simulate", lambda **given: ncgen.simulate(k, 0.01, **given), {"points": grid, "inputs": {"tau": (grid, grid)}}),
        Call("simulate, qd0", by_qd(ncgen.simulate), {"kernels": k, "qd0": np.zeros(k.n)}),
        Call("start", ncgen.start, {"kernels": k, **start, "rtol": 1e-6, "atol": 1e-6, "integrator": "rk4", "inputs": {"tau": 0.1}}),
        Call("start of many", ncgen.start, {"kernels": k, "variants": 2, **start, "rtol": 1e-6, "atol": 1e-6, "threads": 1,
                                                "inputs": {"tau": np.zeros(2)}}),
        Call("simulate rows", ncgen.simulate, {
            "kernels": k, "duration": 0.01, **rows, "t0": 0.0, "z": ("psi", "phi"), "integrator": "dopri5", "rtol": 1e-4, "atol": 1e-4,
            "max_step": 0.1, "points": 3, "threads": 1, "inputs": {"tau": 0.1}, "progress": None,
        }),
        Call("simulate rows, qd0", by_qd(ncgen.simulate), {"kernels": k, "qd0": np.zeros((3, k.n))}),
        Call("accelerations of rows", ncgen.accelerations, {
            "kernels": k, "q": rows["q0"], "zd": rows["zd0"], "p": k.p0.copy(), "t": 0.0, "z": ("psi", "phi"), "velocities": True,
            "threads": 1,
        }),
    ]  # fmt: skip


def derivative_calls(k: Any) -> list[Call]:
    """Derivatives of motions."""
    start = start_of(k)
    common = {"kernels": k, "duration": 0.01, "steps": 3, "integrator": "rk4", "inputs": {"tau": 0.1}}
    return [
        Call("sensitivities", ncgen.sensitivities, {**common, **start, "rtol": None, "options": None, "by": ("M", "psi")}),
        Call("gradient", ncgen.gradient, {**common, **start, "objective": objective, "rtol": None, "options": None}),
        Call("hessian", ncgen.hessian, {**common, **start, "objective": with_change, "rtol": None, "directions": np.eye(6)[:, :2]}),
        Call("gradient of rows", ncgen.gradient, {
            "kernels": k, "duration": 0.01, "steps": 3, "objective": objective, "integrator": "rk4", "q0": np.tile(k.q0, (2, 1)),
            "zd0": np.zeros((2, 2)), "p": k.p0.copy(), "t0": 0.0, "z": ("psi", "phi"), "threads": 1,
        }),
    ]  # fmt: skip


def place_calls(k: Any) -> list[Call]:
    """Positions, equilibria, linear systems."""
    at = {"kernels": k, "q": k.q0.copy(), "t": 0.0, "p": k.p0.copy()}
    return [
        Call("assemble", ncgen.assemble, {**at, "tolerance": 1e-6}),
        Call("freedom", ncgen.freedom, at),
        Call("solve_position", ncgen.solve_position, {**at, "held": ("psi",), "tolerance": 1e-9, "limit": 20}),
        Call("move", ncgen.move, {**at, "targets": {"psi": 0.1}, "steps": 1}),
        Call("sweep", lambda kernels, name, values, q, t, p: ncgen.sweep(kernels, name, values, q, t=t, p=p),
             {"kernels": k, "name": "psi", "values": np.linspace(0, 0.1, 3), "q": k.q0.copy(), "t": 0.0, "p": k.p0.copy()}),
        Call("equilibrium", ncgen.equilibrium, {**at, "kind": "stable"}),
        Call("linearise", ncgen.linearise, {"kernels": k, "p": k.p0.copy(), "z": ("psi", "phi")}),
    ]  # fmt: skip


def driven_calls() -> list[Call]:
    """What time alone moves."""
    k = driven()
    found = ncgen.driven_positions(k, np.linspace(0, 1, 4))
    return [
        Call("driven_positions", ncgen.driven_positions, {"kernels": k, "t": np.linspace(0, 1, 4), "p": k.p0.copy(), "near": k.q0.copy()}),
        Call("foreseen", found.foreseen, {"p": k.p0.copy()}),
    ]


def kernel_calls(k: Any, complex_too: bool = False) -> list[Call]:
    """The kernels themselves."""
    at, lam = {"q": k.q0.copy(), "t": 0.0, "p": k.p0.copy()}, np.zeros(k.m)
    moving = {"q": k.q0.copy(), "qd": np.zeros(k.n), "t": 0.0, "p": k.p0.copy()}
    accelerated = {**moving, "qdd": np.zeros(k.n)}
    calls = [Call(name, getattr(k, name), at) for name in ("phi", "phi_q", "nu", "mass", "jacobian", "mass_matrix", "phi_p")]
    calls += [Call(name, getattr(k, name), moving) for name in ("gamma", "constraints", "force", "energy", "damping", "phidd_qd", "phid_p")]
    calls += [Call(name, getattr(k, name), accelerated) for name in ("phidd_q", "phidd_p")]
    calls += [Call(name, getattr(k, name), {**accelerated, "lam": lam}) for name in ("stiffness", "balance_p")]
    calls += [Call(name, getattr(k, name), {"p": k.p0.copy()}) for name in ("start", "start_p")]
    rows = {"q": np.tile(k.q0, (3, 1)), "t": np.zeros(3), "p": np.tile(k.p0, (3, 1))}
    calls += [Call(f"batch.{name}", getattr(k.batch, name), rows) for name in ("phi", "phi_q", "nu", "mass")]
    calls += [
        Call(f"batch.{name}", getattr(k.batch, name), {**rows, "qd": np.zeros((3, k.n)), "out": None})
        for name in ("gamma", "force", "energy")
    ]
    return [replace(call, complex_too=call.name.startswith("start") or (complex_too and "batch" not in call.name)) for call in calls]


def direct_calls(k: Any) -> list[Call]:
    """Kernels on arrays of their own."""

    def assign(name: str) -> Callable[[Any], None]:
        def put(value: Any) -> None:
            kernel = k.direct("force")
            setattr(kernel, name, value)
            kernel()

        return put

    good = {"q": k.q0.copy(), "qd": np.zeros(k.n), "p": k.p0.copy(), "t": 0.0}
    return [Call(f"direct.{name}", assign(name), {"value": value}) for name, value in good.items()]


def joint_calls(k: Any) -> list[Call]:
    """Joint space."""
    js = ncgen.joint_space(k)
    q, v, x = js.position(), np.zeros(js.n), np.zeros(js.n)
    of_q = ("values", "centre_of_mass", "screws", "centre_of_mass_jacobian", "potential_energy", "mass_matrix", "gravity")
    of_v = ("velocities", "momentum", "kinetic_energy", "coriolis", "inverse_dynamics", "forward_dynamics", "loads")
    calls = [Call(f"joint_space.{name}", getattr(js, name), {"q": q}) for name in of_q]
    calls += [Call(f"joint_space.{name}", getattr(js, name), {"q": q, "v": v}) for name in of_v]
    slopes = ("inverse_dynamics_derivatives", {"a": v}), ("forward_dynamics_derivatives", {"forces": v, "t": 0.0})
    calls += [Call(f"joint_space.{name}", getattr(js, name), {"q": q, "v": v, **more}) for name, more in slopes]
    return [
        *calls,
        Call("joint_space.position", js.position, {"values": {"psi": 0.1}}),
        Call("joint_space.placed", js.placed, {"x": x}),
        Call("joint_space.inverse_dynamics", js.inverse_dynamics, {"q": q, "v": v, "a": v}),
        Call("joint_space.forward_dynamics", js.forward_dynamics, {"q": q, "v": v, "forces": v, "t": 0.0}),
        Call("joint_space.loads", js.loads, {"q": q, "v": v, "t": 0.0}),
        Call("joint_space.momentum", js.momentum, {"q": q, "v": v, "about": np.zeros(3)}),
        Call("joint_space.momentum_matrix", js.momentum_matrix, {"q": q, "about": np.zeros(3)}),
        Call("joint_space.jacobian", js.jacobian, {"q": q, "point": "C"}),
        Call("joint_space.jacobian", js.jacobian, {"q": q, "point": "C", "body": "second"}),
        Call("joint_space.inverse_kinematics", js.inverse_kinematics, {"point": "C", "place": np.array([0.5, -1.0, 0.0])}),
    ]


def simulation_calls(k: Any) -> list[Call]:
    """A motion step by step, and many of them."""
    sim, sims = ncgen.start(k), ncgen.start(k, 3)
    kept, all_kept = sim.state, sims.states
    calls = [
        Call("sim.step", lambda h, tau: sim.step(h, tau=tau), {"h": 1e-4, "tau": 0.1}),
        Call("sim.drive", sim.drive, {"tau": 0.1}),
        Call("sim.reset", sim.reset, {"state": kept}),
        Call("sims.step", lambda h, tau: sims.step(h, tau=tau), {"h": 1e-4, "tau": np.zeros(3)}),
        Call("sims.drive", sims.drive, {"tau": np.zeros(3)}),
        Call("sims.reset", sims.reset, {"rows": [0, 2], "states": all_kept}),
        Call("sims.project_state", sims.project_state, {"rows": [0, 1]}),
        Call("sim[]", sim.__getitem__, {"name": "psi"}),
        Call("sims[]", sims.__getitem__, {"name": "psi"}),
    ]
    for word, what, reset in (("state", kept, sim.reset), ("states", all_kept, lambda state: sims.reset(states=state))):
        members = {name: value for name, value in vars(what).items() if name != "mechanism"}

        def put_back(reset: Any = reset, what: Any = what, **members: Any) -> None:
            reset(type(what)(**members, mechanism=what.mechanism))

        calls.append(Call(f"reset to a {word}", put_back, members))
    return calls


def study_calls(k: Any) -> list[Call]:
    """Variants."""
    given = {"vary": {"M": np.array([1.0, 2.0])}, "keep": ["psi"], "p": {"M": 1.0}, "rtol": 1e-4}
    return [Call("study", lambda **more: ncgen.study(k.model, duration=0.01, **more), given)]
