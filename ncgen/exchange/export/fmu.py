"""Functional mock-up units of FMI 2.0 and 3.0: model exchange and co-simulation, with binary and sources.

The standard's own headers come from the Python package fmpy, which ships them (BSD licence).
"""

from __future__ import annotations

import hashlib
import importlib.util
import io
import platform
import sys
import uuid
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from ncgen.emit.environment import render
from ncgen.errors import ModelError, NcgenError
from ncgen.exchange.export.package import Package, renamed
from ncgen.model.bodies import Body, load_names
from ncgen.model.elements import AXES, Spatial, Vector
from ncgen.model.values import Input, Parameter
from ncgen.program.motions.full_loads import loaded_elements
from ncgen.solver.events.event_table import EventTable
from ncgen.toolchain.cache import build, compiled
from ncgen.toolchain.compilers import zig

FLAGS = ("-std=c99", "-O1", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
"""For any processor of this kind, not only this one; nothing but the standard's functions can be seen from outside."""


class Platform(NamedTuple):
    """Another machine: what zig calls it, the folders of its binaries in FMI 2.0 and 3.0, and how they end."""

    target: str
    folders: dict[int, str]
    suffix: str


PLATFORMS = {
    "linux": Platform("x86_64-linux-gnu", {2: "linux64", 3: "x86_64-linux"}, ".so"),
    "windows": Platform("x86_64-windows-gnu", {2: "win64", 3: "x86_64-windows"}, ".dll"),
    "macos": Platform("x86_64-macos", {2: "darwin64", 3: "x86_64-darwin"}, ".dylib"),
    "macos-arm": Platform("aarch64-macos", {3: "aarch64-darwin"}, ".dylib"),
    "linux-arm": Platform("aarch64-linux-gnu", {3: "aarch64-linux"}, ".so"),
}
"""FMI 2.0 knows no folders of ARM's; its darwin64 runs there, too."""

BASE_UNITS = {
    "s": 's="1"', "m": 'm="1"', "m/s": 'm="1" s="-1"', "m/s2": 'm="1" s="-2"', "rad": 'rad="1"', "rad/s": 'rad="1" s="-1"',
    "rad/s2": 'rad="1" s="-2"', "1": "", "1/s": 's="-1"', "1/s2": 's="-2"', "J": 'kg="1" m="2" s="-2"',
    "kg": 'kg="1"', "kg m2": 'kg="1" m="2"', "N/m": 'kg="1" s="-2"', "N s/m": 'kg="1" s="-1"', "N m": 'kg="1" m="2" s="-2"',
    "N": 'kg="1" m="1" s="-2"', "N.m": 'kg="1" m="2" s="-2"', "W": 'kg="1" m="2" s="-3"',
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Variable:
    """One real variable of the unit; derivative: place of the state that it is the derivative of."""

    name: str
    unit: str
    description: str
    causality: str = "output"
    variability: str = "continuous"
    initial: str | None = "calculated"
    start: float | None = None
    derivative: int | None = None


@dataclass(frozen=True)
class Group:
    """Variables that stand together: name in C, what they are, and where the first one stands."""

    name: str
    heading: str
    first: int
    variables: list[Variable]

    @property
    def size(self) -> int:
        return len(self.variables)


def fmu_files(package: Package, platforms: Sequence[str] = (), *, version: int) -> dict[str, bytes]:
    """{file name: the unit}.

    platforms: of `PLATFORMS`, in addition to the machine that this is
    Raises NcgenError for a platform that is not known or without fmpy, CompileError without a compiler.
    """
    headers = _headers(version)
    package = package.with_tangents()
    groups = _groups(package)
    variables = [v for group in groups for v in group.variables]
    token = hashlib.sha256("".join(package.c.values()).encode() + repr(variables).encode()).hexdigest()[:32]
    records = package.records | {
        "standard": version,
        "token": f"{{{uuid.UUID(token)}}}",
        "groups": groups,
        "end": len(variables),
        "variables": variables,
        "output_places": [i for i, v in enumerate(variables) if v.causality == "output"],
        "derivatives": [i for i, v in enumerate(variables) if v.derivative is not None],
        "initial_unknowns": [i for i, v in enumerate(variables) if v.initial in ("approx", "calculated") and not _is_condition(v)],
        "indicators": [i for i, v in enumerate(variables) if _is_condition(v)],
        "units_used": {v.unit: BASE_UNITS.get(v.unit) for v in variables if v.unit},
        "compiled": [name for name in (*package.c, f"fmi{version}.c") if name.endswith(".c")],
    }
    sources = package.c | {
        "instance.h": renamed(render("package/fmu/instance.h.jinja", **records), package.prefix),
        f"fmi{version}.c": render(f"package/fmu/fmi{version}.c.jinja", **records),
        **headers,
    }
    files = {f"sources/{name}": text.encode() for name, text in sources.items()}
    suffix = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
    files[f"binaries/{_platform(version)}/{package.prefix}{suffix}"] = compiled(sources, FLAGS).library.read_bytes()
    for other in others(platforms, version):
        built = build(sources, zig(), (*FLAGS, "-s", "-target", other.target), loads=False)
        files[f"binaries/{other.folders[version]}/{package.prefix}{other.suffix}"] = built.library.read_bytes()
    files["modelDescription.xml"] = render(f"package/fmu/fmi{version}.xml.jinja", **records).encode()
    if version == 3:
        files["sources/buildDescription.xml"] = render("package/fmu/buildDescription.xml.jinja", **records).encode()
    return {f"{package.prefix}.fmu": _archive(files)}


def _groups(package: Package) -> list[Group]:
    """All variables, in the order of their value references."""
    kernels, n = package.kernels, package.kernels.n
    coordinates = list(zip(kernels.coordinates, package.records["units"], package.q, package.qd, strict=True))
    rows = enumerate(kernels.rows, 1)
    parameters = zip(package.records["parameters"], kernels.p0, strict=True)
    q, rate, work = 1, 1 + n, 1 + 2 * n  # where the states stand

    loaded = loaded_elements(package.sources.programs.equations) if package.loads else []
    changed = package.events.changed if package.events else frozenset()

    def state(name: str, unit: str, description: str, start: float) -> Variable:
        return Variable(name=name, unit=unit, description=description, initial="approx", start=float(start))

    lists = {
        "TIME": ("time", [Variable(name="time", unit="s", description="time", causality="independent", initial=None)]),
        "Q": ("coordinates", [state(c, u, f"coordinate {c}", x) for c, u, x, _ in coordinates]),
        "RATE": ("their velocities", [state(f"rate({c})", f"{u}/s", f"velocity of {c}", v) for c, u, _, v in coordinates]),
        "WORK": (
            "work",
            [Variable(name="work", unit="J", description="work of drivers and of forces without a potential", initial="exact", start=0.0)],
        ),
        "DQ": (
            "derivatives of the coordinates",
            [
                Variable(name=f"der({c})", unit=f"{u}/s", description=f"derivative of {c}", causality="local", derivative=q + i)
                for i, (c, u, *_) in enumerate(coordinates)
            ],
        ),
        "DRATE": (
            "derivatives of the velocities",
            [
                Variable(name=f"der(rate({c}))", unit=f"{u}/s2", description=f"acceleration of {c}", derivative=rate + i)
                for i, (c, u, *_) in enumerate(coordinates)
            ],
        ),
        "POWER": (
            "power",
            [Variable(name="power", unit="W", description="power of drivers and of forces without a potential", derivative=work)],
        ),
        "KINETIC": ("kinetic energy", [Variable(name="kinetic", unit="J", description="kinetic energy")]),
        "POTENTIAL": ("potential energy", [Variable(name="potential", unit="J", description="potential energy")]),
        "LAM": (
            "multipliers",
            [Variable(name=f"multiplier({i})", unit="", description=f"multiplier of row {i}: {r.label} ({r.owner})") for i, r in rows],
        ),
        "LOAD": ("joint loads", [v for load in loaded for v in _load(*load)]),
        **(_event_variables(package.events) if package.events and package.events.names else {}),
        "OUTPUT": (
            "outputs of the model",
            [Variable(name=o.label, unit=o.unit, description=f"output {o.label}") for o in kernels.model.outputs.values()],
        ),
        "P": ("parameters, then inputs", [_given(p, float(x), p.name in changed) for p, x in parameters]),
    }
    return _in_order(lists)


def _in_order(lists: dict[str, tuple[str, list[Variable]]]) -> list[Group]:
    """Groups one after the other; an output that is called like another variable is marked as one."""
    taken = [v.name for name, (_, variables) in lists.items() if name != "OUTPUT" for v in variables]
    heading, outputs = lists["OUTPUT"]
    lists["OUTPUT"] = heading, [replace(v, name=f"output({v.name})") if v.name in taken else v for v in outputs]
    groups, first = [], 0
    for name, (heading, variables) in lists.items():
        groups.append(Group(name, heading, first, variables))
        first += len(variables)
    return groups


def _event_variables(events: EventTable) -> dict[str, tuple[str, list[Variable]]]:
    """Conditions of events, loads of what is held among them, and counts."""
    conditions = [
        Variable(name=f"condition({name})", unit="", description=f"condition of event {name}", causality="local")
        for name in events.condition_names
    ]
    squares = {each.words for each in events.holdables if each.sticks}
    left = "what its load has left, 1 where it is not held"
    conditions += [
        Variable(
            name=f"load({name})", unit="" if name in squares else "N", description=f"condition of event {name}: {left}", causality="local"
        )
        for name in events.loads
    ]
    attributes = {"causality": "output", "variability": "discrete", "initial": "exact", "start": 0.0}
    counts = [
        Variable(name=f"count({name})", unit="", description=f"how often event {name} has happened", **attributes) for name in events.names
    ]
    return {"CONDITION": ("conditions of events", conditions), "COUNT": ("how often events have happened", counts)}


def _given(parameter: Parameter, default: float, changes: bool) -> Variable:
    """What the unit is given: a number for long, or at every instant; or what its events change."""
    variable = partial(Variable, name=parameter.name, unit=parameter.unit, start=default)
    if changes:
        return variable(description=f"{parameter.name}, which events change", causality="local", variability="discrete", initial="exact")
    if isinstance(parameter, Input):
        return variable(description=f"input {parameter.name}", causality="input", variability="continuous", initial=None)
    return variable(description=f"parameter {parameter.name}", causality="parameter", variability="tunable", initial="exact")


def _is_condition(variable: Variable) -> bool:
    return variable.description.startswith("condition of event ")


def _load(body: Body, element: Spatial) -> list[Variable]:
    """The load of joints on a body at one of its elements: a force at a point, a moment through a vector."""
    kind, unit, where = ("moment", "N.m", "through") if isinstance(element, Vector) else ("force", "N", "at")
    text = f"joint {kind} on {body.name} {where} {element.name}"
    return [
        Variable(name=name, unit=unit, description=f"{text}, {axis}") for name, axis in zip(load_names(body, element), AXES, strict=True)
    ]


def _headers(version: int) -> dict[str, str]:
    headers = importlib.util.find_spec("fmpy")
    if headers is None or not headers.submodule_search_locations:
        raise NcgenError("the headers of FMI are missing: they come with the package fmpy; run pip install 'ncgen[export]'")
    folder = Path(headers.submodule_search_locations[0]) / "c-code"
    kinds = ("Functions", "FunctionTypes", "TypesPlatform" if version == 2 else "PlatformTypes")
    return {f"fmi{version}{kind}.h": (folder / f"fmi{version}{kind}.h").read_text(encoding="utf-8") for kind in kinds}


def others(platforms: Sequence[str], version: int) -> list[Platform]:
    """The platforms by these names, but for this machine's own. Raises NcgenError for one that is not known, or without ziglang."""
    known = [name for name, platform in PLATFORMS.items() if version in platform.folders]
    for name in platforms:
        if name not in known:
            raise ModelError(f"platforms: {name} is unknown to fmu{version}; choose among {', '.join(known)}")
    if platforms and not importlib.util.find_spec("ziglang"):
        raise NcgenError("platforms: FMUs for other platforms are compiled with the package ziglang; run pip install 'ncgen[export]'")
    named = [PLATFORMS[name] for name in dict.fromkeys(platforms)]
    return [platform for platform in named if platform.folders[version] != _platform(version)]


def _platform(version: int) -> str:
    system = {"win32": "win", "darwin": "darwin"}.get(sys.platform, "linux")
    machine = platform.machine().lower()
    bits = 64 if sys.maxsize > 2**32 else 32
    if version == 2:
        return f"{system}{bits}"
    processor = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    return f"{processor}-{ {'win': 'windows'}.get(system, system) }"


def _archive(files: dict[str, bytes]) -> bytes:
    """A zip file with the same bytes whenever it is written."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, data)
    return buffer.getvalue()
