"""Mock-up units are valid, move as we do in both modes, go back, and refuse what is wrong in words."""

from __future__ import annotations

import ctypes
import shutil
import zipfile

import numpy as np
import pytest
import sympy
from exported import SECONDS, SOME, STRICT, reference, shell

import ncgen
from ncgen import Model
from ncgen.emit.naming import prefix_of
from ncgen.exchange.examples import load
from ncgen.exchange.export import export
from ncgen.model.elements import Vector
from ncgen.solver.loads.reactions import reactions

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
from fmpy import fmi2, fmi3, read_model_description, simulate_fmu  # noqa: E402
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

VERSIONS = pytest.mark.parametrize("version", [2, 3])


@pytest.fixture
def unit(exports):
    """unit(name, version): path of the .fmu file."""
    return lambda name, version: str(exports(name, f"fmu{version}") / f"{prefix_of(name)}.fmu")


@VERSIONS
@pytest.mark.parametrize("name", SOME)
def test_valid_without_a_message(unit, name, version):
    assert validate_fmu(unit(name, version)) == []


@VERSIONS
@pytest.mark.parametrize("mode", ["ModelExchange", "CoSimulation"])
@pytest.mark.parametrize("name", SOME)
def test_moves_as_we_do(unit, name, version, mode):
    """Coordinates, velocities and energies over time are those of our own run, to 1e-6 of their size."""
    kernels, run = reference(name)
    seconds = SECONDS[name]
    names = [*kernels.coordinates, *(f"rate({c})" for c in kernels.coordinates), "kinetic", "potential", "work"]
    found = simulate_fmu(
        unit(name, version),
        fmi_type=mode,
        stop_time=seconds,
        output_interval=seconds / 10,
        relative_tolerance=1e-10,
        output=names,
        record_events=False,
    )
    energy = run.energy()
    ours = np.column_stack([run.q, run.qd, energy[:, :2], run.work])
    theirs = np.column_stack([found[c] for c in names])
    assert len(theirs) == len(ours)
    np.testing.assert_allclose(theirs, ours, rtol=1e-6, atol=1e-6 * max(1.0, np.max(np.abs(ours[:, : 2 * kernels.n]))))


class Host:
    """A unit loaded by hand, with the log lines it wrote."""

    def __init__(self, path: str, folder, version: int, token: str | None = None):
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        self.version, self.lines, self.failed = version, [], []
        description = read_model_description(str(folder))
        kind = fmi2.FMU2Slave if version == 2 else fmi3.FMU3Slave
        identifier = description.coSimulation.modelIdentifier
        self.unit = kind(guid=token or description.guid, unzipDirectory=str(folder), modelIdentifier=identifier, instanceName="unit")
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.units = {v.name: v.unit for v in description.modelVariables}
        if version == 2:

            def log(environment, name, status, category, message):
                self.lines.append((status, message.decode()))

            # FMPy's own callbacks, with ours as the logger
            callbacks = fmi2.fmi2CallbackFunctions()
            callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(log)
            callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
            callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
            self.callbacks = callbacks
            self.unit.instantiate(callbacks=callbacks, loggingOn=True)
        else:
            self.unit.instantiate(
                logMessage=lambda environment, status, category, message: self.lines.append((status, message.decode())), loggingOn=True
            )

    def enter(self):
        if self.version == 2:
            self.unit.setupExperiment(startTime=0.0, tolerance=1e-10)
            self.unit.enterInitializationMode()
        else:
            self.unit.enterInitializationMode(startTime=0.0, tolerance=1e-10)

    def start(self):
        self.enter()
        self.unit.exitInitializationMode()

    def get(self, *names):
        get = self.unit.getReal if self.version == 2 else self.unit.getFloat64
        return np.array(get([self.references[name] for name in names]))

    def set(self, name, value):
        (self.unit.setReal if self.version == 2 else self.unit.setFloat64)([self.references[name]], [value])

    def step(self, t, h):
        self.unit.doStep(currentCommunicationPoint=t, communicationStepSize=h)

    def refused(self, action, *arguments):
        """The log line of something that must fail with the standard's error status."""
        del self.lines[:]
        with pytest.raises(FMICallException):
            action(*arguments)
        ((status, line),) = self.lines
        assert status == 3
        return line


@pytest.fixture
def host(unit, tmp_path):
    return lambda name, version, **options: Host(unit(name, version), tmp_path / "unit", version, **options)


@VERSIONS
def test_reset_and_states(host, version):
    """Reset begins again, a kept state (also as bytes) is gone back to, and what follows is the same to the last bit."""
    h = host("pendulum", version)
    names = ("B.x", "B.y", "rate(B.x)", "kinetic", "der(rate(B.y))")
    keep = h.unit.getFMUState if version == 3 else h.unit.getFMUstate
    put = h.unit.setFMUState if version == 3 else h.unit.setFMUstate
    h.start()
    h.step(0.0, 0.5)
    middle, kept = h.get(*names), keep()
    h.step(0.5, 0.5)
    end = h.get(*names)
    put(kept)
    assert np.array_equal(h.get(*names), middle) and not np.array_equal(middle, end)
    h.step(0.5, 0.5)
    assert np.array_equal(h.get(*names), end)
    serialized = (h.unit.serializeFMUState if version == 3 else h.unit.serializeFMUstate)(kept)
    again = (h.unit.deserializeFMUState if version == 3 else h.unit.deSerializeFMUstate)(serialized)
    put(again)
    assert np.array_equal(h.get(*names), middle)
    h.unit.reset()
    h.start()
    h.step(0.0, 0.5)
    assert np.array_equal(h.get(*names), middle)


@VERSIONS
def test_wrong_input_is_refused(host, version):
    """With the standard's error status and one line that names the thing; the unit then goes on."""
    h = host("pendulum", version)
    assert "it must not be called now" in h.refused(h.step, 0.0, 0.1)
    assert "B.x is set to a value that is not finite" in h.refused(h.set, "B.x", np.nan)
    assert "kinetic cannot be set" in h.refused(h.set, "kinetic", 1.0)
    h.references["nothing"] = 999
    assert "no variable with value reference 999" in h.refused(h.get, "nothing")
    h.start()
    assert "B.x cannot be set now" in h.refused(h.set, "B.x", 0.5)
    assert "the step begins at t = 7 s, the unit is at t = 0 s" in h.refused(h.step, 7.0, 0.1)
    assert "a step of -1 s" in h.refused(h.step, 0.0, -1.0)
    h.step(0.0, 0.1)
    assert h.get("time") == pytest.approx(0.1, abs=1e-15)


@VERSIONS
def test_another_description_is_refused(unit, tmp_path, version):
    with pytest.raises(Exception, match="nstantiate"):
        Host(unit("pendulum", version), tmp_path / "unit", version, token="{other}")


@VERSIONS
def test_only_the_standards_functions_are_visible(unit, version, tmp_path):
    """The binary shows what the standard's header declares, all of it, and nothing else."""
    with zipfile.ZipFile(unit("pendulum", version)) as archive:
        archive.extractall(tmp_path)
    (binary,) = tmp_path.glob("binaries/*/pendulum.so")
    shown = {line.split()[-1] for line in shell(f"nm -D --defined-only {binary}", tmp_path).splitlines()}
    header = (tmp_path / f"sources/fmi{version}Functions.h").read_text()
    declared = {word.rstrip(";") for line in header.splitlines() if "_Export fmi" in line for word in line.split()[2:3]}
    assert shown == declared and len(shown) > 40


@VERSIONS
def test_sources_build_without_a_warning(unit, version, tmp_path):
    """The sources of the archive are enough to build the unit again."""
    with zipfile.ZipFile(unit("pendulum", version)) as archive:
        archive.extractall(tmp_path)
    shell(f"cc -std=c99 -O1 {STRICT} -isystem . -fPIC -shared *.c -o unit.so -lm", tmp_path / "sources")
    assert ctypes.CDLL(str(tmp_path / "sources/unit.so"))
    shutil.rmtree(tmp_path / "sources")


def swing() -> Model:
    """A pendulum whose length, mass and gravity are parameters, with a spring and a force that changes with time."""
    model = Model("swing")
    length, mass, g = (model.parameter(*pair) for pair in (("length", 1.5), ("mass", 0.7), ("g", 9.81)))
    A, B = model.point("A", (0, 0), fixed=True), model.point("B", (1.2, -0.9))
    model.distance(A, B, length)
    model.body("bob", points=[B], mass=mass)
    model.gravity((0, -g, 0))
    model.spring(A, B, stiffness=3 * length, damping=0.2, free_length=1.0)
    model.force(B, (sympy.cos(3 * model.time), 0, 0))
    return model


@pytest.fixture(scope="module")
def swings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("swing")
    for version in (2, 3):
        export(swing(), f"fmu{version}", folder / str(version))
    return folder


def dense_motion(kernels, t, q, qd, p):
    """{kind of variable: values} that follow from a state, by dense solves in complex numbers."""
    J, M = kernels.jacobian(q, t, p), kernels.mass_matrix(q, t, p)
    saddle = np.block([[M, J.T], [J, np.zeros((kernels.m, kernels.m))]])
    onto = np.linalg.solve(saddle, np.concatenate([0 * q, kernels.nu(q, t, p) - J @ qd]))
    qd = qd + onto[: kernels.n]
    x = np.linalg.solve(saddle, np.concatenate([kernels.force(q, qd, t, p), kernels.gamma(q, qd, t, p)]))
    kinetic, potential, power = kernels.energy(q, qd, t, p)
    power = power - kernels.nu(q, t, p) @ x[kernels.n :]
    return np.concatenate([qd, x, [kinetic, potential, power]])


@VERSIONS
@pytest.mark.parametrize("name", ["nfourbar", pytest.param("suspension", marks=pytest.mark.slow)])
def test_joint_loads_have_names_and_units(host, name, version):
    """After a step they are those of the Python run, in N and N m."""
    h = host(name, version)
    h.start()
    h.step(0.0, 0.1)
    kernels, _ = reference(name)
    options = {k: v for k, v in kernels.model.simulation_options.items() if k in ("zd0", "z")}
    run = ncgen.simulate(kernels, 0.1, rtol=1e-11, atol=1e-12, points=2, **options)
    known = reactions(run)
    units = {"force": "N", "moment": "N.m"}
    seen = 0
    for body in run.model.bodies.values():
        for element in body.elements:
            kind = "moment" if isinstance(element, Vector) else "force"
            names = [f"{kind}({body.name},{element.name}).{axis}" for axis in "xyz"]
            assert {h.units[n] for n in names} == {units[kind]}
            expected = getattr(known, kind)(body.name, element.name)[-1]
            np.testing.assert_allclose(h.get(*names), expected, rtol=1e-6, atol=1e-6 * max(1.0, np.max(np.abs(run.lam))))
            seen += 1
    assert seen >= 6


def unknowns(kernels):
    names = kernels.coordinates
    rates = [f"der({c})" for c in names], [f"der(rate({c}))" for c in names], [f"multiplier({i + 1})" for i in range(kernels.m)]
    return [*sum(rates, []), "kinetic", "potential", "power"]


@VERSIONS
@pytest.mark.parametrize("name", ["swing", "nfourbar", pytest.param("suspension", marks=pytest.mark.slow)])
def test_directional_derivatives(unit, swings, tmp_path, name, version):
    """By time, every state and every parameter, along two directions: complex steps through dense solves, to 1e-9 of the largest.

    Velocities are projected by one solve without refinement, which leaves 1e-11 times the spread of the masses. FMI 3.0 has
    the transpose as well.
    """
    path = str(swings / str(version) / "swing.fmu") if name == "swing" else unit(name, version)
    h = Host(path, tmp_path / "unit", version)
    h.start()
    h.step(0.0, 0.1)
    kernels = ncgen.compile(swing() if name == "swing" else load(name), backend="numpy")
    n, columns = kernels.n, kernels.coordinates
    knowns = ["time", *columns, *(f"rate({c})" for c in columns), *kernels.parameters]
    at = h.get(*knowns)
    J = Jacobian(h)
    rng = np.random.default_rng(8)
    for seed in rng.standard_normal((2, len(knowns))):
        t, q, qd, p = np.split(at + 1e-30j * seed, [1, 1 + n, 1 + 2 * n])
        wanted = dense_motion(kernels, t[0], q, qd, p).imag / 1e-30
        found = J.along(unknowns(kernels), knowns, seed)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9 * np.max(np.abs(wanted)))
        if version == 3:
            weights = rng.standard_normal(len(wanted))
            assert J.across(unknowns(kernels), knowns, weights) @ seed == pytest.approx(weights @ wanted, abs=1e-8 * np.max(np.abs(wanted)))


class Jacobian:
    """Derivatives that a unit gives, by names."""

    def __init__(self, host: Host):
        self.unit, self.references = host.unit, host.references

    def along(self, unknowns, knowns, seed):
        u, k = ([self.references[name] for name in names] for names in (unknowns, knowns))
        return np.array(self.unit.getDirectionalDerivative(u, k, list(seed)))

    def across(self, unknowns, knowns, weights):
        u, k = ([self.references[name] for name in names] for names in (unknowns, knowns))
        return np.array(self.unit.getAdjointDerivative(u, k, list(weights), len(knowns)))


@VERSIONS
def test_derivatives_while_a_unit_initialises(swings, tmp_path, version):
    """Loops are then closed, and that is differentiated: a point off its circle goes to it along the radius."""
    h = Host(str(swings / str(version) / "swing.fmu"), tmp_path / "unit", version)
    h.enter()
    h.set("B.x", 1.0)
    h.set("B.y", -0.9)
    raw = np.array([1.0, -0.9])
    u = raw / np.linalg.norm(raw)
    np.testing.assert_allclose(h.get("B.x", "B.y"), 1.5 * u, rtol=1e-14)
    J = Jacobian(h)
    for column, wanted in zip(("B.x", "B.y"), 1.5 * (np.eye(2) - np.outer(u, u)) / np.linalg.norm(raw), strict=True):
        np.testing.assert_allclose(J.along(["B.x", "B.y"], [column], [1.0]), wanted, atol=1e-12)
    np.testing.assert_allclose(J.along(["B.x", "B.y", "length"], ["length"], [2.0]), [*2 * u, 2.0], atol=1e-12)
    names = ["force(bob,B).x", "force(bob,B).y", "B.x", "B.y", "length"]
    difference = differences(h, names, "length", 1e-5)
    np.testing.assert_allclose(J.along(names, ["length"], [1.0]), difference, rtol=0, atol=1e-7 * np.max(np.abs(difference)))
    np.testing.assert_allclose(J.along(["rate(B.x)", "rate(B.y)"], ["rate(B.x)"], [1.0]), [1 - u[0] ** 2, -u[0] * u[1]], atol=1e-12)


def differences(host, names, known, step):
    """Derivatives of variables by one of them, by central differences."""
    middle, found = host.get(known)[0], []
    for side in (1, -1):
        host.set(known, middle + side * step)
        found.append(host.get(*names))
    host.set(known, middle)
    return (found[0] - found[1]) / (2 * step)


@VERSIONS
def test_wrong_questions_about_derivatives_are_refused(swings, tmp_path, version):
    h = Host(str(swings / str(version) / "swing.fmu"), tmp_path / "unit", version)
    J = Jacobian(h)
    assert "it must not be called now" in h.refused(J.along, ["kinetic"], ["B.x"], [1.0])
    h.start()
    h.references["nothing"] = 999
    assert "kinetic follows from others and is no known" in h.refused(J.along, ["kinetic"], ["kinetic"], [1.0])
    assert "the seed of B.x is not finite" in h.refused(J.along, ["kinetic"], ["B.x"], [np.inf])
    assert "no variable with value reference 999" in h.refused(J.along, ["nothing"], ["B.x"], [1.0])
    assert "no variable with value reference 999" in h.refused(J.along, ["kinetic"], ["nothing"], [1.0])
