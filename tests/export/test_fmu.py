"""Mock-up units are valid, move as we do in both modes, go back, and refuse what is wrong in words."""

from __future__ import annotations

import ctypes
import shutil
import zipfile

import numpy as np
import pytest
from exported import SECONDS, SOME, STRICT, reference, shell

from ncgen.emit.naming import identifier

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
from fmpy import fmi2, fmi3, read_model_description, simulate_fmu  # noqa: E402
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

VERSIONS = pytest.mark.parametrize("version", [2, 3])


@pytest.fixture
def unit(exports):
    """unit(name, version): path of the .fmu file."""
    return lambda name, version: str(exports(name, f"fmu{version}") / f"{identifier(name)}.fmu")


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
        unit(name, version), fmi_type=mode, stop_time=seconds, output_interval=seconds / 10, relative_tolerance=1e-10, output=names
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

    def start(self):
        if self.version == 2:
            self.unit.setupExperiment(startTime=0.0, tolerance=1e-10)
            self.unit.enterInitializationMode()
        else:
            self.unit.enterInitializationMode(startTime=0.0, tolerance=1e-10)
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
