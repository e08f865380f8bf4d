"""What every export starts from: a mechanism's sources, its independent coordinates, where it starts, and what it costs.

All names of C that ncgen gives away begin with the model's: `ncgen_simulate` becomes `robot_ncgen_simulate`, NCGEN_OK becomes
ROBOT_NCGEN_OK, ncgen.h becomes robot_ncgen.h. So two exported mechanisms live in one program, or in one file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen import __version__
from ncgen.build.kernels import Kernels
from ncgen.compiler import compile, generate
from ncgen.emit.c import HEADERS, RUNTIME, dynamics_files, number
from ncgen.emit.environment import render, verbatim
from ncgen.emit.naming import identifier
from ncgen.emit.sources import Sources
from ncgen.errors import ModelError
from ncgen.model import Model
from ncgen.model.elements import Angle, Vector
from ncgen.program.cost import cost
from ncgen.program.dynamics import LARGEST, DynamicsPrograms, Split, assemble_dynamics
from ncgen.solver.assembly import assemble
from ncgen.solver.partition import Partition, choose_partitions
from ncgen.solver.rank import trial_positions

PUBLIC = ("ncgen.h", "ncgen_runtime.h")
"""Headers of the runtime that an embedder reads; the others stay beside the sources."""

NEWTON_STEPS = 4
"""Newton steps of the position problem that one evaluation may take in a step of fixed length."""


@dataclass(frozen=True)
class Package:
    """A mechanism ready to be written for a target.

    q, zd: consistent initial position and independent velocities; duration: s
    """

    sources: Sources
    kernels: Kernels
    partition: Partition
    dynamics: DynamicsPrograms
    q: np.ndarray
    zd: np.ndarray
    duration: float

    @property
    def prefix(self) -> str:
        return identifier(self.kernels.name)

    @cached_property
    def c(self) -> dict[str, str]:
        """{file name: text}: everything in C, with names of its own."""
        equations = self.sources.programs.equations
        files = self.sources.c | dynamics_files(self.dynamics, equations, self.kernels.row_sizes)
        files |= {name: verbatim(f"c/{name}") for name in (*HEADERS, *RUNTIME)}
        files |= {f"{self.prefix}_motion.{kind}": render(f"package/motion.{kind}.jinja", **self.records) for kind in "hc"}
        return {renamed(name, self.prefix): renamed(text, self.prefix) for name, text in files.items()}

    @property
    def public(self) -> tuple[str, ...]:
        """Names of the headers an embedder includes."""
        own = (f"{self.prefix}.h", f"{self.prefix}_dynamics.h", f"{self.prefix}_motion.h")
        return (*own, *(renamed(name, self.prefix) for name in PUBLIC))

    @cached_property
    def records(self) -> dict:
        """What the templates of all targets are filled with."""
        programs = self.sources.programs
        operations = {name: cost(program).total for name, program in programs.programs.items()}
        newton, acceleration = cost(self.dynamics.newton).total, cost(self.dynamics.acceleration).total
        return {
            "version": __version__,
            "prefix": self.prefix,
            "upper": self.prefix.upper(),
            "model": self.kernels.model,
            "coordinates": self.kernels.coordinates,
            "units": [self.unit(name) for name in self.kernels.coordinates],
            "rows": self.kernels.rows,
            "parameters": programs.equations.parameters,
            "defaults": [float(value) for value in self.kernels.p0],
            "independent": self.partition.names(self.kernels),
            "dependent": len(self.partition.dependent),
            "start": [number(float(x)) for x in self.q],
            "speeds": [number(float(x)) for x in self.zd],
            "duration": self.duration,
            "operations": operations,
            "newton_steps": NEWTON_STEPS,
            "newton": newton,
            "acceleration": acceleration,
            # a step evaluates accelerations at its start, at three inner stages and at its end, positions at all but the first
            "step": 5 * acceleration + 4 * NEWTON_STEPS * newton,
            "numbers": 3 + 2 * self.kernels.n + len(self.zd),
            "width": 100,
        }

    def unit(self, coordinate: str) -> str:
        """Unit of a free coordinate: m, rad, or 1 for a component of a unit vector."""
        kinds = {c.name: type(e) for e in self.kernels.model.elements.values() for c in e.components}
        return {Angle: "rad"}.get(kinds[coordinate], "1" if issubclass(kinds[coordinate], Vector) else "m")


def package(model: Model, independent: tuple[str, ...] = ()) -> Package:
    """Generate a mechanism and choose its independent coordinates. Raises ModelError where its motion has no export."""
    if reason := _refusal(model):
        raise ModelError(f"{model.name} cannot be exported: {reason}")
    sources = generate(model)
    kernels = compile(sources, backend="numpy")
    q = assemble(kernels, kernels.q0)
    options = model.simulation_options
    parts = choose_partitions(kernels, q, 0.0, kernels.p0, independent or tuple(options.get("z", model.chosen_independent)))
    part = parts.position
    if len(part.independent) > LARGEST:
        raise ModelError(f"{model.name} cannot be exported: it has {len(part.independent)} degrees of freedom, the most is {LARGEST}")
    split = Split(*(tuple(map(int, a)) for a in (part.rows, part.dependent, part.independent)))
    places = kernels.phi_q_pattern.positions()
    samples = [dict(zip(places, kernels.values("phi_q", 0.0, x, None, kernels.p0).tolist())) for x in trial_positions(kernels, q, 0.0, None)]
    dynamics = assemble_dynamics(sources.programs.equations, split, samples, kernels.column_sizes)
    speeds = options.get("zd0", {})
    zd = np.array([float(speeds.get(name, 0.0)) for name in part.names(kernels)])
    if lost := sorted(set(speeds) - set(part.names(kernels))):
        raise ModelError(f"{model.name}: the model starts with a velocity of {lost[0]}, which is not independent; add it with --independent")
    return Package(sources, kernels, part, dynamics, q, zd, float(options.get("duration", 1.0)))


def _refusal(model: Model) -> str | None:
    if model.callbacks:
        return "it calls a Python function"
    if model.branches:
        return "the paper's sine-or-cosine rows choose anew between steps; use smooth angles"
    if any(row.level != "position" for row in model.rows):
        return "rolling conditions need two partitions"
    return None


def renamed(text: str, prefix: str) -> str:
    """Names of C and of files that begin like ncgen's, with the model's name before them."""
    text = re.sub(r"\bncgen(?=_\w|\.[hc]\b)", f"{prefix}_ncgen", text)
    return re.sub(r"\bNCGEN_(?=\w)", f"{prefix.upper()}_NCGEN_", text)
